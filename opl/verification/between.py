"""Where between two cutter points a posture grinds, and how far it is off the contact model."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array, interpolate
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.contact import contact_positions, misfit

TRIED = 16  # places tried first between two neighbouring cutter points
ROUNDS = 4  # of refining, each to a quarter
LEVER = 0.05  # [m] from the ground point; weighs angles against distances
# [m] that one belt unit away from an even change of t counts for: on a flat part of the surface
# there is nothing else to tell places by
UNEVEN = 1e-6


def place_between(
    wheel: ContactWheel,
    points: CutterPoints,
    Ts_contact0_workpiece: Array,
    ends: Array,
    t_ends: Array,
) -> tuple[Array, Array, Array]:
    """Place postures where they come nearest to the contact model.

    Args:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is, shape (n, 4, 4).
        ends: The cutter points that are ground before and after, shape (n, 2).
        t_ends: The contact positions there, shape (n, 2).

    Returns:
        Fractional cutter point, contact position, and distance from the contact model in [m], with
        what the part is turned counted along `LEVER`; each of shape (n,).
    """
    low, span = ends[:, 0], ends[:, 1] - ends[:, 0]

    def misfit_at(fraction: Array) -> tuple[Array, Array]:
        Ts = Ts_contact0_workpiece @ frames_at(points, low + fraction * span)
        t = contact_positions(wheel, Ts)
        distance, angle = misfit(wheel, Ts, t)
        uneven = t - (t_ends[:, 0] + fraction * (t_ends[:, 1] - t_ends[:, 0]))
        parts = (distance, LEVER * angle, UNEVEN * uneven)
        return np.sqrt(sum(np.square(part) for part in parts)), t

    count = TRIED * int(span.max(initial=1.0))
    best = np.full(len(low), 0.5)
    offsets, width = np.arange(1, count) / count - 0.5, 1.0 / count
    for _ in range(1 + ROUNDS):
        tried = np.clip(best + offsets[:, None], 1e-6, 1.0 - 1e-6)
        cost = np.stack([misfit_at(fraction)[0] for fraction in tried])
        best = tried[cost.argmin(axis=0), np.arange(len(low))]
        offsets, width = np.linspace(-width, width, 9), width / 4.0
    # no posture goes back before the one ahead of it
    place = low + best * span
    for end in np.unique(low):
        place[low == end] = np.maximum.accumulate(place[low == end])
    apart, t = misfit_at((place - low) / span)
    return place, t, apart


def frames_at(points: CutterPoints, place: Array) -> Array:
    """Return cutter frames at fractional cutter points, shape (n, 4, 4)."""
    before = np.clip(place.astype(int), 0, len(points) - 1)
    after = np.minimum(before + 1, len(points) - 1)
    Ts = points.Ts_workpiece_cutter
    return interpolate(Ts[before], Ts[after], place - before)
