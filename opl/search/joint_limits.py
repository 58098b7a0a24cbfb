"""Limits of the joints: what a box holds is within them after one count of full turns for all.

They are given for each flip of the wrist that the robot may make it with: one of them is kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.cells import END, FIRST, SOURCE

TOUCHING = 1e-8  # [rad] of a limit
UNLIMITED = (JointBox(np.full(6, -np.inf), np.full(6, np.inf)),)


def about(box: JointBox, limits: Sequence[JointBox]) -> JointBox:
    """Return the limits that a box fits into best, after the full turns with which it does."""
    turned = [_turned(box, one) for one in limits]
    return min(turned, key=lambda near: float(_excess(box, near).max()))


def cut_at(box: JointBox, limits: Sequence[JointBox]) -> JointBox:
    """Return the part of a box that is within limits."""
    near = about(box, limits)
    return JointBox(np.maximum(box.lower, near.lower), np.minimum(box.upper, near.upper))


def torn(
    cells: Array,
    shifts: Array,
    spans: np.ndarray,
    box: JointBox,
    limits: Sequence[JointBox],
    least: float,
) -> Array:
    """Return how far spans turn that reach a limit which a box is beyond most, shape (n,).

    All others 0: a wall is on one side of a limit, and its spans may be split into both. All 0
    where the box is within limits but for ``least``; in [rad].

    Args:
        cells: The table of `Cells`.
        shifts: What the cells of each source are shifted by in [rad], shape (m, 6).
        spans: The spans, shape (n, 5).
        box: The box.
        limits: As of `BoxProof`.
        least: In [rad].
    """
    found = np.zeros(len(spans))
    turned = [_turned(box, one) for one in limits]
    excesses = [_excess(box, near) for near in turned]
    if any(excess.max() <= least for excess in excesses):
        return found
    for near, excess in zip(turned, excesses, strict=True):
        face, joint = divmod(int(np.argmax(excess)), 6)
        limit = float((near.lower, near.upper)[face][joint])
        _turns(cells, shifts, np.ascontiguousarray(spans), joint, limit, found)
    return found


@kernel("void(float64[:,::1],float64[:,::1],int64[:,::1],int64,float64,float64[::1])")
def _turns(cells, shifts, spans, joint, limit, found):  # type: ignore[no-untyped-def]
    """Raise ``found`` to how far a joint turns over spans that reach a limit of it."""
    for k in range(len(spans)):
        low, high = np.inf, -np.inf
        for cell in range(spans[k, FIRST], spans[k, END]):
            start, stop = cells[cell, joint], cells[cell, 6 + joint]
            low = min(low, min(start, stop) + cells[cell, 12 + joint])
            high = max(high, max(start, stop) + cells[cell, 18 + joint])
        low, high = low + shifts[spans[k, SOURCE], joint], high + shifts[spans[k, SOURCE], joint]
        if low <= limit + TOUCHING and high >= limit - TOUCHING:
            found[k] = max(found[k], high - low)


def _turned(box: JointBox, limits: JointBox) -> JointBox:
    """Return limits after the full turns that bring them nearest to a box."""
    known = np.isfinite(limits.upper)
    lower, upper = np.where(known, limits.lower, 0.0), np.where(known, limits.upper, 0.0)
    away = np.where(known, box.lower + box.upper, 0.0) - lower - upper
    turns = 2.0 * np.pi * np.round(away / (4.0 * np.pi))
    return JointBox(limits.lower + turns, limits.upper + turns)


def _excess(box: JointBox, limits: JointBox) -> Array:
    """Return by how much lower and upper faces are beyond limits in [rad], shape (2, 6)."""
    return np.stack([limits.lower - box.lower, box.upper - limits.upper])
