"""Writing RAPID modules.

Each move carries its time (argument T), so no speed is rounded. Signals are named ``do12`` and
``di3`` for the numbers of the job, tools other than tool0 ``tool3``: the names must exist on the
controller.
"""

from __future__ import annotations

import re
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot, controller_poses
from opl.files import resources
from opl.geometry.frames import Array
from opl.geometry.rotations import quaternion
from opl.program.dialect import ActionTexts, Dialect, rounded_times
from opl.program.digits import degrees
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.rapid.read import DECIMALS, START
from opl.program.settings import ProgramSettings

DIALECT = Dialect(
    maker="RAPID",
    suffix=".mod",
    template=resources.folder("templates") / "rapid" / "module.mod.j2",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,29}"),  # 32 characters, of which the module takes two more
    name_rule="a letter and up to 29 letters, digits or _",
    comment_length=80,
    motion=re.compile(r"^Move[A-Z]"),
    line_end="\r\n",
    actions=ActionTexts(
        states=("0", "1"),
        output="SetDO do{number}, {state};",
        dwell="WaitTime {seconds:.2f};",
        wait=("WaitDI di{number}, {state};",),
        timed_wait=(
            "WaitDI di{number}, {state}\\MaxTime:={timeout:.2f}\\TimeFlag:=late;",
            "WHILE late DO",
            "Stop;",
            "WaitDI di{number}, {state}\\MaxTime:={timeout:.2f}\\TimeFlag:=late;",
            "ENDWHILE",
        ),
        call="{name};",
        remark="! {text}",
    ),
)
_NO_AXES = "[9E9,9E9,9E9,9E9,9E9,9E9]"


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as modules name it."""
    return f"tool{settings.tool}"


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the module of a program."""
    tool = tool_name(settings)
    times = rounded_times(program.moves, 4, 0.0001)
    Ts_base_tool = controller_poses(robot, program.q) @ settings.T_flange_tool
    moves = [
        (*_move(move, T_base_tool, time, tool), float(time))
        for move, T_base_tool, time in zip(program.moves, Ts_base_tool, times, strict=True)
    ]
    return DIALECT.write(program, settings, date, tool, moves)


def _move(move: Move, T_base_tool: Array, time: float, tool: str) -> tuple[str, str, str]:
    """Return instruction, target and speed."""
    speed = START.text if np.isnan(time) else f"v1000\\T:={time:.4f}"
    zone = "fine" if move.exact_stop else "z0"
    if move.straight:
        target = _robtarget(move.q, T_base_tool)
        return f"MoveL {target}, {speed}, {zone}, {tool};", target, speed
    target = f"[[{','.join(degrees(move.q, DECIMALS))}],{_NO_AXES}]"
    return f"MoveAbsJ {target}\\NoEOffs, {speed}, {zone}, {tool};", target, speed


def _robtarget(q: Array, T_base_tool: Array) -> str:
    x, y, z = T_base_tool[:3, 3] * 1e3
    qx, qy, qz, qw = quaternion(T_base_tool[:3, :3])
    # quarter turns of axes 1, 4 and 6; the module switches the check of the rest off
    cf1, cf4, cf6 = (int(np.floor(np.rad2deg(q[joint]) / 90.0)) for joint in (0, 3, 5))
    return (
        f"[[{x:.3f},{y:.3f},{z:.3f}],[{qw:.7f},{qx:.7f},{qy:.7f},{qz:.7f}],"
        f"[{cf1},{cf4},{cf6},0],{_NO_AXES}]"
    )
