"""Ways through a rectangle of places and contact positions that a box of joint space leaves open.

Lines of equal place and of equal contact position cut the rectangle into cells. A motion runs from
its first place to its last, never back, from cell to cell: the edges that it crosses should miss
the box as little as may be. Where all ways miss it, edges that do join from the least contact
position to the greatest: no motion in the box gets past that chain.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.chords import JUMP
from opl.search.outside import nearest_on_chord

LEFT, BELOW, ABOVE = range(3)  # from where a cell is entered

Corner = tuple[int, int]  # indices of place and contact position


@kernel("float64(float64[:],float64[:],boolean,boolean,float64[::1],float64[::1])")
def _missed(a, b, free_a, free_b, low, high):  # type: ignore[no-untyped-def]
    """Return by how much a box misses an edge, as far as its ends tell; infinite with none free."""
    jump, away_a, away_b = False, 0.0, 0.0
    for j in range(6):
        jump = jump or not abs(b[j] - a[j]) <= JUMP
        away_a += max(a[j] - high[j], 0.0) + max(low[j] - a[j], 0.0)
        away_b += max(b[j] - high[j], 0.0) + max(low[j] - b[j], 0.0)
    if not (free_a or free_b):
        return np.inf
    if jump:
        return min(away_a if free_a else np.inf, away_b if free_b else np.inf)
    found, _ = nearest_on_chord(a, b, low, high, np.inf)
    return found


@kernel(
    "void(float64[:,:,::1],boolean[:,::1],float64[::1],float64[::1],float64[:,::1],float64[:,::1])"
)
def _edges_missed(q, free, low, high, up, along):  # type: ignore[no-untyped-def]
    n, m = free.shape
    for k in range(n):
        for j in range(m):
            if j + 1 < m:
                up[k, j] = _missed(q[k, j], q[k, j + 1], free[k, j], free[k, j + 1], low, high)
            if k + 1 < n:
                along[k, j] = _missed(q[k, j], q[k + 1, j], free[k, j], free[k + 1, j], low, high)


def edges_missed(q: Array, free: np.ndarray, box: JointBox) -> tuple[Array, Array]:
    """Return by how much a box misses the edges of a rectangle, as far as its corners tell.

    Args:
        q: Postures in [rad], shape (n, m, 6).
        free: Which may be used, shape (n, m).
        box: The box.

    Returns:
        For the edges from each contact position to the next, shape (n, m - 1), and from each place
        to the next, shape (n - 1, m).
    """
    n, m = free.shape
    up, along = np.empty((n, m - 1)), np.empty((n - 1, m))
    _edges_missed(q, free, box.lower, box.upper, up, along)
    return up, along


@kernel("void(float64[:,::1],float64[:,::1],boolean,float64[:,::1],int8[:,::1])")
def _entered(up, along, worst, least, come):  # type: ignore[no-untyped-def]
    """Find how little edges must miss the box to enter each cell, and from where it is entered.

    The worst of the edges crossed counts, or their sum.
    """
    n, m = up.shape[0] - 1, up.shape[1]
    for k in range(n):
        for j in range(m):
            before = 0.0 if k == 0 else least[k - 1, j]
            least[k, j] = max(before, up[k, j]) if worst else before + up[k, j]
            come[k, j] = LEFT
        for j in range(m - 1):
            here = least[k, j]
            over = max(here, along[k, j + 1]) if worst else here + along[k, j + 1]
            if over < least[k, j + 1]:
                least[k, j + 1], come[k, j + 1] = over, BELOW
        for j in range(m - 1, 0, -1):
            here = least[k, j]
            over = max(here, along[k, j]) if worst else here + along[k, j]
            if over < least[k, j - 1]:
                least[k, j - 1], come[k, j - 1] = over, ABOVE


def barred(up: Array, along: Array) -> float:
    """Return what every way misses a box by at some edge at the least, in [rad].

    Args:
        up: By how much it misses those from each contact position to the next, shape (n, m - 1).
        along: Those from each place to the next, shape (n - 1, m).
    """
    shape = len(along), up.shape[1]
    least, come = np.empty(shape), np.empty(shape, np.int8)
    _entered(up, along, True, least, come)
    return float(np.maximum(least[-1], up[-1]).min())


def passage(up: Array, along: Array, most: float) -> list[tuple[Corner, Corner]]:
    """Return the edges of the way that misses a box by the least in all.

    Args:
        up: As for `barred`.
        along: Likewise.
        most: What an edge of it may miss the box by, in [rad].
    """
    up, along = np.where(up > most, np.inf, up), np.where(along > most, np.inf, along)
    shape = len(along), up.shape[1]
    least, come = np.empty(shape), np.empty(shape, np.int8)
    _entered(up, along, False, least, come)
    k, j = len(along), int(np.argmin(least[-1] + up[-1]))
    edges = [((k, j), (k, j + 1))]
    k -= 1
    while k >= 0:
        if come[k, j] == LEFT:
            edges.append(((k, j), (k, j + 1)))
            k -= 1
        elif come[k, j] == BELOW:
            edges.append(((k, j), (k + 1, j)))
            j -= 1
        else:
            edges.append(((k, j + 1), (k + 1, j + 1)))
            j += 1
    return edges[::-1]


@kernel("int64(boolean[:,::1],boolean[:,::1],int64[::1])", makes_arrays=True)
def _climbed(up, along, before):  # type: ignore[no-untyped-def]
    """Return the first corner reached of the greatest contact position, -1 if none is.

    Over edges that may be used upwards or along, one step each, and over all downwards for nothing.

    Args:
        up: Which may be used from each contact position to the next, shape (n, m - 1).
        along: Which from each place to the next, shape (n - 1, m).
        before: Filled with the corner before each that was reached, -1 at the start, shape (n m,).
    """
    n, m = up.shape[0], along.shape[1]
    steps = np.full(n * m, n * m)
    now, following = np.empty(n * m, dtype=np.int64), np.empty(n * m, dtype=np.int64)
    left, step, waiting = 0, 0, 0
    for k in range(n):
        steps[k * m], before[k * m] = 0, -1
        now[left] = k * m
        left += 1
    while left > 0:
        done = 0
        while done < left:
            here = now[done]
            done += 1
            k, j = here // m, here % m
            if j == m - 1:
                return here
            for way in range(4):
                there, cost = -1, 1
                if way == 0 and j > 0:
                    there, cost = here - 1, 0
                elif way == 1 and up[k, j]:
                    there = here + 1
                elif way == 2 and k > 0 and along[k - 1, j]:
                    there = here - m
                elif way == 3 and k < n - 1 and along[k, j]:
                    there = here + m
                if there < 0 or steps[there] <= step + cost:
                    continue
                steps[there], before[there] = step + cost, here
                if cost == 0:
                    now[left] = there
                    left += 1
                else:
                    following[waiting] = there
                    waiting += 1
        step += 1
        left, waiting = waiting, 0
        now, following = following, now
    return -1


def chain(up: Array, along: Array, missed: float) -> list[Corner] | None:
    """Return the corners of the shortest chain of edges that miss the box by so much, if any is.

    From the least contact position to the greatest. Where it leads downwards, motions could cross
    it only towards their start: there the edges need not miss the box, and are no part of a wall.

    Args:
        up: As for `barred`.
        along: Likewise.
        missed: What every edge misses the box by at the least, in [rad].
    """
    m = along.shape[1]
    before = np.empty((len(along) + 1) * m, dtype=np.int64)
    here = int(_climbed(up >= missed, along >= missed, before))
    if here < 0:
        return None
    way = []
    while here >= 0:
        way.append((here // m, here % m))
        here = int(before[here])
    way.reverse()
    # only where it turns
    ahead = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(way)]
    turns = [k for k in range(1, len(ahead)) if ahead[k] != ahead[k - 1]]
    return [way[0], *(way[k] for k in turns), way[-1]]
