"""The smallest box that holds a point of each of some segments, by linear programming.

The bound does not rest on the solver: from any prices of the constraints a lower bound follows by
duality, and it is computed here anew from those that the solver returns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_array

from opl.geometry.frames import Array
from opl.search.walls import Segment

ROUND_OFF = 1e-9  # [rad] of the sums that make a bound
FARTHEST = 100.0  # [rad] from a core that any face can be


@dataclass(frozen=True)
class Relaxation:
    """The least box of some segments.

    Attributes:
        bound: No box that holds a point of each is smaller, in [rad].
        low: Lower faces of the box found, shape (6,).
        high: Upper faces.
        x: Where on each segment, 0 to 1, shape (k,).
        lost: How much larger it could be if each segment had no pads, in [rad], shape (k,).
        prices: Of each segment and joint: how hard it presses on the upper face of the box, and on
            the lower one, shape (k, 6, 2).
    """

    bound: float
    low: Array
    high: Array
    x: Array
    lost: Array
    prices: Array


def least_box_of(
    segments: list[Segment], low: Array, high: Array
) -> Relaxation | None:
    """Return the least box that holds a core and a point of each segment.

    Args:
        segments: At least one.
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.

    Returns:
        None if the solver gives up, which proves nothing.
    """
    k = len(segments)
    start = np.array([segment.start for segment in segments])
    along = np.array([segment.along for segment in segments])
    pad_low = np.array([segment.pad_low for segment in segments])
    pad_high = np.array([segment.pad_high for segment in segments])
    # variables: lower faces, upper faces, x; every upper face at or above its point of a segment,
    # every lower one at or below
    least, most = start + np.minimum(along, 0.0), start + np.maximum(along, 0.0)
    up_w, up_j = np.nonzero(most + pad_low > high)
    down_w, down_j = np.nonzero(least + pad_high < low)
    n_up, n_down = len(up_w), len(down_w)
    n_rows = n_up + n_down
    rows = np.arange(n_rows)
    face = np.concatenate([6 + up_j, down_j])
    face_sign = np.concatenate([-np.ones(n_up), np.ones(n_down)])
    slope = np.concatenate([along[up_w, up_j], -along[down_w, down_j]])
    limit = np.concatenate(
        [-(start + pad_low)[up_w, up_j], (start + pad_high)[down_w, down_j]]
    )
    matrix = csr_array(
        (
            np.concatenate([face_sign, slope]),
            (np.concatenate([rows, rows]), np.concatenate([face, 12 + up_w, 12 + down_w])),
        ),
        shape=(n_rows, 12 + k),
    )
    lower = np.concatenate([high - FARTHEST, high, np.zeros(k)])
    upper = np.concatenate([low, low + FARTHEST, np.ones(k)])
    cost = np.concatenate([-np.ones(6), np.ones(6), np.zeros(k)])
    if n_rows:
        found = linprog(
            cost, matrix, limit, bounds=np.stack([lower, upper], axis=1), method="highs-ds"
        )
        if found.status != 0:
            return None
        price, solution = np.maximum(-found.ineqlin.marginals, 0.0), found.x
    else:
        price, solution = np.zeros(0), np.where(cost > 0.0, lower, upper)
        solution[12:] = 0.5
    reduced = cost + matrix.T @ price
    bound = float(np.minimum(reduced * lower, reduced * upper).sum() - price @ limit)
    prices = np.zeros((k, 6, 2))
    prices[up_w, up_j, 0] = price[:n_up]
    prices[down_w, down_j, 1] = price[n_up:]
    lost = (prices[..., 1] * pad_high - prices[..., 0] * pad_low).sum(axis=1)
    return Relaxation(
        bound - ROUND_OFF, solution[:6], solution[6:12], solution[12:], lost, prices
    )
