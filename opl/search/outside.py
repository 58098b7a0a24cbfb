"""How far columns of nodes are outside of a box, the chords between neighbouring nodes included."""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

LEAST_GAIN = 1e-12  # [rad] by which a chord must be nearer than what was nearest
BISECTIONS = 24  # of a chord; its nearest point is then known to a ten millionth of its length


@kernel("UniTuple(float64,2)(float64[:],float64[:],float64[::1],float64[::1],float64)")
def nearest_on_chord(a, b, low, high, best):  # type: ignore[no-untyped-def]
    """Return by how much a box misses a chord, and where on it, 0 to 1.

    If that is not less than ``best`` in [rad], return that and -1.
    """
    place, least = -1.0, 0.0
    for joint in range(len(a)):
        start, end = min(a[joint], b[joint]), max(a[joint], b[joint])
        least += max(start - high[joint], 0.0) + max(low[joint] - end, 0.0)
    if not least < best - LEAST_GAIN:
        return best, place
    # the distance is convex along the chord: follow its slope
    left, right = 0.0, 1.0
    for step in range(BISECTIONS + 2):
        x = float(step) if step < 2 else (left + right) / 2.0
        away, slope = 0.0, 0.0
        for joint in range(len(a)):
            turn = b[joint] - a[joint]
            value = a[joint] + x * turn
            if value > high[joint]:
                away += value - high[joint]
                slope += turn
            elif value < low[joint]:
                away += low[joint] - value
                slope -= turn
        if away < best:
            best, place = away, x
        if step < 2:
            # nowhere is nearer than at an end from which it grows
            if away == 0.0 or (slope > 0.0 if step == 0 else slope < 0.0):
                break
        elif slope > 0.0:
            right = x
        elif slope < 0.0:
            left = x
        else:
            break
    return best, place


@kernel(
    "void(float64[:,:,::1],boolean[:,::1],float64[::1],float64[::1],float64,float64[::1],"
    "float64[::1])",
    early=True,
    makes_arrays=True,
)
def outside(q, free, low, high, longest, missing, at):  # type: ignore[no-untyped-def]
    """Find the point of each column that a box has to grow least for.

    Args:
        q: Nodes in [rad], shape (n_columns, 6, n_rows).
        free: Which may be used, shape (n_columns, n_rows).
        low: Lower faces in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
        longest: Largest change of a joint over a chord in [rad]; larger ones are jumps.
        missing: Filled with how much larger the box must be in [rad], infinite where a column has
            no free node, shape (n_columns,).
        at: Filled with the fractional row of that point, shape (n_columns,).
    """
    n_columns, n_joints, n_rows = q.shape
    # joint by joint along the rows, which lie side by side: the compiler takes several at once
    away, beside = np.empty(n_rows), np.empty(n_rows)
    for column in range(n_columns):
        away[:] = 0.0
        beside[:] = 0.0
        for joint in range(n_joints):
            angles, least, most = q[column, joint], low[joint], high[joint]
            for row in range(n_rows):
                value = angles[row]
                away[row] += max(value - most, 0.0) + max(least - value, 0.0)
            for row in range(n_rows - 1):
                start = min(angles[row], angles[row + 1])
                end = max(angles[row], angles[row + 1])
                beside[row] += max(start - most, 0.0) + max(least - end, 0.0)
        best, place = np.inf, -1.0
        for row in range(n_rows):
            if free[column, row] and away[row] < best:
                best, place = away[row], float(row)
        for row in range(n_rows - 1):
            if not (
                free[column, row] and free[column, row + 1] and beside[row] < best - LEAST_GAIN
            ):
                continue
            start, end = q[column, :, row], q[column, :, row + 1]
            jump = False
            for joint in range(n_joints):
                jump = jump or abs(end[joint] - start[joint]) > longest
            if not jump:
                best, x = nearest_on_chord(start, end, low, high, best)
                if x >= 0.0:
                    place = row + x
        missing[column] = best
        at[column] = place
