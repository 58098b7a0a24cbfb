"""Which part of a cell is within the limits of the joints, after some full turns.

A joint that turns less than once has postures between its limits that no full turn brings back:
what lies there is no part of a wall, and cells that begin or end there are made shorter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox

TOUCHING = 1e-8  # [rad] beyond a limit that still counts as within
FULL_TURN = 2.0 * np.pi


def within_limits(rows: Array, limits: Sequence[JointBox]) -> tuple[Array, Array]:
    """Return where cells begin and end to be within any of some limits, in fractions of them.

    Args:
        rows: Cells as in the table of `Cells`, shape (..., 24 or more).
        limits: As of `BoxProof`.

    Returns:
        Both of shape (...); a cell ends before it begins where nothing of it is.
    """
    low, high = np.ones(rows.shape[:-1]), np.zeros(rows.shape[:-1])
    for one in limits:
        begin, end = np.zeros(low.shape), np.ones(low.shape)
        for joint in np.flatnonzero(one.upper - one.lower < FULL_TURN).tolist():
            first, last = _within(rows, joint, one.lower[joint], one.upper[joint])
            begin, end = np.maximum(begin, first), np.minimum(end, last)
        some = begin <= end
        low = np.where(some, np.minimum(low, begin), low)
        high = np.where(some, np.maximum(high, end), high)
    return low, high


def _within(rows: Array, joint: int, lower: float, upper: float) -> tuple[Array, Array]:
    """Return where one joint is within its limits, as `within_limits` does."""
    start, end = rows[..., joint], rows[..., 6 + joint]
    pad_low, pad_high = rows[..., 12 + joint], rows[..., 18 + joint]
    middle, step = (start + end) / 2.0, end - start
    turns = FULL_TURN * np.round((middle - (lower + upper) / 2.0) / FULL_TURN)
    least, most = lower + turns - TOUCHING, upper + turns + TOUCHING
    # where a cell reaches the limits one turn further, nothing of it is cut off there
    above = np.maximum(start, end) + pad_high >= least + FULL_TURN
    below = np.minimum(start, end) + pad_low <= most - FULL_TURN
    most, least = np.where(above, np.inf, most), np.where(below, -np.inf, least)
    with np.errstate(divide="ignore", invalid="ignore"):
        to_most, to_least = (most - pad_low - start) / step, (least - pad_high - start) / step
    still = np.abs(step) < TOUCHING
    inside = (start + pad_low <= most) & (start + pad_high >= least)
    begin = np.where(step > 0.0, to_least, to_most)
    last = np.where(step > 0.0, to_most, to_least)
    begin = np.where(still, np.where(inside, 0.0, 2.0), begin)
    last = np.where(still, np.where(inside, 1.0, -1.0), last)
    return np.maximum(begin, 0.0), np.minimum(last, 1.0)
