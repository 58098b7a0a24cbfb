"""From the path on the wheel to a whole motion: home, approach, passes, retract, links, home.

The part comes to the wheel and leaves it along the contact normal; between passes, and from and to
home, all joints move together on a straight line in joint space.
"""

from __future__ import annotations

import numpy as np

from opl.cell.inverse import inverse
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.motion import Motion, Stretch
from opl.planning.path import GrindingPath
from opl.planning.timing import Pace, lead_count


class UnreachableApproachError(Exception):
    """The postures that lead to or from the wheel along the contact normal do not exist.

    Args:
        column: The cutter point.
        cause: ``reach``, or ``limits of`` those by name.
    """

    def __init__(self, column: int, cause: str) -> None:
        super().__init__(f"approach to cutter point {column}: {cause}")
        self.column = column
        self.cause = cause


def whole_motion(cell: WorkCell, points: CutterPoints, path: GrindingPath, pace: Pace) -> Motion:
    """Join the passes of a path into one motion from home to home, its times still unknown.

    Args:
        cell: The cell.
        points: The cutter points of the path.
        path: The path on the wheel.
        pace: Speeds, approach and home.

    Raises:
        UnreachableApproachError: If an approach or retract leaves reach or limits.
    """
    legs = [_Leg(pace.home[None], Stretch.HOME, pass_index=-1)]
    for index in range(int(points.pass_index[-1]) + 1):
        on_pass = np.flatnonzero(path.pass_index == index)
        first, last = int(on_pass[0]), int(on_pass[-1])
        lead_in = _along_normal(cell, points, path, first, pace)
        lead_out = _along_normal(cell, points, path, last, pace)
        air = Stretch.HOME if index == 0 else Stretch.LINK
        legs.append(_Leg(lead_in[-1:], air, index))
        # the part touches down as an approach; the first cutter point ends that move
        legs.append(_Leg(lead_in[-2::-1], Stretch.APPROACH, index))
        legs.append(
            _Leg(
                path.q[on_pass],
                Stretch.GRIND,
                index,
                path.contact_position[on_pass],
                path.cutter_point[on_pass],
            )
        )
        legs.append(_Leg(lead_out, Stretch.RETRACT, index))
    legs.append(_Leg(pace.home[None], Stretch.HOME, pass_index=-1))

    q = np.concatenate([leg.q for leg in legs])
    place = np.concatenate([leg.cutter_point for leg in legs])
    stretch = tuple(
        Stretch.BETWEEN if leg.stretch is Stretch.GRIND and point % 1.0 else leg.stretch
        for leg in legs
        for point in leg.cutter_point
    )
    return Motion(
        q=q,
        duration=np.full(len(q), np.nan),
        stretch=stretch,
        contact_position=np.concatenate([leg.contact_position for leg in legs]),
        cutter_point=place,
        pass_index=np.concatenate([np.full(len(leg.q), leg.pass_index) for leg in legs]),
        clearance=np.full(len(q), np.nan),
    )


class _Leg:
    """Some postures of one kind."""

    def __init__(
        self,
        q: Array,
        stretch: Stretch,
        pass_index: int,
        contact_position: Array | None = None,
        cutter_point: Array | None = None,
    ) -> None:
        nothing = np.full(len(q), np.nan)
        self.q = q
        self.stretch = stretch
        self.pass_index = pass_index
        self.contact_position = nothing if contact_position is None else contact_position
        self.cutter_point = nothing if cutter_point is None else cutter_point


def _along_normal(
    cell: WorkCell, points: CutterPoints, path: GrindingPath, index: int, pace: Pace
) -> Array:
    """Return postures from just off the wheel to the end of the retract, shape (k, 6)."""
    count = lead_count(pace)
    T_contact_away = np.tile(np.eye(4), (count, 1, 1))
    # z of the contact frame points into the wheel
    T_contact_away[:, 2, 3] = -pace.approach_length * np.arange(1, count + 1) / count
    column = int(path.cutter_point[index])
    T_base_contact = cell.wheel.T_base_contact(path.contact_position[index])
    T_base_flange = cell.Ts_base_flange(
        path.contact_position[index], points.Ts_workpiece_cutter[column]
    )
    T_contact_flange = np.linalg.solve(T_base_contact, T_base_flange)
    Ts_base_flange = T_base_contact @ T_contact_away @ T_contact_flange
    solutions = inverse(cell.robot.arm, Ts_base_flange, path.q[index])[:, path.branch]
    if np.isnan(solutions).any():
        raise UnreachableApproachError(column, "reach")
    q = path.q[index] + np.cumsum(
        np.remainder(np.diff(solutions, axis=0, prepend=path.q[index][None]) + np.pi, 2 * np.pi)
        - np.pi,
        axis=0,
    )
    if not cell.within_limits(q).all():
        names = " ".join(cell.broken_limits(q))
        raise UnreachableApproachError(column, f"limits of {names}")
    return q
