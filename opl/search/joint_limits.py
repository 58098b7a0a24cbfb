"""Limits of the joints: what a box holds is within them after one count of full turns for all.

They are given for each flip of the wrist that the robot may make it with: one of them is kept.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox

FULL_TURN = 2.0 * np.pi
TOUCHING = 1e-8  # [rad] beyond a limit that still counts as within
UNLIMITED = (JointBox(np.full(6, -np.inf), np.full(6, np.inf)),)


def about(
    box: JointBox, limits: Sequence[JointBox], core: tuple[Array, Array] | None = None
) -> JointBox:
    """Return the limits that a box fits into best, after the full turns with which it does.

    Those that hold a core, if one is given and some do: lower faces are not above the first, upper
    ones not below the second, shape (6,) each.
    """
    turned = [_turned(box, one, core) for one in limits]
    if core is not None:
        holding = [near for near in turned if _excess(JointBox(*core), near).max() <= TOUCHING]
        turned = holding or turned
    return min(turned, key=lambda near: float(_excess(box, near).max()))


def cut_at(
    box: JointBox, limits: Sequence[JointBox], core: tuple[Array, Array] | None = None
) -> JointBox:
    """Return the part of a box that is within limits, as of `about`; at them where none is."""
    if any((one.lower <= box.lower).all() and (box.upper <= one.upper).all() for one in limits):
        return box  # mostly, and soon told
    near = about(box, limits, core)
    return JointBox(*(np.clip(face, near.lower, near.upper) for face in (box.lower, box.upper)))


def _turned(box: JointBox, limits: JointBox, core: tuple[Array, Array] | None = None) -> JointBox:
    """Return limits after the full turns that bring them nearest to a box, but hold a core."""
    known = np.isfinite(limits.upper)
    lower, upper = np.where(known, limits.lower, 0.0), np.where(known, limits.upper, 0.0)
    away = np.where(known, box.lower + box.upper, 0.0) - lower - upper
    turns = np.round(away / (2.0 * FULL_TURN))
    if core is not None:
        fewest = np.ceil((core[1] - TOUCHING - upper) / FULL_TURN)
        most = np.floor((core[0] + TOUCHING - lower) / FULL_TURN)
        turns = np.where(known & (fewest <= most), np.clip(turns, fewest, most), turns)
    turns = FULL_TURN * turns
    return JointBox(limits.lower + turns, limits.upper + turns)


def _excess(box: JointBox, limits: JointBox) -> Array:
    """Return by how much lower and upper faces are beyond limits in [rad], shape (2, 6)."""
    return np.stack([limits.lower - box.lower, box.upper - limits.upper])
