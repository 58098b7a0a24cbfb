"""Writing FANUC TP programs as text, positions as joint angles, moves with their time in [ms].

Straight moves past a tool that stands (RTCP) have the speed over the part in [mm/s] instead, where
a whole number of them is near enough to the wanted one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.errors import InputError, SettingError
from opl.files import resources
from opl.geometry.frames import roll_pitch_yaw
from opl.program import dialect
from opl.program.dialect import ActionTexts, Dialect, Step, rounded_times
from opl.program.digits import degrees, fixed
from opl.program.fanuc.read import tool_in_frame
from opl.program.fanuc.rounding import DECIMALS, to_fanuc
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.settings import ProgramSettings

_HIGHEST_USER_FRAME = 9
_FASTEST = 2000  # [mm/s] of an L move
_NEAR_ENOUGH = 0.01  # a speed of whole mm/s may be from the wanted one, as a fraction of it
DIALECT = Dialect(
    maker="FANUC",
    suffix=".LS",
    template=resources.folder("templates") / "fanuc" / "program.ls.j2",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,35}"),
    name_rule="a letter and up to 35 letters, digits or _",
    comment_length=32,
    motion=re.compile(r"^[0-9]*: ?[JLCA] "),
    line_end="\r\n",
    actions=ActionTexts(
        states=("OFF", "ON"),
        output="  DO[{number}]={state}",
        dwell="  WAIT {seconds:.2f}(sec)",
        wait=("  WAIT DI[{number}]={state}",),
        timed_wait=(
            "  LBL[{first}]",
            "  $WAITTMOUT={hundredths}",
            "  WAIT DI[{number}]={state} TIMEOUT,LBL[{second}]",
            "  JMP LBL[{third}]",
            "  LBL[{second}]",
            "  PAUSE",
            "  JMP LBL[{first}]",
            "  LBL[{third}]",
        ),
        call="  CALL {name}",
        remark="  !{text}",
    ),
)
_AXIS = re.compile(r"J[1-6]= *([-0-9.]+) deg")
VARIABLES = {
    **dialect.VARIABLES,
    "title": "line about the program of 16 characters at most",
    "frame": "number of the user frame",
    "day": "of the date",
    "time": "of the date",
    "positions": "each position: position.number and position.axes, six texts",
    "lines": "of the program, moves and actions in order, without their numbers",
}


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as programs name it."""
    return tool_in_frame(str(settings.tool), _frame(settings))


def _frame(settings: ProgramSettings) -> str:
    """Return the number of the user frame."""
    if settings.stationary is None or settings.user_frame is None:
        return "0"
    return str(settings.user_frame.number)


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the program as FANUC text."""
    times = rounded_times(program.moves, 3, 0.001)
    axes = [degrees(row, DECIMALS) for row in to_fanuc(program.q)]
    places = settings.led.frames(forward_kinematics(robot, program.q))[:, :3, 3]
    lengths = 1e3 * np.linalg.norm(np.diff(places, axis=0, prepend=places[:1]), axis=1)
    remote = settings.stationary is not None
    moves = []
    both = zip(program.moves, times, lengths, axes, strict=True)
    for number, (move, time, length, row) in enumerate(both, 1):
        speed = f"{100.0 * move.speed:.0f}%" if np.isnan(time) else f"{time * 1e3:.0f}msec"
        if remote and move.straight and move.duration:
            exact = length / move.duration
            whole = min(round(exact), _FASTEST)
            if abs(whole - exact) <= _NEAR_ENOUGH * exact and whole > 0:
                speed, time = f"{whole}mm/sec", length / whole
        instruction = _move(move, number, speed, remote)
        moves.append((instruction, " ".join(row), speed, float(time)))
    tool, frame = str(settings.tool), _frame(settings)
    where = _where_frame_lies(robot, settings)

    def own_values(steps: Sequence[Step]) -> dict[str, object]:
        lines = [f"  !{comment}" for comment in program.comments]
        lines += [*where, f"  UFRAME_NUM={frame}", f"  UTOOL_NUM={tool}"]
        for step in steps:
            lines += [f"  !{step.comment}"] if step.comment else []
            lines += [step.move, *step.actions]
        return {
            "day": f"{date:%y-%m-%d}",
            "time": f"{date:%H:%M:%S}",
            "frame": frame,
            "title": (settings.title or "")[:16],
            "lines": lines,
            "positions": [{"number": str(k), "axes": row} for k, row in enumerate(axes, start=1)],
        }

    found = DIALECT.write(program, settings, date, tool, moves, own_values)
    (text,) = found.files.values()
    if _AXIS.findall(text) != [axis for row in axes for axis in row]:
        template = settings.template or DIALECT.template
        raise InputError(str(template), "loses or changes a position")
    return found


def _where_frame_lies(robot: Robot, settings: ProgramSettings) -> list[str]:
    """Return comments that tell where the user frame of a stationary tool must lie.

    Raises:
        SettingError: If the controller has no such frame.
    """
    if settings.stationary is None or settings.user_frame is None:
        return []
    number = settings.user_frame.number
    if number > _HIGHEST_USER_FRAME:
        raise SettingError("user_frame", f"must be 1 to {_HIGHEST_USER_FRAME}, got {number}")
    T = robot.T_controller_base @ settings.stationary.T_base_tool
    x, y, z = (fixed(float(value), 3) for value in 1e3 * T[:3, 3])
    w, p, r = degrees(roll_pitch_yaw(T), DECIMALS)
    lines = f"USER FRAME {number} MUST LIE AT", f"X {x} Y {y}", f"Z {z}", f"W {w} P {p} R {r}"
    return [f"  !{line}" for line in lines]


def _move(move: Move, number: int, speed: str, remote: bool) -> str:
    """Return the instruction of a move."""
    word = "L" if move.straight else "J"
    # below CNT100 the arm slows down at every point of a pass
    end = "FINE" if move.exact_stop else "CNT100"
    return f"{word} P[{number}] {speed} {end}{' RTCP' if remote and move.straight else ''}"
