"""Writing KRL programs, positions inline, so that no .dat file is needed.

Axis speeds are whole percents (``BAS(#VEL_PTP, n)``), too coarse for the feed, so moves on the
wheel are straight unless a job wants them otherwise: these have a speed in millionths of a metre
per second. They end in C_VEL: with C_DIS, moves as dense as these slow down at every point.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot, controller_poses
from opl.errors import PassTimeError
from opl.files import resources
from opl.geometry.frames import Array, roll_pitch_yaw
from opl.program import dialect
from opl.program.dialect import ActionTexts, Dialect
from opl.program.digits import degrees
from opl.program.krl.read import DECIMALS
from opl.program.loads import carried
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.settings import MotionForm, ProgramSettings
from opl.program.speeds import SpeedRange, speeds_keeping_time

DIALECT = Dialect(
    maker="KRL",
    suffix=".src",
    template=resources.folder("templates") / "krl" / "program.src.j2",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,23}"),
    name_rule="a letter and up to 23 letters, digits or _",
    comment_length=80,
    motion=re.compile(r"^(?:PTP|LIN|CIRC|S?PTP_REL|LIN_REL|SPTP|SLIN|SCIRC) "),
    line_end="\r\n",
    actions=ActionTexts(
        states=("FALSE", "TRUE"),
        output="$OUT[{number}] = {state}",
        dwell="WAIT SEC {seconds:.2f}",
        wait=("WAIT FOR $IN[{number}] == {state}",),
        timed_wait=(
            "REPEAT",
            "$TIMER[1] = -{thousandths}",
            "$TIMER_STOP[1] = FALSE",
            "WAIT FOR ($IN[{number}] == {state}) OR $TIMER_FLAG[1]",
            "IF $IN[{number}] <> {state} THEN",
            "HALT",
            "ENDIF",
            "UNTIL $IN[{number}] == {state}",
        ),
        call="{name}()",
        remark="; {text}",
    ),
)
_PERCENT = SpeedRange(1.0, 100.0, 0)
_METRES_PER_SECOND = SpeedRange(0.000001, 2.0, 6)
_SLOWEST = 1e-5  # [m/s] of the tool point on a straight move: below, it turns and goes nowhere
# Farthest that the time of a single joint move on the wheel may be from the wanted one, as a
# fraction of it, in a program of straight moves.
_FEED_TOLERANCE = 0.05
VARIABLES = {
    **dialect.VARIABLES,
    "step.speed": "instruction that sets the speed of the move",
    "load": "instruction that sets the load of gripper and part, or none",
}


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as programs name it."""
    return f"TOOL_DATA[{settings.tool}]" if settings.tool else "$NULLFRAME"


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the program in KRL."""
    Ts_base_tool = controller_poses(robot, program.q) @ settings.T_flange_tool
    program = _straight_where_it_moves(program, Ts_base_tool)
    speeds, times = _speeds(program, Ts_base_tool, robot)
    if settings.motion is MotionForm.STRAIGHT:
        _require_feed(program, times)
    moves = [
        (*_move(move, T_base_tool), speed, time)
        for move, T_base_tool, speed, time in zip(
            program.moves, Ts_base_tool, speeds, times, strict=True
        )
    ]
    own = {"load": _load(settings)}
    return DIALECT.write(program, settings, date, tool_name(settings), moves, lambda steps: own)


def _load(settings: ProgramSettings) -> str | None:
    """Return the instruction that sets mass and centre of what the flange carries, in its frame.

    $LOAD is the load of all that the flange carries (KUKA System Software, load data), so it is not
    set where the gripper is unknown: that of the controller's tool data holds then.
    """
    load = carried(settings)
    if load is None:
        return None
    x, y, z = (f"{value + 0.0:.1f}" for value in (1e3 * load.p_flange).round(1))
    centre = f"{{X {x},Y {y},Z {z},A 0.0,B 0.0,C 0.0}}"
    return f"$LOAD = {{M {load.mass:.3f},CM {centre},J {{X 0.0,Y 0.0,Z 0.0}}}}"


def _speeds(program: Program, Ts_base_tool: Array, robot: Robot) -> tuple[list[str], list[float]]:
    """Return the instruction that sets the speed of each move, and its time in [s]."""
    if not program.moves:
        return [], []
    percents = 100.0 * (np.abs(np.diff(program.q, axis=0)) / robot.max_speed).max(axis=1)
    lengths = np.linalg.norm(np.diff(Ts_base_tool[:, :3, 3], axis=0), axis=1)
    rest = program.moves[1:]
    straight = [move.straight for move in rest]
    distances = np.where(straight, lengths, percents)
    wanted = [
        move.duration if move.duration is not None else percent / 100.0 / move.speed
        for move, percent in zip(rest, percents, strict=True)
    ]
    ranges = [_METRES_PER_SECOND if line else _PERCENT for line in straight]
    values = speeds_keeping_time(distances.tolist(), wanted, ranges, program.chained)
    texts = [_PERCENT.text(100.0 * program.moves[0].speed)]
    texts += [allowed.text(value) for allowed, value in zip(ranges, values, strict=True)]
    speeds = [
        f"$VEL.CP = {text}" if line else f"BAS(#VEL_PTP, {text})"
        for line, text in zip([False, *straight], texts, strict=True)
    ]
    return speeds, [float("nan"), *(distances / values).tolist()]


def _straight_where_it_moves(program: Program, Ts_base_tool: Array) -> Program:
    """Return a program with joint moves where the tool point hardly moves on a straight one."""
    steps = np.diff(Ts_base_tool[:, :3, 3], axis=0, prepend=Ts_base_tool[:1, :3, 3])
    lengths = np.linalg.norm(steps, axis=1)
    moves = [
        replace(move, straight=move.straight and length >= _SLOWEST * (move.duration or np.inf))
        for move, length in zip(program.moves, lengths, strict=True)
    ]
    return replace(program, moves=tuple(moves))


def _require_feed(program: Program, times: Sequence[float]) -> None:
    """Refuse joint moves on the wheel whose whole percents are too far from the feed.

    Raises:
        PassTimeError: If there is one.
    """
    for move, time in zip(program.moves, times, strict=True):
        if move.ground_pass is None or move.straight or not move.duration:
            continue
        if abs(time / move.duration - 1.0) > _FEED_TOLERANCE:
            raise PassTimeError(
                f"configuration {move.motion_index} (pass {move.ground_pass + 1}): the move there "
                f"would take {time:.3f} s instead of {move.duration:.3f} s, as joint speeds are "
                "whole percents and a straight one leads too far from the proven path"
            )


def _move(move: Move, T_base_tool: Array) -> tuple[str, str]:
    """Return instruction and target."""
    if move.straight:
        x, y, z = T_base_tool[:3, 3] * 1e3
        c, b, a = np.rad2deg(roll_pitch_yaw(T_base_tool))
        target = f"{{X {x:.3f},Y {y:.3f},Z {z:.3f},A {a:.4f},B {b:.4f},C {c:.4f}}}"
        return f"LIN {target}{'' if move.exact_stop else ' C_VEL'}", target
    named = zip("123456", degrees(move.q, DECIMALS), strict=True)
    target = "{" + ",".join(f"A{axis} {angle}" for axis, angle in named) + "}"
    return f"PTP {target}{'' if move.exact_stop else ' C_PTP'}", target
