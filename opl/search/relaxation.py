"""The least box that holds a point of each of some spans, by linear programming.

A span is relaxed to a segment, start + along * x + [pad_low, pad_high] for some 0 <= x <= 1; its
error falls with the square of the span. How far each face of the box must move out of the core, and
where on its segment each point lies, are the variables; that every face lies beyond every point are
the constraints. The dual of this starts from prices of nothing, and a simplex method in a small
table raises them. The bound does not rest on the method: from any prices a lower bound follows, and
it is computed anew from those found.
"""

from __future__ import annotations

import numpy as np
from numba import njit

ROUND_OFF = 1e-9  # [rad] of the sums that make a bound
MOST_PIVOTS = 2000
ENTERS = 1e-10  # [rad] gain below which a price is not raised
PIVOT = 1e-9  # smallest that is divided by


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
