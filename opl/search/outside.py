"""How far columns of nodes are outside of a box, the chords between neighbouring nodes included."""

from __future__ import annotations

import numpy as np
from numba import njit

BISECTIONS = 24  # of a chord; its nearest point is then known to a ten millionth of its length


@njit(
    "void(float64[:,:,::1],boolean[:,::1],float64[::1],float64[::1],float64,float64[::1],"
    "float64[::1])",
    cache=True,
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
    for column in range(n_columns):
        best, place = np.inf, -1.0
        for row in range(n_rows):
            if not free[column, row]:
                continue
            away = 0.0
            for joint in range(n_joints):
                value = q[column, joint, row]
                away += max(value - high[joint], 0.0) + max(low[joint] - value, 0.0)
            if away < best:
                best, place = away, float(row)
        for row in range(n_rows - 1):
            if not (free[column, row] and free[column, row + 1]):
                continue
            least = 0.0
            jump = False
            for joint in range(n_joints):
                a, b = q[column, joint, row], q[column, joint, row + 1]
                least += max(min(a, b) - high[joint], 0.0) + max(low[joint] - max(a, b), 0.0)
                jump = jump or abs(b - a) > longest
            if jump or least >= best - 1e-12:
                continue
            # the distance is convex along the chord: follow its slope
            left, right = 0.0, 1.0
            for _ in range(BISECTIONS):
                x = (left + right) / 2.0
                away, slope = 0.0, 0.0
                for joint in range(n_joints):
                    a, b = q[column, joint, row], q[column, joint, row + 1]
                    value = a + x * (b - a)
                    if value > high[joint]:
                        away += value - high[joint]
                        slope += b - a
                    elif value < low[joint]:
                        away += low[joint] - value
                        slope -= b - a
                if away < best:
                    best, place = away, row + x
                if slope > 0.0:
                    right = x
                elif slope < 0.0:
                    left = x
                else:
                    break
        missing[column] = best
        at[column] = place
