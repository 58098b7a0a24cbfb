"""Writing FANUC TP programs as text, positions as joint angles, moves with their time in [ms]."""

from __future__ import annotations

import re
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files import resources
from opl.program import dialect
from opl.program.actions import Action, Call, Dwell, SetOutput, WaitInput
from opl.program.dialect import Dialect, rounded_times, write_steps, written
from opl.program.digits import degrees
from opl.program.fanuc.rounding import DECIMALS, to_fanuc
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.settings import ProgramSettings

TEMPLATE = resources.folder("templates") / "fanuc" / "program.ls.j2"

_DIALECT = Dialect(
    maker="FANUC",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,35}"),
    name_rule="a letter and up to 35 letters, digits or _",
    comment_length=32,
    motion=re.compile(r"^[0-9]*: ?[JLCA] "),
    line_end="\r\n",
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
    _DIALECT.require_legal(program, settings)
    times = rounded_times(program.moves, 3, 0.001)
    q = np.array([move.q for move in program.moves]).reshape(-1, 6)
    axes = [degrees(row, DECIMALS) for row in to_fanuc(q)]
    moves = []
    for number, (move, time, row) in enumerate(zip(program.moves, times, axes, strict=True), 1):
        instruction, speed = _move(move, number, time)
        moves.append((instruction, " ".join(row), speed, float(time)))
    actions = _Actions()
    steps = write_steps(program, moves, actions.lines)
    lines = [f"  !{comment}" for comment in program.comments]
    lines += ["  UFRAME_NUM=0", f"  UTOOL_NUM={tool_name(settings)}"]
    for step in steps:
        lines += [f"  !{step.comment}"] if step.comment else []
        lines += [step.move, *step.actions]
    values = {
        "name": program.name,
        "date": f"{date:%Y-%m-%d %H:%M}",
        "day": f"{date:%y-%m-%d}",
        "time": f"{date:%H:%M:%S}",
        "title": (settings.title or "")[:16],
        "tool": tool_name(settings),
        "comments": program.comments,
        "lines": lines,
        "positions": [{"number": str(k), "axes": row} for k, row in enumerate(axes, start=1)],
    }
    template = settings.template or TEMPLATE
    text = _DIALECT.render(template, values, steps)
    if _AXIS.findall(text) != [axis for row in axes for axis in row]:
        raise InputError(str(template), "loses or changes a position")
    return written(program, f"{program.name}.LS", text, steps)


def _move(move: Move, number: int, time: float) -> tuple[str, str]:
    """Return instruction and speed."""
    word = "L" if move.straight else "J"
    speed = f"{100.0 * move.speed:.0f}%" if np.isnan(time) else f"{time * 1e3:.0f}msec"
    # below CNT100 the arm slows down at every point of a pass
    end = "FINE" if move.exact_stop else "CNT100"
    return f"{word} P[{number}] {speed} {end}", speed


class _Actions:
    """Writes actions; labels in a program are numbered."""

    def __init__(self) -> None:
        self._labels = 0

    def lines(self, action: Action) -> list[str]:
        """Return the instructions of an action."""
        if isinstance(action, SetOutput):
            return [f"  DO[{action.number}]={_state(action.state)}"]
        if isinstance(action, Dwell):
            return [f"  WAIT {action.seconds:.2f}(sec)"]
        if isinstance(action, Call):
            return [f"  CALL {action.name}"]
        if isinstance(action, WaitInput):
            return self._wait(action)
        return [f"  !{action.text}"]

    def _wait(self, action: WaitInput) -> list[str]:
        wait = f"  WAIT DI[{action.number}]={_state(action.state)}"
        if action.timeout is None:
            return [wait]
        again, late, done = (self._labels + k for k in (1, 2, 3))
        self._labels = done
        return [
            f"  LBL[{again}]",
            f"  $WAITTMOUT={round(action.timeout * 100)}",
            f"{wait} TIMEOUT,LBL[{late}]",
            f"  JMP LBL[{done}]",
            f"  LBL[{late}]",
            # started again by a person, it waits again instead of going on without the signal
            "  PAUSE",
            f"  JMP LBL[{again}]",
            f"  LBL[{done}]",
        ]


def _state(on: bool) -> str:
    return "ON" if on else "OFF"
