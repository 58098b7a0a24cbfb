"""Writing FANUC TP programs as text, positions as joint angles, moves with their time in [ms]."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files import resources
from opl.program import dialect
from opl.program.dialect import ActionTexts, Dialect, Step, rounded_times
from opl.program.digits import degrees
from opl.program.fanuc.rounding import DECIMALS, to_fanuc
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.settings import ProgramSettings

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
    "day": "of the date",
    "time": "of the date",
    "positions": "each position: position.number and position.axes, six texts",
    "lines": "of the program, moves and actions in order, without their numbers",
}


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as programs name it."""
    return str(settings.tool)


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the program as FANUC text."""
    times = rounded_times(program.moves, 3, 0.001)
    axes = [degrees(row, DECIMALS) for row in to_fanuc(program.q)]
    moves = []
    for number, (move, time, row) in enumerate(zip(program.moves, times, axes, strict=True), 1):
        instruction, speed = _move(move, number, time)
        moves.append((instruction, " ".join(row), speed, float(time)))
    tool = tool_name(settings)

    def own_values(steps: Sequence[Step]) -> dict[str, object]:
        lines = [f"  !{comment}" for comment in program.comments]
        lines += ["  UFRAME_NUM=0", f"  UTOOL_NUM={tool}"]
        for step in steps:
            lines += [f"  !{step.comment}"] if step.comment else []
            lines += [step.move, *step.actions]
        return {
            "day": f"{date:%y-%m-%d}",
            "time": f"{date:%H:%M:%S}",
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


def _move(move: Move, number: int, time: float) -> tuple[str, str]:
    """Return instruction and speed."""
    word = "L" if move.straight else "J"
    speed = f"{100.0 * move.speed:.0f}%" if np.isnan(time) else f"{time * 1e3:.0f}msec"
    # below CNT100 the arm slows down at every point of a pass
    end = "FINE" if move.exact_stop else "CNT100"
    return f"{word} P[{number}] {speed} {end}", speed
