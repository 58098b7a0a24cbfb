"""The least box that meets the convex hull of each of some walls, by linear programming.

Whatever price a wall is paid for pressing on each face of the box, all prices of a face together at
most 1: no box is smaller than the core and what every wall presses out at the least, at the cell of
it that presses least. The best prices make the least box over convex hulls. They are found by a
linear program over few points of each wall; the point that presses least at its prices joins them,
until none is left that presses less. The bound does not rest on how the prices were found: it is
computed anew from them, over all cells.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

ROUND_OFF = 1e-9  # [rad] of the sums that make a bound
MOST_PIVOTS = 400  # for one set of points
MOST_ROUNDS = 60  # of adding points
POINTS = 96  # added in all, and
POINTS_OF_A_WALL = 2  # for each more
ENTERS = 1e-10  # [rad] gain below which a price is not raised
PIVOT = 1e-9  # smallest that is divided by
ENOUGH = 0.1  # of what is left to be closed: how near to the best prices are good enough
CLOSE = 1e-5  # [rad] what points still left out may be worth together


@kernel("float64(float64[:,::1],int64,int64,int64,float64[::1],float64[::1])")
def pressed(cells, cell, end, face, low, high):  # type: ignore[no-untyped-def]
    """Return how far one end of a cell, 0 or 1, presses a face of a core outwards at the least.

    Faces 0 to 5 are the upper ones, 6 to 11 the lower ones.
    """
    if face < 6:
        return cells[cell, 6 * end + face] + cells[cell, 12 + face] - high[face]
    j = face - 6
    return low[j] - cells[cell, 6 * end + j] - cells[cell, 18 + j]


@kernel("int64(float64[:,::1],int64[::1],int64,int64,boolean)")
def _pivot(table, basis, n_rows, n_columns, dual):  # type: ignore[no-untyped-def]
    """Bring a table of the simplex method to its optimum; return how many steps that took.

    Its first row is the objective, what each variable gains, its first column the right-hand side.
    The dual method begins where no variable gains but some rows are not kept, the primal one the
    other way about.
    """
    for step in range(MOST_PIVOTS):
        enter, leave = -1, -1
        if dual:
            worst = -1e-12
            for row in range(n_rows):
                if table[row + 1, 0] < worst:
                    leave, worst = row + 1, table[row + 1, 0]
            if leave < 0:
                return step
            least = np.inf
            for j in range(1, n_columns):
                if table[leave, j] < -PIVOT:
                    ratio = table[0, j] / table[leave, j]
                    if ratio < least:
                        enter, least = j, ratio
            if enter < 0:
                return step
        else:
            best = ENTERS
            for j in range(1, n_columns):
                if table[0, j] > best:
                    enter, best = j, table[0, j]
            if enter < 0:
                return step
            least = np.inf
            for row in range(n_rows):
                if table[row + 1, enter] > PIVOT:
                    ratio = table[row + 1, 0] / table[row + 1, enter]
                    if ratio < least:
                        leave, least = row + 1, ratio
            if leave < 0:
                return step
        divisor = table[leave, enter]
        for j in range(n_columns):
            table[leave, j] /= divisor
        for row in range(n_rows + 1):
            factor = table[row, enter]
            if row != leave and factor != 0.0:
                for j in range(n_columns):
                    table[row, j] -= factor * table[leave, j]
        basis[leave - 1] = enter
    return MOST_PIVOTS


@kernel(
    "UniTuple(float64,2)(float64[:,::1],float64[:,::1],int64[:,::1],int64,float64[::1],float64[::1],"
    "float64,float64[:,::1],float64[:,::1],float64[::1],float64[:,::1])",
    early=True,
)
def least_box(  # type: ignore[no-untyped-def]
    cells, shifts, spans, n_walls, low, high, closing, box, place, lost, prices
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
        box: Faces, lower ones first, of a box known before, or the core; filled with those of the
            box found, shape (2, 6).
        place: Filled with where the box meets the hull of each wall: along it, and at which source,
            both the mean of the points that it meets, shape (n_walls, 2).
        lost: Filled with how much more each wall would press had its cells no pads, in [rad].
        prices: Filled with how hard each wall presses on each upper face of the box, and on each
            lower one, from 0 to 1, shape (n_walls, 12).
    """
    core = 0.0
    place[:] = 0.0
    for j in range(6):
        core += high[j] - low[j]
    begin, end = np.zeros(n_walls, dtype=np.int64), np.zeros(n_walls, dtype=np.int64)
    n_cells = 0
    below, above = np.empty((len(spans), 6)), np.empty((len(spans), 6))  # the core, as spans see it
    for k in range(len(spans) - 1, -1, -1):
        for j in range(6):
            below[k, j] = low[j] - shifts[spans[k, 2], j]
            above[k, j] = high[j] - shifts[spans[k, 2], j]
        n_cells += spans[k, 4] - spans[k, 3]
        begin[spans[k, 0]] = k
        end[spans[k, 0]] = max(end[spans[k, 0]], k + 1)
    beyond = np.empty(12)  # how far the faces of a box known before are beyond the core
    for j in range(6):
        beyond[j] = max(box[1, j], high[j]) - high[j]
        beyond[6 + j] = low[j] - min(box[0, j], low[j])
    # the point of each wall that is nearest to that box, and the faces it can press on at all
    first, most = np.zeros((n_walls, 12)), np.full((n_walls, 12), -np.inf)
    for w in range(n_walls):
        nearest = np.inf
        for k in range(begin[w], end[w]):
            for cell in range(spans[k, 3], spans[k, 4]):
                if cells[cell, 12] > 0.0:
                    continue  # forbidden
                for side in range(2):
                    away = 0.0
                    for f in range(12):
                        out = pressed(cells, cell, side, f, below[k], above[k])
                        most[w, f] = max(most[w, f], out)
                        away += max(out - beyond[f], 0.0)
                    if away < nearest:
                        nearest, place[w, 0] = away, cells[cell, 24 + side]
                        for f in range(12):
                            first[w, f] = pressed(cells, cell, side, f, below[k], above[k])
                        place[w, 1] = spans[k, 2]
    n = 0
    wall_of, face_of = (
        np.empty(12 * n_walls, dtype=np.int64),
        np.empty(12 * n_walls, dtype=np.int64),
    )
    for w in range(n_walls):
        for f in range(12):
            if most[w, f] > 0.0:
                wall_of[n], face_of[n] = w, f
                n += 1
    # variables: a price for each of these, how much less than its first point a wall presses,
    # and slacks; rows: the objective, the faces, and points that press less than the first
    most_points = POINTS + POINTS_OF_A_WALL * n_walls
    faces, points = 1 + n + n_walls, 13 + n + n_walls  # first slack of either
    table = np.zeros((13 + most_points, points + most_points))
    basis = np.empty(12 + most_points, dtype=np.int64)
    for i in range(n):
        table[0, 1 + i] = first[wall_of[i], face_of[i]]
        table[1 + face_of[i], 1 + i] = 1.0
    for w in range(n_walls):
        table[0, 1 + n + w] = -1.0
    for f in range(12):
        table[1 + f, faces + f] = 1.0
        table[1 + f, 0] = 1.0 + 1e-9 * f  # no step is for nothing
        basis[f] = faces + f
    point_wall = np.empty(most_points, dtype=np.int64)
    point_place = np.empty((most_points, 2))
    now = np.empty((n_walls, 12))
    press, press_cell = np.zeros(n_walls), np.zeros(n_walls, dtype=np.int64)
    n_points, bound = 0, -np.inf
    prices[:] = 0.0
    lost[:] = 0.0
    work = float(_pivot(table, basis, 12, points, False) * 13 * points)
    for _ in range(MOST_ROUNDS):
        now[:] = 0.0
        short = np.zeros(n_walls)
        for row in range(12 + n_points):
            value, i = max(table[row + 1, 0], 0.0), basis[row] - 1
            if i < n:
                now[wall_of[i], face_of[i]] = value
            elif i < n + n_walls:
                short[i - n] = value
        for f in range(12):
            total = 0.0
            for w in range(n_walls):
                total += now[w, f]
            if total > 1.0:
                for w in range(n_walls):
                    now[w, f] /= total
        least, hoped, added = core, core, 0
        for w in range(n_walls):
            known, priced = -short[w], False
            for f in range(12):
                known += now[w, f] * first[w, f]
                priced = priced or now[w, f] > 0.0
            hoped += known
            press[w] = 0.0
            if not priced:
                continue
            best, at, at_side, at_span = np.inf, -1, 0, -1
            for k in range(begin[w], end[w]):
                for cell in range(spans[k, 3], spans[k, 4]):
                    for side in range(2):
                        out = 0.0
                        for f in range(12):
                            if now[w, f] > 0.0:
                                out += now[w, f] * pressed(cells, cell, side, f, below[k], above[k])
                        if out < best:
                            best, at, at_side, at_span = out, cell, side, k
            press[w], press_cell[w] = best, at
            least += best
            if best < known - CLOSE / n_walls and n_points < most_points:
                # this point presses less than those known: z >= y (first - this)
                row = 13 + n_points
                for i in range(n):
                    if wall_of[i] == w:
                        f = face_of[i]
                        out = pressed(cells, at, at_side, f, below[at_span], above[at_span])
                        table[row, 1 + i] = first[w, f] - out
                table[row, 1 + n + w] = -1.0
                table[row, points + n_points] = 1.0
                table[row, 0] = 1e-12 * (1.0 + n_points)
                basis[12 + n_points] = points + n_points
                point_wall[n_points], point_place[n_points, 0] = w, cells[at, 24 + at_side]
                point_place[n_points, 1] = spans[at_span, 2]
                for other in range(12 + n_points):
                    factor = table[row, basis[other]]
                    if factor != 0.0:
                        for j in range(points + n_points):
                            table[row, j] -= factor * table[other + 1, j]
                n_points += 1
                added += 1
        if least > bound:
            bound = least
            prices[:] = now
            for w in range(n_walls):
                lost[w] = 0.0
                for f in range(12):
                    if now[w, f] > 0.0:
                        cell = press_cell[w]
                        pad = -cells[cell, 12 + f] if f < 6 else cells[cell, 12 + f]
                        lost[w] += now[w, f] * pad
        # closed, or as near to the best as matters to what is closed
        if added == 0 or bound >= closing or hoped - bound < ENOUGH * (closing - hoped):
            break
        n_rows, n_columns = 12 + n_points, points + n_points
        steps = _pivot(table, basis, n_rows, n_columns, True)
        steps += _pivot(table, basis, n_rows, n_columns, False)
        work += float((steps + added) * n_rows * n_columns + 24 * n_cells)
    for j in range(6):
        box[1, j] = high[j] + max(-table[0, faces + j], 0.0)
        box[0, j] = low[j] - max(-table[0, faces + 6 + j], 0.0)
    left = np.ones(n_walls)
    along = np.zeros((n_walls, 2))
    for i in range(n_points):
        share = max(-table[0, points + i], 0.0)
        share = min(share, left[point_wall[i]])
        left[point_wall[i]] -= share
        along[point_wall[i]] += share * point_place[i]
    for w in range(n_walls):
        place[w] = along[w] + left[w] * place[w]
    return bound - ROUND_OFF, work + 100.0 * n_cells
