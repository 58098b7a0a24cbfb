"""Where the chords between neighbouring postures of columns lie in a box."""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.search.outside import nearest_on_chord

APART = 1e-9  # belt units between two bands of contact positions
JUMP = 0.5  # [rad] between neighbouring contact positions; more is no motion
BEND = 2.0  # times the sagitta that second differences tell: how far postures stand off a chord
STILL = 1e-12  # [rad] that a joint turns along a chord, no less
TOUCHED = 1e-9  # [rad] that a box misses a chord that it holds a point of, no more


@kernel("float64(float64[:,::1],int64,int64)")
def bend_at(q, row, joint):  # type: ignore[no-untyped-def]
    """Return by how much a joint bends at a row in [rad], 0 at ends, gaps and jumps."""
    if row < 1 or row > len(q) - 2:
        return 0.0
    bend = abs((q[row + 1, joint] - q[row, joint]) - (q[row, joint] - q[row - 1, joint]))
    return bend if bend < JUMP else 0.0


@kernel("UniTuple(float64,2)(float64[:,::1],int64,float64[::1],float64[::1])")
def clipped_chord(q, row, low, high):  # type: ignore[no-untyped-def]
    """Return where the chord from a row to the next enters and leaves a box, 0 to 1.

    Args:
        q: A column of postures in [rad], NaN for none, shape (m, 6).
        row: Where the chord begins.
        low: Lower faces of the box in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
    """
    first, last = 0.0, 1.0
    for joint in range(q.shape[1]):
        start = q[row, joint]
        along = q[row + 1, joint] - start
        if not abs(along) <= JUMP:  # or there is no posture
            return 2.0, -1.0
        bend = BEND * max(bend_at(q, row, joint), bend_at(q, row + 1, joint)) / 8.0
        lower, upper = low[joint] - bend, high[joint] + bend
        if abs(along) < STILL:
            inside = lower <= start <= upper
            enter, leave = (0.0, 1.0) if inside else (2.0, -1.0)
        else:
            one, other = (lower - start) / along, (upper - start) / along
            enter, leave = min(one, other), max(one, other)
        first, last = max(first, enter), min(last, leave)
    return first, last


@kernel("int64(float64[:,::1],boolean[::1],float64[::1],float64[::1])")
def nearest_chord(q, free, low, high):  # type: ignore[no-untyped-def]
    """Return at which row the chord begins that a box misses least, -1 where it holds one or none.

    Args:
        q: A column of postures in [rad], NaN for none, shape (m, 6).
        free: Which may be used: both ends of the chord must be, shape (m,).
        low: Lower faces of the box in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
    """
    nearest, best = -1, np.inf
    for row in range(len(q) - 1):
        if not (free[row] and free[row + 1]):
            continue
        jump = False
        for joint in range(q.shape[1]):
            jump = jump or not abs(q[row + 1, joint] - q[row, joint]) <= JUMP
        if not jump:
            best, place = nearest_on_chord(q[row], q[row + 1], low, high, best)
            if best <= TOUCHED:
                return -1
            if place >= 0.0:
                nearest = row
    return nearest


@kernel("void(float64[:,:,::1],float64[::1],float64[::1],float64[:,::1],float64[:,::1])")
def clip(q, low, high, enter, leave):  # type: ignore[no-untyped-def]
    """Find where chords enter and leave a box.

    Args:
        q: Postures in [rad], NaN for none, shape (n, m, 6).
        low: Lower faces of the box in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
        enter: Filled with where they enter it, 0 to 1, shape (n, m - 1).
        leave: Filled with where they leave it; before they enter it where they do not meet it.
    """
    for column in range(len(q)):
        for row in range(q.shape[1] - 1):
            ends = clipped_chord(q[column], row, low, high)
            enter[column, row], leave[column, row] = ends


@kernel(
    "void(float64[:,::1],float64[:,:,::1],boolean[:,::1],float64[::1],float64[::1],float64[::1],"
    "boolean,float64[:,::1],float64[::1])",
    early=True,
    makes_arrays=True,
)
def sample(t, q, free, low, high, share, whole, found, spacing):  # type: ignore[no-untyped-def]
    """Find contact positions where chords lie in a box.

    Args:
        t: Contact positions, increasing, shape (n, m).
        q: The postures in [rad], NaN for none, shape (n, m, 6).
        free: Which may be used: a chord with neither end free is left out, shape (n, m).
        low: Lower faces of the box in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
        share: Which parts of the way through them are sampled, from 0 to 1, shape (count,).
        whole: Whether whole chords are sampled, and those beside them.
        found: Filled with the contact positions, shape (n, count).
        spacing: Filled with how far they are apart, shape (n,).
    """
    n_columns, n_rows, n_joints = q.shape
    start, end = np.empty(n_rows - 1), np.empty(n_rows - 1)
    met = np.empty(n_rows - 1, dtype=np.bool_)
    first, last, length = np.empty(n_rows), np.empty(n_rows), np.empty(n_rows + 1)
    for column in range(n_columns):
        for row in range(n_rows - 1):
            ends = clipped_chord(q[column], row, low, high)
            start[row], end[row] = ends
            met[row] = (free[column, row] or free[column, row + 1]) and ends[1] >= ends[0]
        # others may be met for the bend allowed alone: the nearest is nearest whatever the bend
        nearest = nearest_chord(q[column], free[column], low, high) if met.any() else -1
        if nearest >= 0 and not met[nearest]:
            met[nearest], start[nearest], end[nearest] = True, 0.0, 1.0
        count = 0
        for row in range(n_rows - 1):
            beside = (row > 0 and met[row - 1]) or (row < n_rows - 2 and met[row + 1])
            if met[row] or (whole and beside):
                step = t[column, row + 1] - t[column, row]
                first[count] = t[column, row] + (0.0 if whole else start[row]) * step
                last[count] = t[column, row] + (1.0 if whole else end[row]) * step
                count += 1
        if count == 0:  # the curve passes the box by a hair
            nearest, best = 0, np.inf
            for row in range(n_rows):
                if free[column, row]:
                    away = 0.0
                    for joint in range(n_joints):
                        value = q[column, row, joint]
                        away += max(value - high[joint], 0.0) + max(low[joint] - value, 0.0)
                    if away < best:
                        nearest, best = row, away
            first[0], last[0] = (
                t[column, max(nearest - 1, 0)],
                t[column, min(nearest + 1, n_rows - 1)],
            )
            count = 1
        length[0] = 0.0
        bands = 1
        for k in range(count):
            length[k + 1] = length[k] + (last[k] - first[k])
            bands += k > 0 and first[k] > last[k - 1] + APART
        # beside wide ones a narrow band has no sample but one at its end: each has its middle
        middles = bands if 1 < bands <= len(share) // 2 else 0
        even = len(share) - middles
        at = 0
        for k in range(even):
            along = (share[k] if middles == 0 else k / (even - 1.0)) * length[count]
            while at < count - 1 and length[at + 1] <= along:
                at += 1
            found[column, k] = first[at] + min(along - length[at], last[at] - first[at])
        if middles > 0:
            band, begin = even, first[0]
            for k in range(1, count + 1):
                if k == count or first[k] > last[k - 1] + APART:
                    found[column, band] = (begin + last[k - 1]) / 2.0
                    band += 1
                    if k < count:
                        begin = first[k]
            found[column].sort()
        spacing[column] = length[count] / (even - 1)
