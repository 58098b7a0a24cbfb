"""Where a held part touches the wheel as the contact model says: frame on frame.

A cutter point is ground where its frame coincides with the contact frame at some contact position.
That position follows from the pose alone: on the flat from where along the axle the point is, about
an edge from how far its normal has turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array, rotation_angle, transform
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M, ContactWheel

LEVER = 0.05  # [m] from the ground point; weighs angles against distances
AT_ONCE = 1 << 16  # distances that are held in memory
ROUND_OFF = 1e-9  # [m]


@dataclass(frozen=True, eq=False)
class Touches:
    """Which cutter points are where they can be ground, at which configurations; k items each.

    Attributes:
        configuration: Index of the configuration, ascending.
        point: Index of the cutter point, ascending within a configuration.
        contact_position: t.
        distance: Of the cutter point from where the contact model has it, in [m], with what it is
            turned counted along `LEVER`.
    """

    configuration: NDArray[np.intp]
    point: NDArray[np.intp]
    contact_position: Array
    distance: Array

    def __len__(self) -> int:
        return len(self.configuration)


def contact_positions(wheel: ContactWheel, Ts_contact0_cutter: Array) -> Array:
    """Return the contact position t nearest to frames, shape (...).

    The frames are seen from contact frame 0, shape (..., 4, 4). None is beyond the largest roll.
    """
    along = -Ts_contact0_cutter[..., 0, 3] * MM_PER_M  # where the flat would touch
    slide = np.clip(along, -wheel.flat_end, wheel.flat_end)
    roll = np.rad2deg(np.arctan2(Ts_contact0_cutter[..., 0, 2], Ts_contact0_cutter[..., 2, 2]))
    # of the two, flat and the edge that it leans on, the one that is nearer
    last = np.rad2deg(wheel.max_roll)
    edge = np.copysign(wheel.flat_end, roll) + np.clip(roll, -last, last)
    on_flat = np.abs(along - slide) / MM_PER_M + wheel.radius * np.deg2rad(np.abs(roll))
    on_edge = np.abs(along - np.copysign(wheel.flat_end, roll)) / MM_PER_M
    return np.where(on_edge < on_flat, edge, slide)


def misfit(wheel: ContactWheel, Ts_contact0_cutter: Array, t: Array) -> tuple[Array, Array]:
    """Return how far frames are from the contact frames at t, in [m] and [rad], shapes (...)."""
    Ts_contact0_contact = wheel.T_contact0_contact(t)
    apart = Ts_contact0_cutter[..., :3, 3] - Ts_contact0_contact[..., :3, 3]
    return np.linalg.norm(apart, axis=-1), rotation_angle(Ts_contact0_cutter, Ts_contact0_contact)


def find_touches(
    wheel: ContactWheel, points: CutterPoints, Ts_contact0_workpiece: Array, tolerance: float
) -> Touches:
    """Return every cutter point that is where it can be ground.

    `Ts_contact0_workpiece` has shape (n, 4, 4); a point may be up to `tolerance` in [m] off the
    contact model, with what it is turned counted along `LEVER`.
    """
    configuration, point = near_wheel(wheel, points, Ts_contact0_workpiece, tolerance)
    Ts_contact0_cutter = Ts_contact0_workpiece[configuration] @ points.Ts_workpiece_cutter[point]
    t = contact_positions(wheel, Ts_contact0_cutter)
    distance, angle = misfit(wheel, Ts_contact0_cutter, t)
    off = np.hypot(distance, LEVER * angle)
    fits = off <= tolerance
    return Touches(configuration[fits], point[fits], t[fits], off[fits])


def near_wheel(
    wheel: ContactWheel, points: CutterPoints, Ts_contact0_workpiece: Array, within: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return which cutter points are near the surface of the wheel, and at which configurations.

    Args:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is at each configuration, shape (n, 4, 4).
        within: How near, in [m].

    Returns:
        Indices of configurations, ascending, and of points, ascending within each; shape (k,).
    """
    p_workpiece = points.Ts_workpiece_cutter[:, :3, 3]
    at_once = max(1, AT_ONCE // max(1, len(p_workpiece)))
    found = [(np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp))]
    for first in range(0, len(Ts_contact0_workpiece), at_once):
        Ts = Ts_contact0_workpiece[first : first + at_once, :3]
        # in whole matrices, for a first choice: how they round depends on the machine
        p_contact0 = np.moveaxis(Ts[..., :3].swapaxes(0, 1) @ p_workpiece.T, 0, -1)
        away = np.abs(wheel.signed_distance(p_contact0 + Ts[:, None, :, 3]))
        configuration, point = np.nonzero(away <= within + ROUND_OFF)
        found.append((configuration + first, point))
    configuration, point = (np.concatenate(one) for one in zip(*found, strict=True))
    p_contact0 = transform(Ts_contact0_workpiece[configuration], p_workpiece[point])
    near = np.abs(wheel.signed_distance(p_contact0)) <= within
    return configuration[near], point[near]
