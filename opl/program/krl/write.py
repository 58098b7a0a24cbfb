"""Writing KRL programs, positions inline, so that no .dat file is needed.

Axis speeds are whole percents (``BAS(#VEL_PTP, n)``): coarse at grinding feed, so passes keep their
time as a whole. Straight moves have their own speed of four decimals.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot, controller_poses
from opl.files import resources
from opl.geometry.frames import roll_pitch_yaw
from opl.program import dialect
from opl.program.actions import Action, Call, Dwell, SetOutput, WaitInput
from opl.program.dialect import Dialect, write_steps, written
from opl.program.digits import degrees
from opl.program.krl.rounding import DECIMALS
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.settings import Array, ProgramSettings
from opl.program.speeds import SpeedRange, speeds_keeping_time

TEMPLATE = resources.folder("templates") / "krl" / "program.src.j2"

_DIALECT = Dialect(
    maker="KRL",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,23}"),
    name_rule="a letter and up to 23 letters, digits or _",
    comment_length=80,
    motion=re.compile(r"^(?:PTP|LIN|CIRC|S?PTP_REL|LIN_REL|SPTP|SLIN|SCIRC) "),
    line_end="\r\n",
)
_PERCENT = SpeedRange(1.0, 100.0, 0)
_METRES_PER_SECOND = SpeedRange(0.0001, 2.0, 4)
VARIABLES = {**dialect.VARIABLES, "step.speed": "instruction that sets the speed of the move"}


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as programs name it."""
    return f"TOOL_DATA[{settings.tool}]" if settings.tool else "$NULLFRAME"


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the program in KRL."""
    _DIALECT.require_legal(program, settings)
    q = np.array([move.q for move in program.moves]).reshape(-1, 6)
    Ts_base_tool = controller_poses(robot, q) @ settings.T_flange_tool
    speeds, times = _speeds(program, q, Ts_base_tool, robot)
    moves = [
        (*_move(move, T_base_tool), speed, time)
        for move, T_base_tool, speed, time in zip(
            program.moves, Ts_base_tool, speeds, times, strict=True
        )
    ]
    steps = write_steps(program, moves, lambda action: [*_action(action)])
    values = {
        "name": program.name,
        "date": f"{date:%Y-%m-%d %H:%M}",
        "title": settings.title,
        "tool": tool_name(settings),
        "comments": program.comments,
    }
    text = _DIALECT.render(settings.template or TEMPLATE, values, steps)
    return written(program, f"{program.name}.src", text, steps)


def _speeds(
    program: Program, q: Array, Ts_base_tool: Array, robot: Robot
) -> tuple[list[str], list[float]]:
    """Return the instruction that sets the speed of each move, and its time in [s]."""
    if not program.moves:
        return [], []
    percents = 100.0 * (np.abs(np.diff(q, axis=0)) / robot.max_speed).max(axis=1)
    lengths = np.linalg.norm(np.diff(Ts_base_tool[:, :3, 3], axis=0), axis=1)
    rest = program.moves[1:]
    straight = [move.straight for move in rest]
    ways = np.where(straight, lengths, percents)
    wanted = [
        move.duration if move.duration is not None else percent / 100.0 / move.speed
        for move, percent in zip(rest, percents, strict=True)
    ]
    ranges = [_METRES_PER_SECOND if line else _PERCENT for line in straight]
    chained = [
        move.ground_pass is not None and move.ground_pass == before.ground_pass
        for before, move in zip(program.moves[:-1], rest, strict=True)
    ]
    values = speeds_keeping_time(ways.tolist(), wanted, ranges, chained)
    first = f"BAS(#VEL_PTP, {_PERCENT.text(100.0 * program.moves[0].speed)})"
    told = [
        f"$VEL.CP = {_METRES_PER_SECOND.text(value)}"
        if line
        else f"BAS(#VEL_PTP, {_PERCENT.text(value)})"
        for line, value in zip(straight, values, strict=True)
    ]
    return [first, *told], [float("nan"), *(ways / values).tolist()]


def _move(move: Move, T_base_tool: Array) -> tuple[str, str]:
    """Return instruction and target."""
    if move.straight:
        x, y, z = T_base_tool[:3, 3] * 1e3
        c, b, a = np.rad2deg(roll_pitch_yaw(T_base_tool))
        target = f"{{X {x:.3f},Y {y:.3f},Z {z:.3f},A {a:.4f},B {b:.4f},C {c:.4f}}}"
        return f"LIN {target}{'' if move.exact_stop else ' C_DIS'}", target
    named = zip("123456", degrees(move.q, DECIMALS), strict=True)
    target = "{" + ",".join(f"A{axis} {angle}" for axis, angle in named) + "}"
    return f"PTP {target}{'' if move.exact_stop else ' C_PTP'}", target


def _action(action: Action) -> Iterator[str]:
    if isinstance(action, SetOutput):
        yield f"$OUT[{action.number}] = {_bool(action.state)}"
    elif isinstance(action, Dwell):
        yield f"WAIT SEC {action.seconds:.2f}"
    elif isinstance(action, WaitInput):
        signal, state = f"$IN[{action.number}]", _bool(action.state)
        if action.timeout is None:
            yield f"WAIT FOR {signal} == {state}"
        else:
            # started again by a person, it waits again instead of going on without the signal
            yield "REPEAT"
            yield f"$TIMER[1] = -{round(action.timeout * 1000)}"
            yield "$TIMER_STOP[1] = FALSE"
            yield f"WAIT FOR ({signal} == {state}) OR $TIMER_FLAG[1]"
            yield f"IF {signal} <> {state} THEN"
            yield "HALT"
            yield "ENDIF"
            yield f"UNTIL {signal} == {state}"
    elif isinstance(action, Call):
        yield f"{action.name}()"
    else:
        yield f"; {action.text}"


def _bool(state: bool) -> str:
    return "TRUE" if state else "FALSE"
