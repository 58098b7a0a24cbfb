"""Where between two cutter points configurations grind, and how far they are off the contact model.

A configuration alone does not always tell: in a hollow the part can lie on the flat and on an edge
    of the
wheel at once, and a flat face lies on the flat with all its points. What counts is that there are
places for all configurations of the way that never go back, each within the contact model; of
those, the ones are taken that lie nearest to it and move evenly over the wheel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array, interpolate
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.contact import contact_positions, misfit

TRIED = 48  # places tried first between two neighbouring cutter points
ROUNDS = 4  # of refining, each to a quarter
LEVER = 0.05  # [m] from the ground point; weighs angles against distances
# [m] that one belt unit away from an even change of t counts for, step by step: on a flat part of
# the surface there is nothing else to tell places by
UNEVEN = 1e-5


def place_between(
    wheel: ContactWheel,
    points: CutterPoints,
    Ts_contact0_workpiece: Array,
    duration: Array,
    ends: tuple[int, int],
    t_ends: tuple[float, float],
) -> tuple[Array, Array, Array]:
    """Place the configurations of a way between two cutter points, none before the one ahead of it.

    Args:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is at each configuration of the way, shape (n, 4, 4).
        duration: Times of the moves, the one onto the second cutter point as well, shape (n + 1,).
        ends: The cutter points that are ground before and after.
        t_ends: The contact positions there.

    Returns:
        Fractional cutter point, contact position, and distance from the contact model in [m], with
        what the part is turned counted along `LEVER`; each of shape (n,).
    """
    n, span = len(Ts_contact0_workpiece), ends[1] - ends[0]
    time = np.maximum(duration, 1e-9)
    even = np.diff(t_ends) * time / time.sum()  # change of t in each move

    def misfit_at(places: Array) -> tuple[Array, Array]:
        Ts = Ts_contact0_workpiece[:, None] @ frames_at(points, places)
        t = contact_positions(wheel, Ts)
        distance, angle = misfit(wheel, Ts, t)
        return np.hypot(distance, LEVER * angle), t

    width = 1.0 / TRIED
    tried = np.tile(ends[0] + np.arange(span * TRIED + 1) / TRIED, (n, 1))
    for _ in range(1 + ROUNDS):
        apart, t = misfit_at(tried)
        chosen = np.arange(n), _in_order(tried, apart, t, even, t_ends)
        found = tried[chosen], t[chosen], apart[chosen]
        tried = np.clip(found[0][:, None] + np.linspace(-width, width, 9), *ends)
        width /= 4.0
    return found


def _in_order(
    tried: Array, apart: Array, t: Array, even: Array, t_ends: tuple[float, float]
) -> NDArray[np.intp]:
    """Choose one place for each configuration so that none goes back, shape (n,).

    Dynamic programming over the configurations; the sum of the squares of all misfits is least.

    Args:
        tried: Places, shape (n, k).
        apart: Their distances from the contact model in [m], shape (n, k).
        t: Their contact positions, shape (n, k).
        even: Change of t in each move if it changed evenly, shape (n + 1,).
        t_ends: Contact positions before and after.
    """
    n = len(tried)
    came_from = np.zeros(tried.shape, dtype=np.intp)
    cost = np.square(apart[0]) + np.square(UNEVEN * (t[0] - t_ends[0] - even[0]))
    for k in range(1, n):
        change = t[k][:, None] - t[k - 1] - even[k]
        way = cost + np.square(UNEVEN * change)
        way[tried[k][:, None] < tried[k - 1]] = np.inf
        came_from[k] = way.argmin(axis=1)
        cost = np.take_along_axis(way, came_from[k][:, None], axis=1)[:, 0] + np.square(apart[k])
    last = cost + np.square(UNEVEN * (t_ends[1] - t[-1] - even[-1]))
    chosen = np.empty(n, dtype=np.intp)
    chosen[-1] = last.argmin()
    for k in range(n - 1, 0, -1):
        chosen[k - 1] = came_from[k][chosen[k]]
    return chosen


def frames_at(points: CutterPoints, place: Array) -> Array:
    """Return cutter frames at fractional cutter points, shape (..., 4, 4)."""
    before = np.clip(place.astype(int), 0, len(points) - 1)
    after = np.minimum(before + 1, len(points) - 1)
    Ts = points.Ts_workpiece_cutter
    return interpolate(Ts[before], Ts[after], place - before)
