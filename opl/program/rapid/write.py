"""Writing RAPID modules.

Each move carries its time (argument T), so no speed is rounded. Signals are named ``do12`` and
``di3`` for the numbers of the job, tools other than tool0 ``tool3``: the names must exist on the
controller.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import datetime

import numpy as np
from scipy.spatial.transform import Rotation

from opl.cell.robot import Robot, controller_poses
from opl.files import resources
from opl.program.actions import Action, Call, Dwell, SetOutput, WaitInput
from opl.program.dialect import Dialect, rounded_times, write_steps, written
from opl.program.digits import degrees
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.rapid.read import START
from opl.program.rapid.rounding import DECIMALS
from opl.program.settings import Array, ProgramSettings

TEMPLATE = resources.folder("templates") / "rapid" / "module.mod.j2"

_DIALECT = Dialect(
    maker="RAPID",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,29}"),  # 32 characters, of which the module takes two more
    name_rule="a letter and up to 29 letters, digits or _",
    comment_length=80,
    motion=re.compile(r"^Move[A-Z]"),
    line_end="\r\n",
)
_NO_AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as modules name it."""
    return f"tool{settings.tool}"


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the module of a program."""
    _DIALECT.require_legal(program, settings)
    tool = tool_name(settings)
    times = rounded_times(program.moves, 4, 0.0001)
    q = np.array([move.q for move in program.moves]).reshape(-1, 6)
    Ts_base_tool = controller_poses(robot, q) @ settings.T_flange_tool
    moves = [
        (*_move(move, T_base_tool, time, tool), float(time))
        for move, T_base_tool, time in zip(program.moves, Ts_base_tool, times, strict=True)
    ]
    steps = write_steps(program, moves, lambda action: [*_action(action)])
    values = {
        "name": program.name,
        "date": f"{date:%Y-%m-%d %H:%M}",
        "title": settings.title,
        "tool": tool,
        "comments": program.comments,
    }
    text = _DIALECT.render(settings.template or TEMPLATE, values, steps)
    return written(program, f"{program.name}.mod", text, steps)


def _move(move: Move, T_base_tool: Array, time: float, tool: str) -> tuple[str, str, str]:
    """Return instruction, target and speed."""
    speed = f"v{START}" if np.isnan(time) else f"v1000\\T:={time:.4f}"
    zone = "fine" if move.exact_stop else "z0"
    if move.straight:
        target = _robtarget(move.q, T_base_tool)
        return f"MoveL {target}, {speed}, {zone}, {tool};", target, speed
    target = f"[[{','.join(degrees(move.q, DECIMALS))}],{_NO_AXES}]"
    return f"MoveAbsJ {target}\\NoEOffs, {speed}, {zone}, {tool};", target, speed


def _robtarget(q: Array, T_base_tool: Array) -> str:
    x, y, z = T_base_tool[:3, 3] * 1e3
    qx, qy, qz, qw = Rotation.from_matrix(T_base_tool[:3, :3]).as_quat(canonical=True)
    # quarter turns of axes 1, 4 and 6; the module switches the check of the rest off
    cf1, cf4, cf6 = (int(np.floor(np.rad2deg(q[joint]) / 90.0)) for joint in (0, 3, 5))
    return (
        f"[[{x:.3f},{y:.3f},{z:.3f}],[{qw:.7f},{qx:.7f},{qy:.7f},{qz:.7f}],"
        f"[{cf1},{cf4},{cf6},0],{_NO_AXES}]"
    )


def _action(action: Action) -> Iterator[str]:
    if isinstance(action, SetOutput):
        yield f"SetDO do{action.number}, {int(action.state)};"
    elif isinstance(action, Dwell):
        yield f"WaitTime {action.seconds:.2f};"
    elif isinstance(action, WaitInput):
        wait = f"WaitDI di{action.number}, {int(action.state)}"
        if action.timeout is None:
            yield f"{wait};"
        else:
            wait += f"\\MaxTime:={action.timeout:.2f}\\TimeFlag:=late;"
            yield wait
            # started again by a person, it waits again instead of going on without the signal
            yield from ("WHILE late DO", "Stop;", wait, "ENDWHILE")
    elif isinstance(action, Call):
        yield f"{action.name};"
    else:
        yield f"! {action.text}"
