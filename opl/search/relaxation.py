"""The least box that meets the convex hull of each of some walls, by linear programming.

A box that misses the hull of a wall has to grow towards it: the prices of faces that tell by how
much are a cut, a sum over the faces that no box which meets the wall is below. The least box that
keeps the cuts known so far, and one that meets all hulls, come nearer to each other: the wall that
is farthest from a box between the two gives the next cut, or a point of its hull for the second
(cutting planes: Kelley, J. SIAM 8, 1960; between two points: Ben-Ameur and Neto, 2007). A
wall beside one that gave a cut is mostly met then as well: few of many walls that are alike give
any.

The cuts that hold the least box up tell how hard each wall presses on each face, all on one face
together at most 1: no box is smaller than the core and what every wall presses out at the least, at
the cell of it that presses least. The bound does not rest on how these prices were found: it is
computed anew from them, over all cells.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.search.hulls import CLOSE, least_pressed, missed, nearest_end
from opl.search.simplex import pivoted, take_in

ROUND_OFF = 1e-9  # [rad] of the sums that make a bound
MOST_LOOKS = 4000  # at walls
MOST_CUTS = 96  # known at once; those that hold nothing up give way
BETWEEN = 0.1  # of the way from the least box so far to one that meets all: where cuts are sought
ENOUGH = 0.02  # of what is left to be closed: how near these may come to each other at the least
NEAR = 3e-3  # of the size of interest: likewise


@kernel("int64(float64[:,::1],int64[::1],int64)", makes_arrays=True)
def _without_slack(table, basic, n_cuts):  # type: ignore[no-untyped-def]
    """Forget the cuts of a dictionary that hold nothing up; return how many rows are left."""
    kept = 0
    for row in range(n_cuts):
        if basic[row] < 12:
            table[1 + kept], basic[kept] = table[1 + row], basic[row]
            kept += 1
    return kept


@kernel(
    "UniTuple(float64,2)(float64[:,::1],float64[:,::1],int64[:,::1],int64,float64[::1],float64[::1],"
    "float64,float64[:,::1],float64[::1],float64[:,::1])",
    early=True,
    makes_arrays=True,
)
def least_box(  # type: ignore[no-untyped-def]
    cells, shifts, spans, n_walls, low, high, closing, box, lost, prices
):
    """Return a bound on the box that holds a core and a point of each wall, in [rad].

    And how many numbers were worked on, about.

    Args:
        cells: The table of `Cells`.
        shifts: What the cells of each source are shifted by in [rad], shape (m, 6).
        spans: What is left of walls, sorted by their walls, shape (n, 5). Walls without any are
            left out.
        n_walls: How many walls.
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.
        closing: A larger bound than this is of no interest, in [rad].
        box: Filled with the faces of a box that meets the hulls, lower ones first, shape (2, 6).
        lost: Filled with how much more each wall would press had its cells no pads, in [rad].
        prices: Filled with how hard each wall presses on each upper face of the box, and on each
            lower one, from 0 to 1, shape (n_walls, 12).
    """
    core, work = (high - low).sum(), 0.0
    begin, end = np.zeros(n_walls, dtype=np.int64), np.zeros(n_walls, dtype=np.int64)
    for k in range(len(spans) - 1, -1, -1):
        begin[spans[k, 0]] = k
        end[spans[k, 0]] = max(end[spans[k, 0]], k + 1)
    # of each wall a point of its hull, as it presses on the core
    point, price, lower, upper = np.zeros((n_walls, 12)), np.empty(12), low.copy(), high.copy()
    place = np.empty(2)
    prices[:], lost[:] = 0.0, 0.0
    for w in range(n_walls):
        if end[w] > begin[w]:
            own = spans[begin[w] : end[w]]
            work += nearest_end(cells, shifts, own, low, high, point[w], place)
    # variables: how far each face is beyond the core; rows: by how much each cut is kept, from name
    # 12 on
    table = np.zeros((1 + MOST_CUTS, 13))
    basic, others = np.empty(MOST_CUTS, dtype=np.int64), np.arange(12)
    for f in range(12):
        table[0, 1 + f] = -1.0 - 1e-9 * f  # no step is for nothing
    cut, cut_wall = np.empty((MOST_LOOKS, 12)), np.empty(MOST_LOOKS, dtype=np.int64)
    n_cuts, n_rows, met = 0, 0, np.zeros(n_walls, dtype=np.bool_)
    # faces beyond the core: of the least box so far, of one that meets all, and one between
    beyond, best, between, around = np.zeros(12), np.full(12, np.inf), np.zeros(12), np.empty(12)
    for _ in range(MOST_LOOKS):
        work += 24.0 * n_walls
        around[:] = 0.0
        for w in range(n_walls):
            for f in range(12):
                around[f] = max(around[f], point[w, f])
        if around.sum() < best.sum() - CLOSE:
            best[:], met[:] = around, False
        size = core + beyond.sum()
        left = closing - size
        if left <= 0.0 or core + best.sum() - size <= min(ENOUGH * left, NEAR * closing):
            break
        between[:] = beyond + BETWEEN * (best - beyond)
        worst, farthest = -1, CLOSE
        for w in range(n_walls):
            away = 0.0
            for f in range(12):
                away += max(point[w, f] - between[f], 0.0)
            if away > farthest and not met[w]:
                worst, farthest = w, away
        if worst < 0:
            break
        own = spans[begin[worst] : end[worst]]
        upper[:], lower[:] = high + between[:6], low - between[6:]
        point[worst] -= between
        away, numbers = missed(cells, shifts, own, lower, upper, price, point[worst], place)
        point[worst] += between
        work += numbers
        met[worst] = True
        if away <= CLOSE:
            continue
        met[:] = False
        if n_rows == MOST_CUTS:
            n_rows = _without_slack(table, basic, n_rows)
        cut[n_cuts], cut_wall[n_cuts] = price, worst
        wanted = away + (price * between).sum()
        n_rows = take_in(table, basic, others, n_rows, price, -wanted, 12 + n_cuts)
        n_cuts += 1
        work += 13.0 * pivoted(table, basic, others, n_rows, True) * n_rows
        beyond[:] = 0.0
        for row in range(n_rows):
            if basic[row] < 12:
                beyond[basic[row]] = max(table[1 + row, 0], 0.0)
    for j in range(12):
        if others[j] >= 12:
            n = others[j] - 12
            prices[cut_wall[n]] += max(-table[0, 1 + j], 0.0) * cut[n]
    for f in range(12):
        prices[:, f] /= max(prices[:, f].sum(), 1.0)
    bound = core
    for w in range(n_walls):
        if (prices[w] > 0.0).any():
            own = spans[begin[w] : end[w]]
            out, cell, _, _, numbers = least_pressed(cells, shifts, own, prices[w], low, high)
            bound += out
            work += numbers
            for j in range(6):
                lost[w] += (
                    prices[w, 6 + j] * cells[cell, 18 + j] - prices[w, j] * cells[cell, 12 + j]
                )
    box[0], box[1] = low - best[6:], high + best[:6]
    return bound - ROUND_OFF, work
