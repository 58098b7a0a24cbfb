"""Bounds of a subproblem: what no small box holds is cut off, and a linear program over the rest.

A wall with one span left is relaxed to a segment, start + along * x + [pad_low, pad_high] for some
0 <= x <= 1; its error falls with the square of the span. How far each face of the box must move out
of the core, and where on its segment each point lies, are the variables of the linear program; that
every face lies beyond every point are its constraints. Its dual starts from prices of nothing, and
a simplex method in a small table raises them. The bound does not rest on the method: from any
prices a lower bound follows, and it is computed anew from those found.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from opl.search.outside import nearest_on_chord
from opl.search.walls import UNKNOWN

MOST_ROUNDS = 12  # of cutting spans off; more would cut little
STILL = 1e-6  # [rad] a core that grows by less in a round has stopped growing
ROUND_OFF = 1e-9  # [rad] of the sums that make a bound
MOST_PIVOTS = 2000
ENTERS = 1e-10  # [rad] gain below which a price is not raised
PIVOT = 1e-9  # smallest that is divided by


@njit(
    "int64(float64[:,::1],int64[:,::1],int64[::1],int64,float64[::1],float64[::1],float64,"
    "float64[::1])",
    cache=True,
)
def tighten(cells, spans, pass_index, n_keys, low, high, closing, sizes):  # type: ignore[no-untyped-def]
    """Cut off what no box below a size can hold; return how many spans are left, 0 if none can be.

    Args:
        cells: The table of `Cells`.
        spans: Sorted by their walls; those left are moved to the front, shape (n, 5).
        pass_index: Of each wall, shape (k,).
        n_keys: Number of keys.
        low: The lower faces of the box are not above these, lowered, in [rad], shape (6,).
        high: The upper faces are not below these, raised.
        closing: The size in [rad].
        sizes: Filled with the least size of a box that reaches each wall, shape (k,).
    """
    n, n_walls = len(spans), len(pass_index)
    n_passes = 0
    for wall in range(n_walls):
        n_passes = max(n_passes, pass_index[wall] + 1)
    walls_of = np.zeros(n_passes, dtype=np.int64)
    for wall in range(n_walls):
        walls_of[pass_index[wall]] += 1
    least, most = np.empty(6), np.empty(6)
    for _ in range(MOST_ROUNDS):
        change, left, k = 0.0, 0, 0
        for wall in range(n_walls):
            before, smallest = left, np.inf
            least[:], most[:] = np.inf, -np.inf
            while k < n and spans[k, 0] == wall:
                begin, stop = -1, -1
                for cell in range(spans[k, 3], spans[k, 4]):
                    size = 0.0
                    for j in range(6):
                        a, b = cells[cell, j], cells[cell, 6 + j]
                        edge = max(min(a, b) + cells[cell, 12 + j], high[j]) - min(
                            max(a, b) + cells[cell, 18 + j], low[j]
                        )
                        size += max(edge, 0.0)
                    if size < closing:
                        if begin < 0:
                            begin = cell
                        stop = cell + 1
                        smallest = min(smallest, size)
                if begin >= 0:
                    for cell in range(begin, stop):
                        for j in range(6):
                            a, b = cells[cell, j], cells[cell, 6 + j]
                            least[j] = min(least[j], min(a, b) + cells[cell, 12 + j])
                            most[j] = max(most[j], max(a, b) + cells[cell, 18 + j])
                    for i in range(3):
                        spans[left, i] = spans[k, i]
                    spans[left, 3], spans[left, 4] = begin, stop
                    left += 1
                k += 1
            if left == before:
                return 0
            sizes[wall] = smallest
            for j in range(6):
                change = max(change, least[j] - high[j], low[j] - most[j])
                high[j], low[j] = max(high[j], least[j]), min(low[j], most[j])
        # each pass is left the postures that all of its walls have
        walls_with = np.zeros((n_passes, n_keys), dtype=np.int64)
        last_wall = np.full((n_passes, n_keys), -1)
        for k in range(left):
            at, key = pass_index[spans[k, 0]], spans[k, 1]
            if last_wall[at, key] != spans[k, 0]:
                last_wall[at, key] = spans[k, 0]
                walls_with[at, key] += 1
        n = 0
        kept = walls_of == 0
        for k in range(left):
            at = pass_index[spans[k, 0]]
            if walls_with[at, spans[k, 1]] == walls_of[at]:
                kept[at] = True
                for i in range(5):
                    spans[n, i] = spans[k, i]
                n += 1
        if not kept.all():
            return 0
        if change < STILL:
            break
    return n


@njit(
    "void(float64[::1],float64[::1],int64[::1],int64[::1],int64,float64[::1],float64[::1],"
    "float64[::1])",
    cache=True,
)
def _raise_prices(reach, slope, wall, face, n_walls, price, out, x):  # type: ignore[no-untyped-def]
    """Maximise reach . y - sum(z), the y of a face together at most 1, -slope . y <= z.

    Args:
        reach: Of each constraint in [rad], shape (n,).
        slope: In [rad], shape (n,).
        wall: Its segment, shape (n,).
        face: Its face, 0 to 11, shape (n,).
        n_walls: How many segments.
        price: Filled with y, shape (n,).
        out: Filled with how far each face moves out, shape (12,).
        x: Filled with the place on each segment, shape (n_walls,).
    """
    n = len(reach)
    n_rows = 12 + n_walls
    n_columns = n + n_walls + n_rows  # prices, z, slacks
    table = np.zeros((n_rows + 1, n_columns + 1))
    basis = np.empty(n_rows, dtype=np.int64)
    for j in range(n):
        table[face[j], j] = 1.0
        table[12 + wall[j], j] = -slope[j]
        table[n_rows, j] = reach[j]
    for w in range(n_walls):
        table[12 + w, n + w] = -1.0
        table[n_rows, n + w] = -1.0
    for row in range(n_rows):
        table[row, n + n_walls + row] = 1.0
        basis[row] = n + n_walls + row
        # a little more than 0, different for each, so that no step is for nothing
        table[row, n_columns] = 1.0 if row < 12 else 1e-9 * (1.0 + (row * 7 % 13) / 13.0)
    for _ in range(MOST_PIVOTS):
        enter, best = -1, ENTERS
        for j in range(n_columns):
            if table[n_rows, j] > best:
                enter, best = j, table[n_rows, j]
        if enter < 0:
            break
        leave, least = -1, np.inf
        for row in range(n_rows):
            if table[row, enter] > PIVOT:
                ratio = table[row, n_columns] / table[row, enter]
                if ratio < least:
                    leave, least = row, ratio
        if leave < 0:
            break
        table[leave] /= table[leave, enter]
        for row in range(n_rows + 1):
            if row != leave and table[row, enter] != 0.0:
                table[row] -= table[row, enter] * table[leave]
        basis[leave] = enter
    price[:] = 0.0
    for row in range(n_rows):
        if basis[row] < n:
            price[basis[row]] = max(table[row, n_columns], 0.0)
    for row in range(12):
        out[row] = max(-table[n_rows, n + n_walls + row], 0.0)
    for w in range(n_walls):
        x[w] = min(max(-table[n_rows, n + n_walls + 12 + w], 0.0), 1.0)


@njit(
    "float64(float64[:,::1],int64[:,::1],float64[::1],float64[::1],float64[::1],float64[::1],"
    "float64[::1],float64[::1],float64[::1],float64[:,:,::1])",
    cache=True,
)
def least_box(cells, spans, low, high, box_low, box_high, x, lost, missed, prices):  # type: ignore[no-untyped-def]
    """Return a bound on the box that holds a core and a point of each of some spans, in [rad].

    Args:
        cells: The table of `Cells`.
        spans: One of each wall, shape (k, 5).
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.
        box_low: Filled with the lower faces of the box found.
        box_high: Filled with the upper ones.
        x: Filled with where on each segment the box holds it, 0 to 1, shape (k,).
        lost: Filled with how much larger the box could be if a segment had no pads, in [rad].
        missed: Filled with by how much the box misses each segment without its pads, in [rad].
        prices: Filled with how hard each segment presses on each upper face of the box, and on
            each lower one, from 0 to 1, shape (k, 6, 2).
    """
    k = len(spans)
    along, pad_low, pad_high = np.empty((k, 6)), np.empty((k, 6)), np.empty((k, 6))
    reach, slope = np.empty((k, 12)), np.empty((k, 12))
    n = 0
    for w in range(k):
        first, end = spans[w, 3], spans[w, 4]
        place, length = cells[first, 24], cells[end - 1, 25] - cells[first, 24]
        for j in range(6):
            start = cells[first, j]
            step = cells[end - 1, 6 + j] - start
            below, above = np.inf, -np.inf
            # within a cell both chords are straight: they are farthest apart at its ends
            for cell in range(first, end):
                a = cells[cell, j] - start - step * ((cells[cell, 24] - place) / length)
                b = cells[cell, 6 + j] - start - step * ((cells[cell, 25] - place) / length)
                below = min(below, min(a, b) + cells[cell, 12 + j])
                above = max(above, max(a, b) + cells[cell, 18 + j])
            along[w, j], pad_low[w, j], pad_high[w, j] = step, below, above
            # upper faces 0 to 5, lower ones mirrored 6 to 11: out >= reach + slope * x
            reach[w, j], slope[w, j] = start + below - high[j], step
            reach[w, 6 + j], slope[w, 6 + j] = low[j] - start - above, -step
            n += int(reach[w, j] + max(step, 0.0) > 0.0)
            n += int(reach[w, 6 + j] + max(-step, 0.0) > 0.0)
    wall, face = np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    of_reach, of_slope, price = np.empty(n), np.empty(n), np.empty(n)
    n = 0
    for w in range(k):
        for f in range(12):
            if reach[w, f] + max(slope[w, f], 0.0) > 0.0:
                wall[n], face[n] = w, f
                of_reach[n], of_slope[n] = reach[w, f], slope[w, f]
                n += 1
    out = np.zeros(12)
    x[:] = 0.5
    if n:
        _raise_prices(of_reach, of_slope, wall, face, k, price, out, x)
    total = np.zeros(12)
    for i in range(n):
        total[face[i]] += price[i]
    prices[:] = 0.0
    bound = 0.0
    for i in range(n):
        prices[wall[i], face[i] % 6, face[i] // 6] = price[i] / max(total[face[i]], 1.0)
    out[:] = 0.0
    for w in range(k):
        lost[w], tilt = 0.0, 0.0
        for f in range(12):
            p = prices[w, f % 6, f // 6]
            bound += p * reach[w, f]
            tilt += p * slope[w, f]
            lost[w] += p * (pad_high[w, f - 6] if f >= 6 else -pad_low[w, f])
            out[f] = max(out[f], reach[w, f] + slope[w, f] * x[w])
        bound += min(tilt, 0.0)  # the least over every place on the segment
    for j in range(6):
        bound += high[j] - low[j]
        box_low[j], box_high[j] = low[j] - out[6 + j], high[j] + out[j]
    for w in range(k):
        missed[w] = 0.0
        for j in range(6):
            point = cells[spans[w, 3], j] + along[w, j] * x[w]
            missed[w] += max(point - box_high[j], 0.0) + max(box_low[j] - point, 0.0)
    return bound - ROUND_OFF


@njit("float64(float64[:,::1],int64,int64,float64[::1],float64[::1])", cache=True)
def distance(cells, first, end, low, high):  # type: ignore[no-untyped-def]
    """Return by how much a box misses the chords of a span, in [rad]; 0 if a pad is not known."""
    best = np.inf
    for cell in range(first, end):
        for j in range(6):
            if cells[cell, 18 + j] >= UNKNOWN:
                return 0.0
        best, _ = nearest_on_chord(cells[cell, :6], cells[cell, 6:12], low, high, best)
    return best
