"""Where a held part touches the wheel as the contact model says: frame on frame.

A cutter point is ground where its frame coincides with the contact frame at some contact position.
That position follows from the pose alone: on the flat from where along the axle the point is, about
an edge from how far its normal has turned.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array, rotation_angle, transform
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M, ContactWheel

LEVER = 0.05  # [m] from the ground point; weighs angles against distances


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
    Ts_workpiece_cutter = points.Ts_workpiece_cutter
    found: list[tuple[NDArray[Any], ...]] = [(np.empty(0),) * 4]
    for configuration, T_contact0_workpiece in enumerate(Ts_contact0_workpiece):
        p_contact0 = transform(T_contact0_workpiece, Ts_workpiece_cutter[:, :3, 3])
        near = np.flatnonzero(np.abs(wheel.signed_distance(p_contact0)) <= tolerance)
        Ts_contact0_cutter = T_contact0_workpiece @ Ts_workpiece_cutter[near]
        t = contact_positions(wheel, Ts_contact0_cutter)
        distance, angle = misfit(wheel, Ts_contact0_cutter, t)
        off = np.hypot(distance, LEVER * angle)
        fits = off <= tolerance
        point = near[fits]
        found.append((np.full(len(point), configuration), point, t[fits], off[fits]))
    columns = [np.concatenate(column) for column in zip(*found, strict=True)]
    return Touches(columns[0].astype(np.intp), columns[1].astype(np.intp), *columns[2:])
