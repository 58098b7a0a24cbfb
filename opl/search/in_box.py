"""Where columns of postures lie in a box of joint space."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.outside import outside

JUMP = 0.5  # [rad] between neighbouring contact positions; more is no motion
BEND = 2.0  # times the sagitta that second differences tell: how far postures stand off a chord


def sampled(
    t: Array, q: Array, free: np.ndarray, box: JointBox, count: int, whole: bool = False
) -> tuple[Array, Array]:
    """Return contact positions where the chords between postures lie in a box.

    Args:
        t: Contact positions, increasing, shape (n, m).
        q: The postures in [rad], shape (n, m, 6).
        free: Which may be used: a chord with neither end free is left out, shape (n, m).
        box: The box; around the posture nearest to it where a column does not meet it.
        count: How many for each column.
        whole: Whether whole chords are sampled, and those beside them, not what is in the box.

    Returns:
        They, shape (n, count), and how far they are apart, shape (n,).
    """
    enter, leave = clipped(q, box)
    leave = np.where(free[:, :-1] | free[:, 1:], leave, -1.0)
    nearest = np.argmin(np.where(free, missing(q, box), np.inf), axis=1)
    found, spacing = np.empty((len(q), count)), np.empty(len(q))
    share = np.linspace(0.0, 1.0, count)
    for column, (start, end) in enumerate(zip(enter, leave, strict=True)):
        own, hit = t[column], np.flatnonzero(end >= start)
        if len(hit):
            if whole:
                hit = np.unique(np.clip(hit[:, None] + np.array([-1, 0, 1]), 0, len(own) - 2))
                start, end = np.zeros_like(start), np.ones_like(end)
            step = own[hit + 1] - own[hit]
            first, last = own[hit] + start[hit] * step, own[hit] + end[hit] * step
        else:  # the curve passes the box by a hair
            first = own[[max(nearest[column] - 1, 0)]]
            last = own[[min(nearest[column] + 1, len(own) - 1)]]
        length = np.concatenate([[0.0], np.cumsum(last - first)])
        along = share * length[-1]
        at = np.clip(np.searchsorted(length, along, side="right") - 1, 0, len(first) - 1)
        found[column] = first[at] + np.minimum(along - length[at], (last - first)[at])
        spacing[column] = length[-1] / (count - 1)
    return found, spacing


def missing(q: Array, box: JointBox) -> Array:
    """Return by how much a box must grow to hold postures, infinite for none, shape (...)."""
    away = np.maximum(q - box.upper, 0.0) + np.maximum(box.lower - q, 0.0)
    return np.asarray(np.nan_to_num(away.sum(axis=-1), nan=np.inf))


def missing_chords(q: Array, free: np.ndarray, box: JointBox) -> Array:
    """Return by how much a box must grow to hold a point of each column, chords included.

    Args:
        q: Postures in [rad], shape (n, m, 6).
        free: Which may be used, shape (n, m).
        box: The box.
    """
    return nearest_points(q, free, box)[0]


def nearest_points(q: Array, free: np.ndarray, box: JointBox) -> tuple[Array, Array]:
    """Return what `missing_chords` does, and the fractional row of the points, -1 for none."""
    missing, row = np.empty(len(q)), np.empty(len(q))
    by_joint = np.ascontiguousarray(np.moveaxis(q, 1, 2))
    outside(by_joint, np.ascontiguousarray(free), box.lower, box.upper, JUMP, missing, row)
    return missing, row


def nearest(q: Array, free: np.ndarray, box: JointBox) -> np.ndarray:
    """Return which free postures are in a box, or the nearest of a column, shape (n, m)."""
    away = np.where(free, missing(q, box), np.inf)
    least = away.min(axis=1, keepdims=True)
    return np.asarray((away <= least + 1e-12) & np.isfinite(away))


def clipped(q: Array, box: JointBox) -> tuple[Array, Array]:
    """Return where the chords between neighbouring rows enter and leave a box, 0 to 1.

    Shape (n, m - 1) each; one that does not meet the box leaves before it enters.
    """
    start, along = q[:, :-1], np.diff(q, axis=1)
    bend = np.nan_to_num(np.abs(np.diff(q, n=2, axis=1)))
    bend = np.where(bend < JUMP, bend, 0.0)
    nothing = np.zeros_like(bend[:, :1])
    bend = np.maximum(
        np.concatenate([nothing, bend], axis=1), np.concatenate([bend, nothing], axis=1)
    )
    low, high = box.lower - BEND * bend / 8.0, box.upper + BEND * bend / 8.0
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - start) / along, (high - start) / along
    inside = (start >= low) & (start <= high)
    still = np.abs(along) < 1e-12
    enter = np.where(still, np.where(inside, 0.0, 2.0), np.minimum(one, other)).max(axis=2)
    leave = np.where(still, np.where(inside, 1.0, -1.0), np.maximum(one, other)).min(axis=2)
    enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
    jump = ~(np.abs(along).max(axis=2) <= JUMP)
    return np.where(jump, 2.0, enter), np.where(jump, -1.0, leave)
