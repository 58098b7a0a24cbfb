"""From the path on the wheel to a whole motion: home, approach, passes, retract, links, home.

The part comes to the wheel and leaves it as `opl.motion.leads` says; between passes, and from and
to home, all joints move together on a straight line in joint space, or on several around what is in
the way.
"""

from __future__ import annotations

import numpy as np

from opl.cell.full_turns import principal
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.workcell import WorkCell
from opl.field.path import GrindingPath
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.leads import lead_offsets
from opl.motion.links import Links, NoLinkError
from opl.motion.motion import FREE_MOVES, Motion, Stretch
from opl.motion.process import ProcessSettings


class UnreachableApproachError(Exception):
    """The postures that lead to or from the wheel do not exist.

    Args:
        column: The cutter point.
        cause: ``reach``, or ``limits of`` those by name.
    """

    def __init__(self, column: int, cause: str) -> None:
        super().__init__(f"approach to cutter point {column}: {cause}")
        self.column = column
        self.cause = cause


class BlockedLinkError(Exception):
    """The robot cannot come from one place off the wheel to the next.

    Args:
        move: Index in the motion of the posture that it cannot come to.
        error: Why.
    """

    def __init__(self, move: int, error: NoLinkError) -> None:
        super().__init__(f"way to posture {move}: {error}")
        self.move = move
        self.error = error


def whole_motion(
    cell: WorkCell, points: CutterPoints, path: GrindingPath, process: ProcessSettings
) -> Motion:
    """Join the passes of a path into one motion from home to home, its times still unknown.

    Args:
        cell: The cell.
        points: The cutter points of the path.
        path: The path on the wheel.
        process: Speeds, approach and home.

    Raises:
        UnreachableApproachError: If an approach or retract leaves reach or limits.
    """
    legs = [_Leg(process.home[None], Stretch.HOME, pass_index=-1)]
    for index in range(int(points.pass_index[-1]) + 1):
        on_pass = np.flatnonzero(path.pass_index == index)
        first, last = int(on_pass[0]), int(on_pass[-1])
        lead_in, lead_out = (
            lead(
                cell,
                points,
                process,
                stretch,
                path.branch,
                int(path.cutter_point[k]),
                path.contact_position[k],
                path.q[k],
            )
            for k, stretch in ((first, Stretch.APPROACH), (last, Stretch.RETRACT))
        )
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
    legs.append(_Leg(process.home[None], Stretch.HOME, pass_index=-1))

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


def linked(motion: Motion, links: Links) -> Motion:
    """Lead the free moves of a motion around what is in their way.

    Args:
        motion: The motion, every free move of it a single straight one.
        links: Finds the ways.

    Raises:
        BlockedLinkError: If there is none for one of them.
    """
    moves = [k for k in range(1, len(motion)) if motion.stretch[k] in FREE_MOVES]
    on_the_way = []
    for move in moves:
        try:
            on_the_way.append(links.find(motion.q[move - 1], motion.q[move]))
        except NoLinkError as error:
            raise BlockedLinkError(move, error) from error
    before = np.repeat(moves, [len(q) for q in on_the_way])
    if not len(before):
        return motion
    source = np.insert(np.arange(len(motion)), before, before)
    q = np.insert(motion.q, before, np.concatenate(on_the_way), axis=0)
    return Motion(
        q=q,
        duration=motion.duration[source],
        stretch=tuple(motion.stretch[k] for k in source),
        contact_position=motion.contact_position[source],
        cutter_point=motion.cutter_point[source],
        pass_index=motion.pass_index[source],
        clearance=motion.clearance[source],
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


def lead(
    cell: WorkCell,
    points: CutterPoints,
    process: ProcessSettings,
    stretch: Stretch,
    branch: int,
    column: int,
    contact_position: float,
    q_contact: Array,
) -> Array:
    """Return postures from just off the wheel to the far end of a lead, shape (k, 6).

    Args:
        cell: The cell.
        points: The cutter points.
        process: How long it is, and how far it turns.
        stretch: Whether it is the approach or the retract.
        branch: Slot of the inverse kinematics.
        column: The cutter point that is ground.
        contact_position: Where on the wheel.
        q_contact: The posture that grinds it in [rad], shape (6,).

    Raises:
        UnreachableApproachError: If it leaves reach or limits.
    """
    offsets = lead_offsets(process.approach_length, process.approach_turn, stretch)
    T_contact_away = np.tile(np.eye(4), (len(offsets), 1, 1))
    T_contact_away[:, :3, 3] = offsets
    T_base_contact = cell.wheel.T_base_contact(contact_position)
    T_base_flange = cell.Ts_base_flange(contact_position, points.Ts_workpiece_cutter[column])
    T_contact_flange = np.linalg.solve(T_base_contact, T_base_flange)
    Ts_base_flange = T_base_contact @ T_contact_away @ T_contact_flange
    solutions = inverse_kinematics(cell.robot.arm, Ts_base_flange, q_contact)[:, branch]
    if np.isnan(solutions).any():
        raise UnreachableApproachError(column, "reach")
    steps = principal(np.diff(solutions, axis=0, prepend=q_contact[None]))
    q = q_contact + np.cumsum(steps, axis=0)
    if not cell.within_limits(q).all():
        names = " ".join(cell.broken_limits(q))
        raise UnreachableApproachError(column, f"limits of {names}")
    return q
