"""Which part of a cell is within the limits of the joints, after some full turns.

A joint that turns less than once has postures between its limits that no full turn brings back:
what lies there is no part of a wall, and cells that begin or end there are made shorter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.search.box import JointBox

TOUCHING = 1e-8  # [rad] beyond a limit that still counts as within
FULL_TURN = 2.0 * np.pi


def within_limits(rows: Array, limits: Sequence[JointBox]) -> tuple[Array, Array]:
    """Return where cells begin and end to be within any of some limits, in fractions of them.

    Args:
        rows: Cells as in the table of `Cells`, shape (..., 26).
        limits: As of `BoxProof`.

    Returns:
        Both of shape (...); a cell ends before it begins where nothing of it is.
    """
    shape = rows.shape[:-1]
    low, high = np.empty(shape), np.empty(shape)
    least, most = (np.array([getattr(one, face) for one in limits]) for face in ("lower", "upper"))
    _cut(rows.reshape(-1, rows.shape[-1]), least, most, low.reshape(-1), high.reshape(-1))
    return low, high


@kernel("UniTuple(float64,2)(float64,float64,float64,float64,float64,float64)")
def _within(start, end, pad_low, pad_high, lower, upper):  # type: ignore[no-untyped-def]
    """Return where one joint is within its limits, as `within_limits` does."""
    turns = FULL_TURN * np.round(((start + end) - (lower + upper)) / (2.0 * FULL_TURN))
    least, most = lower + turns - TOUCHING, upper + turns + TOUCHING
    high, low = max(start, end) + pad_high, min(start, end) + pad_low
    # where a cell reaches the limits one turn further, nothing of it is cut off there
    above = high < least + FULL_TURN and max(start, end) + pad_low > most
    below = low > most - FULL_TURN and min(start, end) + pad_high < least
    first, last, step = 0.0, 1.0, end - start
    if (above and min(start, end) + pad_low > most) or (
        below and max(start, end) + pad_high < least
    ):
        return 2.0, -1.0
    if above:
        at = (most - pad_low - start) / step
        if step > 0.0:
            last = min(last, at)
        else:
            first = max(first, at)
    if below:
        at = (least - pad_high - start) / step
        if step > 0.0:
            first = max(first, at)
        else:
            last = min(last, at)
    return first, last


@kernel("void(float64[:,::1],float64[:,::1],float64[:,::1],float64[::1],float64[::1])", early=True)
def _cut(rows, lower, upper, low, high):  # type: ignore[no-untyped-def]
    for n in range(len(rows)):
        low[n], high[n] = 1.0, 0.0
        for k in range(len(lower)):
            begin, end = 0.0, 1.0
            for j in range(6):
                if upper[k, j] - lower[k, j] < FULL_TURN:
                    first, last = _within(
                        rows[n, j], rows[n, 6 + j], rows[n, 12 + j], rows[n, 18 + j],
                        lower[k, j], upper[k, j],
                    )  # fmt: skip
                    begin, end = max(begin, first), min(end, last)
            if begin <= end:
                low[n], high[n] = min(low[n], begin), max(high[n], end)
