"""Limits of the joints: what a box holds is within them after one count of full turns for all.

They are given for each flip of the wrist that the robot may make it with: one of them is kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.cells import FIRST

UNLIMITED = (JointBox(np.full(6, -np.inf), np.full(6, np.inf)),)


def about(box: JointBox, limits: Sequence[JointBox]) -> JointBox:
    """Return the limits that a box fits into best, after the full turns with which it does."""
    turned = [_turned(box, one) for one in limits]
    return min(turned, key=lambda near: float(_excess(box, near).max()))


def cut_at(box: JointBox, limits: Sequence[JointBox]) -> JointBox:
    """Return the part of a box that is within limits."""
    near = about(box, limits)
    return JointBox(np.maximum(box.lower, near.lower), np.minimum(box.upper, near.upper))


def beyond(
    cells: Array, spans: np.ndarray, box: JointBox, limits: Sequence[JointBox], least: float
) -> Array:
    """Return how far spans lead beyond the limits where a box is beyond them most, shape (n,).

    All 0 where it is beyond them by no more than ``least``; in [rad].

    Args:
        cells: The table of `Cells`.
        spans: The spans, shape (n, 5).
        box: The box.
        limits: As of `BoxProof`.
        least: In [rad].
    """
    found = np.zeros(len(spans))
    near = about(box, limits)
    excess = _excess(box, near)
    if excess.max() <= least:
        return found
    face, joint = divmod(int(np.argmax(excess)), 6)
    for k, (first, end) in enumerate(spans[:, FIRST:].tolist()):
        own = cells[first:end]
        start, stop = own[:, joint], own[:, 6 + joint]
        if face == 0:
            away = near.lower[joint] - np.minimum(start, stop) - own[:, 12 + joint]
        else:
            away = np.maximum(start, stop) + own[:, 18 + joint] - near.upper[joint]
        found[k] = max(float(away.max()), 0.0)
    return found


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
