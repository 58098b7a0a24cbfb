"""The smallest box that holds a point of each of some segments, by linear programming.

How far each face must move out of a core, and where on its segment each point lies, are the
variables; that every face lies beyond every point are the constraints. The dual of this starts
from prices of nothing, and a simplex method in a small table raises them. The bound does not rest
on the method: from any prices a lower bound follows, and it is computed anew from those found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from opl.geometry.frames import Array
from opl.search.walls import Segment

ROUND_OFF = 1e-9  # [rad] of the sums that make a bound


@dataclass(frozen=True)
class Relaxation:
    """The least box of some segments.

    Attributes:
        bound: No box that holds the core and a point of each is smaller, in [rad].
        low: Lower faces of the box found, shape (6,).
        high: Upper faces.
        x: Where on each segment, 0 to 1, shape (k,).
        lost: How much larger it could be if each segment had no pads, in [rad], shape (k,).
        missed: By how much the box misses each segment without its pads, in [rad], shape (k,).
        prices: How hard each segment presses on each upper face of the box, and on each lower one,
            from 0 to 1, shape (k, 6, 2).
    """

    bound: float
    low: Array
    high: Array
    x: Array
    lost: Array
    prices: Array
    missed: Array


def least_box_of(segments: list[Segment], low: Array, high: Array) -> Relaxation:
    """Return the least box that holds a core and a point of each segment.

    Args:
        segments: The segments.
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.
    """
    k = len(segments)
    start = np.array([segment.start for segment in segments]).reshape(k, 6)
    along = np.array([segment.along for segment in segments]).reshape(k, 6)
    pad_low = np.array([segment.pad_low for segment in segments]).reshape(k, 6)
    pad_high = np.array([segment.pad_high for segment in segments]).reshape(k, 6)
    # upper faces in columns 0 to 5, lower ones mirrored in 6 to 11: out >= reach + slope * x
    reach = np.concatenate([start + pad_low - high, low - start - pad_high], axis=1)
    slope = np.concatenate([along, -along], axis=1)
    wall, face = (
        np.ascontiguousarray(index) for index in np.nonzero(reach + np.maximum(slope, 0.0) > 0.0)
    )
    bound = float((high - low).sum())
    prices, out, x = np.zeros((k, 12)), np.zeros(12), np.full(k, 0.5)
    if len(wall):
        price = np.empty(len(wall))
        _raise_prices(reach[wall, face], slope[wall, face], wall, face, k, price, out, x)
        prices[wall, face] = price
        prices /= np.maximum(prices.sum(axis=0), 1.0)
        # the least over every place on each segment
        bound += float((prices * reach).sum() + np.minimum((prices * slope).sum(axis=1), 0.0).sum())
    out = np.maximum((reach + slope * x[:, None]).max(axis=0, initial=0.0), 0.0)
    lost = (prices[:, 6:] * pad_high - prices[:, :6] * pad_low).sum(axis=1)
    by_face = np.stack([prices[:, :6], prices[:, 6:]], axis=-1)
    found_low, found_high = low - out[6:], high + out[:6]
    point = start + along * x[:, None]
    away = np.maximum(point - found_high, 0.0) + np.maximum(found_low - point, 0.0)
    return Relaxation(bound - ROUND_OFF, found_low, found_high, x, lost, by_face, away.sum(axis=1))


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
