"""How far a box misses the convex hull of a wall.

Whatever price each face of a box is given, from 0 to 1: it has to grow by what the wall presses out
at these prices, at the end of a cell that presses least. The best prices tell how far it misses the
hull. They are found by a linear program over few points of the hull; the point that presses least
at its prices joins them, until none presses much less.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.search.simplex import pivoted, take_in

MOST_POINTS = 24  # of the hull of a wall that tell how far a box misses it
SHARE = 0.7  # of what a box may miss a hull by: prices that tell so much are good enough
CLOSE = 1e-6  # [rad] that a box which meets a hull may miss it by
NUMBERS_OF_A_LOOK = 2000.0  # what a look at a hull costs beside its cells


@kernel(
    "void(float64[:,::1],float64[:,::1],int64,int64,int64,float64[::1],float64[::1],float64[::1])"
)
def _press(cells, shifts, source, cell, side, low, high, point):  # type: ignore[no-untyped-def]
    """Fill in how far one end of a cell, 0 or 1, presses each face outwards at the least."""
    for j in range(6):
        q = cells[cell, 6 * side + j] + shifts[source, j]
        point[j] = q + cells[cell, 12 + j] - high[j]
        point[6 + j] = low[j] - q - cells[cell, 18 + j]


@kernel(
    "float64(float64[:,::1],float64[:,::1],int64[:,::1],float64[::1],float64[::1],float64[::1],"
    "float64[::1])",
    makes_arrays=True,
)
def nearest_end(cells, shifts, spans, low, high, point, place):  # type: ignore[no-untyped-def]
    """Find the end of a cell of a wall that is nearest to a box; return the numbers worked on.

    Args:
        cells: The table of `Cells`.
        shifts: What the cells of each source are shifted by in [rad], shape (m, 6).
        spans: Those of the wall, shape (n, 5).
        low: The lower faces of the box in [rad], shape (6,).
        high: The upper ones.
        point: Filled with how far it presses each face outwards, the upper ones first, shape (12,);
            as it is if all is forbidden.
        place: Filled with where it is: along the wall, and at which source, shape (2,).
    """
    nearest, n_cells, at, at_side, at_source = np.inf, 0, -1, 0, 0
    below, above = np.empty(6), np.empty(6)  # the box, as a span sees it
    for k in range(len(spans)):
        n_cells += spans[k, 4] - spans[k, 3]
        for j in range(6):
            below[j], above[j] = low[j] - shifts[spans[k, 2], j], high[j] - shifts[spans[k, 2], j]
        for cell in range(spans[k, 3], spans[k, 4]):
            if cells[cell, 12] > 0.0:
                continue  # forbidden
            for side in range(2):
                away = 0.0
                for j in range(6):
                    q = cells[cell, 6 * side + j]
                    away += max(q + cells[cell, 12 + j] - above[j], 0.0)
                    away += max(below[j] - q - cells[cell, 18 + j], 0.0)
                if away < nearest:
                    nearest, at, at_side, at_source = away, cell, side, spans[k, 2]
    if at >= 0:
        _press(cells, shifts, at_source, at, at_side, low, high, point)
        place[0], place[1] = cells[at, 24 + at_side], at_source
    return 24.0 * n_cells


@kernel(
    "Tuple((float64,int64,int64,int64,float64))(float64[:,::1],float64[:,::1],int64[:,::1],"
    "float64[::1],float64[::1],float64[::1])",
    makes_arrays=True,
)
def least_pressed(cells, shifts, spans, prices, low, high):  # type: ignore[no-untyped-def]
    """Return what a wall presses out at the least at some prices of faces, in [rad].

    And at which cell, at which end of it and of which source, and the numbers worked on. Prices are
    of the upper faces first, shape (12,); what else is given is as of `nearest_end`.
    """
    least, at, at_side, at_source, n_cells = np.inf, -1, 0, 0, 0
    faces, n_faces = np.empty(12, dtype=np.int64), 0
    for f in range(12):
        if prices[f] > 0.0:
            faces[n_faces] = f
            n_faces += 1
    for k in range(len(spans)):
        source, of_box = spans[k, 2], 0.0
        for f in faces[:n_faces]:
            if f < 6:
                of_box += prices[f] * (shifts[source, f] - high[f])
            else:
                of_box += prices[f] * (low[f - 6] - shifts[source, f - 6])
        n_cells += spans[k, 4] - spans[k, 3]
        for cell in range(spans[k, 3], spans[k, 4]):
            for side in range(2):
                out = of_box
                for f in faces[:n_faces]:
                    if f < 6:
                        out += prices[f] * (cells[cell, 6 * side + f] + cells[cell, 12 + f])
                    else:
                        out -= prices[f] * (cells[cell, 6 * side + f - 6] + cells[cell, 12 + f])
                if out < least:
                    least, at, at_side, at_source = out, cell, side, source
    return least, at, at_side, at_source, 2.0 * n_cells * n_faces


@kernel(
    "UniTuple(float64,2)(float64[:,::1],float64[:,::1],int64[:,::1],float64[::1],float64[::1],"
    "float64[::1],float64[::1],float64[::1])",
    makes_arrays=True,
)
def missed(cells, shifts, spans, low, high, prices, point, place):  # type: ignore[no-untyped-def]
    """Return by how much a box has to grow at the least to meet the hull of a wall, in [rad].

    And how many numbers were worked on, about.

    Args:
        cells: The table of `Cells`.
        shifts: What the cells of each source are shifted by in [rad], shape (m, 6).
        spans: Those of the wall, shape (n, 5).
        low: The lower faces of the box in [rad], shape (6,).
        high: The upper ones.
        prices: Filled with those of faces at which the wall presses out so much, from 0 to 1, the
            upper faces first, shape (12,).
        point: How far some point of the hull presses each face outwards; filled with that of the
            nearest one, shape (12,).
        place: Where that is, the mean of the points that it lies between, shape (2,).
    """
    points, places = np.empty((MOST_POINTS, 12)), np.empty((MOST_POINTS, 2))
    points[0], places[0] = point, place
    # variables: the prices, and how much less than the first point the hull presses; rows: how far
    # prices are below 1, from name 13 on, and how much less than that each other point presses
    table, factors = np.zeros((13 + MOST_POINTS, 14)), np.ones(13)
    basic, others = np.empty(12 + MOST_POINTS, dtype=np.int64), np.arange(13)
    for f in range(12):  # the best prices for one point
        out = point[f]
        others[f], basic[f] = (13 + f, f) if out > 0.0 else (f, 13 + f)
        table[0, 0] += max(out, 0.0)
        table[0, 1 + f], table[1 + f, 0], table[1 + f, 1 + f] = -abs(out), 1.0, -1.0
    table[0, 13] = -1.0
    prices[:] = 0.0
    most, n_points, now, work = 0.0, 1, np.empty(12), NUMBERS_OF_A_LOOK
    while True:
        now[:] = 0.0
        for i in range(11 + n_points):
            if basic[i] < 12:
                now[basic[i]] = min(max(table[1 + i, 0], 0.0), 1.0)
        out, cell, side, source, numbers = least_pressed(cells, shifts, spans, now, low, high)
        work += numbers
        if out > most:
            most = out
            prices[:] = now
        # met, missed by so much, or as near to that as matters
        if table[0, 0] <= CLOSE or out >= SHARE * table[0, 0] or n_points == MOST_POINTS:
            break
        _press(cells, shifts, source, cell, side, low, high, points[n_points])
        places[n_points, 0], places[n_points, 1] = cells[cell, 24 + side], source
        factors[:12] = points[n_points] - points[0]
        n_rows = take_in(table, basic, others, 11 + n_points, factors, 0.0, 24 + n_points)
        n_points += 1
        steps = pivoted(table, basic, others, n_rows, True)
        steps += pivoted(table, basic, others, n_rows, False)
        work += 14.0 * steps * n_rows
    left = 1.0
    point[:], place[:] = 0.0, 0.0
    for j in range(13):
        if others[j] > 24:
            share = min(max(-table[0, 1 + j], 0.0), left)
            left -= share
            point += share * points[others[j] - 24]
            place += share * places[others[j] - 24]
    point += left * points[0]
    place += left * places[0]
    return most, work


@kernel(
    "UniTuple(float64,3)(float64[:,::1],float64[:,::1],int64[:,::1],float64[::1],float64[::1])",
    early=True,
    makes_arrays=True,
)
def nearest_point(cells, shifts, spans, low, high):  # type: ignore[no-untyped-def]
    """Return how far the hull of a wall is from a box in [rad], and where it is nearest.

    Along the wall, and at which source: means over the points of the hull that it lies between.
    What is given is as of `missed`; without spans it is infinitely far.
    """
    if len(spans) == 0:
        return np.inf, 0.0, 0.0
    point, place = np.zeros(12), np.zeros(2)
    nearest_end(cells, shifts, spans, low, high, point, place)
    away, _ = missed(cells, shifts, spans, low, high, np.empty(12), point, place)
    return away, place[0], place[1]
