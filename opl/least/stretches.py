"""Edges that pass rows outside of a box: compiled loops.

A row is places at one contact position with a posture each, as of `opl.least.rows`.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.search.chords import clipped_chord


@kernel(
    "int64(float64[:,::1],float64[::1],float64[::1],float64[::1],float64,float64[:,::1])",
)
def stretches(q, places, low, high, same, found):  # type: ignore[no-untyped-def]
    """Find where a box holds a row and return how many stretches that are.

    Args:
        q: Postures in [rad], NaN where there are none, shape (m, 6).
        places: Their places, increasing, shape (m,).
        low: Lower faces of the box in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
        same: What ends no farther than this before another begins is one stretch with it.
        found: Filled with first and last place of each, as many as there are, shape (m, 2).
    """
    count = 0
    for k in range(len(places) - 1):
        enter, leave = clipped_chord(q, k, low, high)
        if not leave >= enter:
            continue
        step = places[k + 1] - places[k]
        first, last = places[k] + enter * step, places[k] + leave * step
        if count == 0 or first > found[count - 1, 1] + same:
            found[count, 0] = first
            count += 1
        found[count - 1, 1] = last
    return count


_ROWS = "Tuple((float64[:,::1],float64[::1],int64[::1],float64[::1]))"


@kernel(
    f"void(float64[::1],float64[:,::1],{_ROWS},float64[::1],float64[::1],float64,float64,"
    "int64[:,:,::1])",
    makes_arrays=True,
)
def passed(places, t, rows, low, high, same, room, counts):  # type: ignore[no-untyped-def]
    """Count the rows at or below nodes, of those that lie outside of a box where an edge is.

    An edge passes none of these rows if it has as many of them below both of its ends.

    Args:
        places: Places of the nodes, increasing, shape (n,).
        t: Their contact positions, shape (n, m).
        rows: Postures of all rows, one row after the other, shape (k, 6); their places, shape (k,);
            where each row begins among them, and the end, shape (r + 1,); the contact position of
            each row, shape (r,).
        low: Lower faces of the box in [rad], shape (6,).
        high: Upper faces in [rad], shape (6,).
        same: As of `stretches`.
        room: How far beyond the ends of an edge a stretch still is on it.
        counts: What is counted is added to it: of both ends of each edge, shape (2, n - 1, m).
    """
    q, places_of_rows, begin, t_of_rows = rows
    found = np.empty((len(q), 2))
    for row in range(len(t_of_rows)):
        own = slice(begin[row], begin[row + 1])
        along = places_of_rows[own]
        count = stretches(q[own], along, low, high, same, found)
        begun, over = 0, 0  # stretches that begin before the end of an edge, and end before it
        for k in range(len(places) - 1):
            if places[k] < along[0] or places[k + 1] > along[-1]:
                continue
            while begun < count and found[begun, 0] < places[k + 1] + room:
                begun += 1
            while over < count and found[over, 1] < places[k] - room:
                over += 1
            if begun > over:
                continue
            for end in range(2):
                for node in range(t.shape[1]):
                    counts[end, k, node] += not t[k + end, node] < t_of_rows[row]
