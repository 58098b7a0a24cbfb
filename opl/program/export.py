"""From a verified motion to the files of a program, by whichever post the job names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from opl.cell.robot import Robot, controller_poses
from opl.geometry.frames import Array
from opl.motion.motion import VerifiedMotion
from opl.program.cycle import cycle_time
from opl.program.lines import with_straight_moves
from opl.program.loads import load_comments
from opl.program.moves import START_SPEED, Move, Program, Purpose, plan_moves
from opl.program.posts import find_post
from opl.program.pulses import PulseScale
from opl.program.settings import MotionForm, ProgramSettings
from opl.program.table import render_table


@dataclass(frozen=True, eq=False)
class StraightLimit:
    """How far straight moves may lead from the verified path.

    Attributes:
        corners: Corners of a box around the held part in the flange frame in [m], shape (8, 3).
        tolerance: Farthest that any of them may be from its verified place in [m].
    """

    corners: Array
    tolerance: float


def export_program(
    verified: VerifiedMotion,
    name: str,
    robot: Robot,
    settings: ProgramSettings,
    limit: StraightLimit,
    date: datetime,
    comments: Sequence[str] = (),
    stops: frozenset[int] = frozenset(),
) -> tuple[Program, dict[str, str]]:
    """Return the program of a motion, with the times of its passes and of all, and its files.

    Args:
        verified: What the robot shall do.
        name: The program's name.
        robot: Who shall do it.
        settings: How it is written.
        limit: How far straight moves may lead from the verified path.
        date: Date of the files.
        comments: Lines at the top.
        stops: Indices of configurations off the wheel that the robot stops at, beside those of
            `opl.program.stops`.

    Raises:
        OplError: If the controller does not take the program with the settings of the job.
    """
    post, comments = find_post(settings.controller), [*comments, *load_comments(settings)]
    program = plan_moves(
        verified, name, robot.max_speed, comments, robot.joint_names, settings.actions
    )
    moves = (replace(m, exact_stop=m.exact_stop or m.motion_index in stops) for m in program.moves)
    program = replace(program, moves=tuple(moves))
    if settings.motion is MotionForm.STRAIGHT:
        program = with_straight_moves(program, robot, settings.led, limit.corners, limit.tolerance)
    written = post.write(program, robot, settings, date)
    Ts_controller_flange = controller_poses(robot, verified.motion.q)
    table = render_table(verified, written, PulseScale.of(robot), Ts_controller_flange)
    files = {**written.files, f"{name}.csv": table}
    cycle = cycle_time(program, written.times, robot, settings)
    return replace(program, pass_times=written.pass_times, cycle=cycle), files


def try_out(name: str, home: Array, robot: Robot, settings: ProgramSettings) -> None:
    """Write a program that goes home only, with all actions around the passes.

    What the controller or the template does not take is so refused before the long work of
    planning.

    Args:
        name: The program's name.
        home: Joint positions in [rad], shape (6,).
        robot: Whose program.
        settings: How it is written.

    Raises:
        OplError: If the post refuses it.
    """
    moves = tuple(
        Move(home, START_SPEED, exact_stop=True, on_wheel=False, motion_index=k, kind=kind)
        for k, kind in enumerate(Purpose)
    )
    last = replace(moves[-1], actions=settings.actions.every)
    program = Program(name, moves=(*moves[:-1], last))
    find_post(settings.controller).write(program, robot, settings, datetime(2000, 1, 1))
