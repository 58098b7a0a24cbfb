"""Where columns of postures lie in a box of joint space."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.chords import BEND, JUMP, clip, sample
from opl.search.outside import outside


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
    found, spacing = np.empty((len(q), count)), np.empty(len(q))
    share = np.linspace(0.0, 1.0, count)
    # a broadcast row is contiguous as well, but may not be written to, and kernels take no such
    given = (np.require(one, requirements=["C", "W"]) for one in (t, q, free))
    sample(*given, box.lower, box.upper, share, whole, found, spacing)
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
    by_joint = np.require(np.moveaxis(q, 1, 2), requirements=["C", "W"])
    outside(
        by_joint,
        np.require(free, requirements=["C", "W"]),
        box.lower,
        box.upper,
        JUMP,
        missing,
        row,
    )
    return missing, row


def hidden(q: Array, row: Array) -> Array:
    """Return how far postures may stand off the chords at fractional rows, in all joints in [rad].

    Postures of shape (n, m, 6), rows of shape (n,); shape (n,).
    """
    bend = np.abs(np.diff(q, n=2, axis=1))
    bend = np.pad(np.where(bend < JUMP, bend, 0.0), ((0, 0), (1, 1), (0, 0)))
    # the last row ends the last chord
    every, before = np.arange(len(q)), np.minimum(row.astype(int), q.shape[1] - 2)
    most = np.maximum(bend[every, before], bend[every, before + 1])
    return np.asarray(BEND * most.sum(axis=-1) / 8.0)


def about_nearest(t: Array, row: Array, free: np.ndarray, away: Array) -> Array:
    """Return contact positions closer about what is nearest to a box, shape (n, m).

    About the nearest samples that are free. Where those beside them that are not are nearer, the
    other end of these may be the nearest, though the next sample beyond it is farther: half of them
    are about that.

    Args:
        t: Contact positions of the samples, increasing, shape (n, m).
        row: Fractional row of what is nearest and free, shape (n,).
        free: Which samples are, shape (n, m).
        away: By what the box misses each in [rad], shape (n, m).
    """
    every, rows, last = np.arange(len(t)), np.arange(t.shape[1]), t.shape[1] - 1
    low = np.maximum(np.floor(row).astype(int) - 1, 0)
    high = np.minimum(np.ceil(row).astype(int) + 1, last)
    found = np.linspace(t[every, low], t[every, high], last + 1, axis=1)
    before = np.maximum.accumulate(np.where(free, rows, -1), axis=1)[every, low]
    reversed_rows = np.where(free, rows, last + 1)[:, ::-1]
    after = np.minimum.accumulate(reversed_rows, axis=1)[every, last - high]
    missed = np.where(free, away, np.inf).min(axis=1)
    half = len(rows) // 2
    for end, inside, beside in ((before, before + 1, low), (after, after - 1, high)):
        own = np.flatnonzero((end != beside) & (end >= 0) & (end <= last))
        own = own[away[own, inside[own]] < missed[own]]
        beyond = np.clip(2 * end - inside, 0, last)[own]
        ends = np.sort([beyond, inside[own], low[own], high[own]], axis=0)
        least, at, on, most = (t[own, one] for one in ends)
        found[own, :half] = np.linspace(least, at, half, axis=1)
        found[own, half:] = np.linspace(on, most, last + 1 - half, axis=1)
    return found


def nearest(q: Array, free: np.ndarray, box: JointBox) -> np.ndarray:
    """Return which free postures are in a box, or the nearest of a column, shape (n, m)."""
    away = np.where(free, missing(q, box), np.inf)
    least = away.min(axis=1, keepdims=True)
    return np.asarray((away <= least + 1e-12) & np.isfinite(away))


def clipped(q: Array, box: JointBox) -> tuple[Array, Array]:
    """Return where the chords between neighbouring rows enter and leave a box, 0 to 1.

    Shape (n, m - 1) each; one that does not meet the box leaves before it enters.
    """
    enter, leave = np.empty((2, len(q), q.shape[1] - 1))
    clip(np.require(q, requirements=["C", "W"]), box.lower, box.upper, enter, leave)
    return enter, leave
