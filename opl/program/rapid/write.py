"""Writing RAPID modules.

Joint moves carry their time (argument T), so no speed is rounded. Straight ones lead the part past
a stationary tool in the middle of the wheel, at a speed that is the surface feed where the part is
ground there. Signals are named ``do12`` and ``di3`` for the numbers of the job, tools other than
tool0 ``tool3``: the names must exist on the controller. What the part weighs, and what stands
still, the module declares.
"""

from __future__ import annotations

import re
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.files import resources
from opl.geometry.frames import Array
from opl.geometry.rotations import quaternion
from opl.program import dialect
from opl.program.dialect import ActionTexts, Dialect, rounded_times
from opl.program.digits import degrees
from opl.program.moves import Move, Program
from opl.program.posts import Written
from opl.program.rapid.read import DECIMALS, START, V_DECIMALS
from opl.program.rapid.tool_data import GRIP, PART, WHEEL, declarations
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
_SLOWEST = 0.1  # [mm/s] that a speed is written with; what is slower has a time
VARIABLES = {
    **dialect.VARIABLES,
    "declarations": "of the tool that stands, of the part and of its load, one a line",
    "grip": "instruction that connects the load of the part, or none",
}


def tool_name(settings: ProgramSettings) -> str:
    """Return the tool of a job as modules name it."""
    return f"tool{settings.tool}" if settings.stationary is None else f"{WHEEL}\\WObj:={PART}"


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the module of a program."""
    tool, led = tool_name(settings), settings.led
    times = rounded_times(program.moves, 4, 0.0001)
    frames = led.frames(forward_kinematics(robot, program.q))
    lengths = np.linalg.norm(np.diff(frames[:, :3, 3], axis=0, prepend=frames[:1, :3, 3]), axis=1)
    moves = []
    for move, frame, length, time in zip(
        program.moves, led.as_counted(frames, robot), lengths, times, strict=True
    ):
        speed = START.text if np.isnan(time) else f"v1000\\T:={time:.4f}"
        if move.straight and settings.stationary is not None and move.duration:
            v = round(1e3 * length / move.duration, V_DECIMALS)
            if v >= _SLOWEST:
                speed, time = f"[{v:.{V_DECIMALS}f},500,5000,1000]", 1e3 * length / v
        moves.append((*_move(move, frame, speed, tool), speed, float(time)))
    own = {
        "declarations": declarations(settings, robot),
        "grip": None if settings.load is None else GRIP,
    }
    return DIALECT.write(program, settings, date, tool, moves, lambda steps: own)


def _move(move: Move, frame: Array, speed: str, tool: str) -> tuple[str, str]:
    """Return instruction and target."""
    zone = "fine" if move.exact_stop else "z0"
    if move.straight:
        target = _robtarget(move.q, frame)
        return f"MoveL {target}, {speed}, {zone}, {tool};", target
    target = f"[[{','.join(degrees(move.q, DECIMALS))}],{_NO_AXES}]"
    return f"MoveAbsJ {target}\\NoEOffs, {speed}, {zone}, {tool};", target


def _robtarget(q: Array, frame: Array) -> str:
    x, y, z = frame[:3, 3] * 1e3
    qx, qy, qz, qw = quaternion(frame[:3, :3])
    # quarter turns of axes 1, 4 and 6; the module switches the check of the rest off
    cf1, cf4, cf6 = (int(np.floor(np.rad2deg(q[joint]) / 90.0)) for joint in (0, 3, 5))
    return (
        f"[[{x:.3f},{y:.3f},{z:.3f}],[{qw:.7f},{qx:.7f},{qy:.7f},{qz:.7f}],"
        f"[{cf1},{cf4},{cf6},0],{_NO_AXES}]"
    )
