"""From the path on the wheel to a whole motion: home, approach, passes, retract, links, home.

The part comes to the wheel and leaves it as `opl.motion.leads` says; between passes, and from and
to home, all joints move together on a straight line in joint space, or on several around obstacles.
Where a job wants it, the robot comes home between passes too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.cell.full_turns import principal
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.free_move_search import BlockedMoveError, FreeMoveSearch
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import GrindingPath, PassEnd
from opl.motion.process_settings import ProcessSettings


class UnreachableApproachError(Exception):
    """The configurations that lead to or from the wheel do not exist.

    Args:
        column: The cutter point.
        cause: ``reach``, or ``limits of`` those by name.
    """

    def __init__(self, column: int, cause: str) -> None:
        super().__init__(f"approach to cutter point {column}: {cause}")
        self.column = column
        self.cause = cause


class BlockedMotionError(Exception):
    """A free move of a motion is blocked.

    Args:
        move: Index in the motion of the configuration that the move should end at.
        error: Why.
    """

    def __init__(self, move: int, error: BlockedMoveError) -> None:
        super().__init__(f"free move to configuration {move}: {error}")
        self.move = move
        self.error = error


def whole_motion(
    cell: WorkCell,
    points: CutterPoints,
    path: GrindingPath,
    process: ProcessSettings,
    leads: Sequence[tuple[Array, Array]] | None = None,
) -> Motion:
    """Join the passes of a path into one motion from home to home, its free moves straight.

    Args:
        cell: The cell.
        points: The cutter points.
        path: The path.
        process: How the part comes to the wheel and leaves it.
        leads: The configurations of approach and retract of each pass, off the wheel first, each
            of shape (k, 6); whole ones as the process says by default.

    Raises:
        UnreachableApproachError: If an approach or retract leaves reach or limits.
    """
    home = Motion.off_wheel(process.home[None], MoveKind.HOME, -1)
    parts = [home]
    if leads is None:
        leads = [
            (lead(cell, points, process, first), lead(cell, points, process, last))
            for first, last in path.pass_ends()
        ]
    for index in range(points.n_passes):
        on_pass = np.flatnonzero(path.pass_index == index)
        lead_in, lead_out = leads[index]
        free = MoveKind.HOME if index == 0 else MoveKind.LINK
        place = path.cutter_point[on_pass]
        if process.home_between and index > 0:
            parts.append(Motion.off_wheel(home.q, free, index))
        parts += [
            Motion.off_wheel(lead_in[-1:], free, index),
            # the last move of the approach ends at the first cutter point
            Motion.off_wheel(lead_in[-2::-1], MoveKind.APPROACH, index),
            Motion(
                path.q[on_pass],
                tuple(map(MoveKind.at_cutter_point, place)),
                path.contact_position[on_pass],
                place,
                path.pass_index[on_pass],
            ),
            Motion.off_wheel(lead_out, MoveKind.RETRACT, index),
        ]
    return Motion.joined([*parts, home])


def linked(motion: Motion, search: FreeMoveSearch) -> Motion:
    """Lead the free moves of a motion around obstacles.

    Raises:
        BlockedMotionError: If one of them cannot be found.
    """
    moves = np.flatnonzero(motion.free[1:]) + 1
    inserted = []
    for move in moves.tolist():
        try:
            inserted.append(search.find(motion.q[move - 1], motion.q[move]))
        except BlockedMoveError as error:
            raise BlockedMotionError(move, error) from error
    before = np.repeat(moves, [len(q) for q in inserted])
    return motion.with_inserted(before, np.concatenate(inserted)) if len(before) else motion


def lead(
    cell: WorkCell,
    points: CutterPoints,
    process: ProcessSettings,
    end: PassEnd,
    run: float | None = None,
) -> Array:
    """Return configurations from just off the wheel to the far end of a lead, shape (k, 6).

    `end` is the end of a pass where it leads to or from; the part moves on along the pass by the
    run in [m], that of the process by default.

    Raises:
        UnreachableApproachError: If it leaves reach or limits.
    """
    q, cause = reachable_lead(cell, points, process, end, run)
    if cause is not None:
        raise UnreachableApproachError(end.cutter_point, cause)
    return q


def reachable_lead(
    cell: WorkCell,
    points: CutterPoints,
    process: ProcessSettings,
    end: PassEnd,
    run: float | None = None,
) -> tuple[Array, str | None]:
    """Return a lead as `lead` does, as far as it is within reach and limits, and what ends it.

    That is None where it is there as a whole, else ``reach`` or ``limits`` with those by name.
    """
    column, t = end.cutter_point, end.contact_position
    offsets = process.lead_shape(run).offsets(end.kind, points.direction_at(column))
    T_contact_away = np.tile(np.eye(4), (len(offsets), 1, 1))
    T_contact_away[:, :3, 3] = offsets
    T_base_contact = cell.wheel.T_base_contact(t)
    T_base_flange = cell.Ts_base_flange(t, points.Ts_workpiece_cutter[column])
    T_contact_flange = np.linalg.solve(T_base_contact, T_base_flange)
    Ts_base_flange = T_base_contact @ T_contact_away @ T_contact_flange
    solutions = inverse_kinematics(cell.robot.arm, Ts_base_flange, end.q)[:, end.ik_branch]
    out_of_reach = np.isnan(solutions).any(axis=1)
    cause = "reach" if out_of_reach.any() else None
    solutions = solutions[: int(np.argmax(out_of_reach)) if cause else None]
    steps = principal(np.diff(solutions, axis=0, prepend=end.q[None]))
    q = end.q + np.cumsum(steps, axis=0)
    within = cell.within_limits(q)
    if not within.all():
        cause = f"limits of {' '.join(cell.broken_limits(q))}"
        q = q[: int(np.argmin(within))]
    return q, cause
