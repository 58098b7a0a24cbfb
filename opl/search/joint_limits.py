"""Limits of the joints: what a box holds is within them after one count of full turns for all."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.cells import FIRST

UNLIMITED = JointBox(np.full(6, -np.inf), np.full(6, np.inf))


def about(box: JointBox, limits: JointBox) -> JointBox:
    """Return limits as they are after the full turns that bring them nearest to a box."""
    known = np.isfinite(limits.upper)
    lower, upper = np.where(known, limits.lower, 0.0), np.where(known, limits.upper, 0.0)
    away = np.where(known, box.lower + box.upper, 0.0) - lower - upper
    turns = 2.0 * np.pi * np.round(away / (4.0 * np.pi))
    return JointBox(limits.lower + turns, limits.upper + turns)


def cut_at(box: JointBox, limits: JointBox) -> JointBox:
    """Return the part of a box that is within limits after full turns."""
    near = about(box, limits)
    return JointBox(np.maximum(box.lower, near.lower), np.minimum(box.upper, near.upper))


def beyond(cells: Array, spans: np.ndarray, box: JointBox, limits: JointBox, least: float) -> Array:
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
    lower, upper = near.lower, near.upper
    excess = np.concatenate([lower - box.lower, box.upper - upper])
    face = int(np.argmax(excess))
    if excess[face] <= least:
        return found
    joint = face % 6
    for k, (first, end) in enumerate(spans[:, FIRST:].tolist()):
        own = cells[first:end]
        if face < 6:
            found[k] = (lower - np.minimum(own[:, 0:6], own[:, 6:12]) - own[:, 12:18])[
                :, joint
            ].max()
        else:
            found[k] = (np.maximum(own[:, 0:6], own[:, 6:12]) + own[:, 18:24] - upper)[
                :, joint
            ].max()
    return np.maximum(found, 0.0)
