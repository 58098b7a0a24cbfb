"""What a RAPID module declares of a tool that stands, of the part in the hand and of its load.

With a stationary tool (``robhold`` FALSE in its tooldata) and a part that the robot holds
(``robhold`` TRUE in its wobjdata) path and speed of MoveL relate to the part; the frame of the tool
is then given in the world frame, taken to be the robot's base frame, and that of the part in the
frame of the mounting flange (ABB, RAPID reference manual, tooldata and wobjdata). ``GripLoad``
connects the load of the part, its centre in the frame of the tool, or of the part where the tool
stands (loaddata); the load of the gripper is that of the tooldata.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array, inverse, transform
from opl.geometry.rotations import quaternion
from opl.program.settings import Load, ProgramSettings
from opl.program.statements import NUMBER

WHEEL, PART, LOAD = "opl_wheel", "opl_part", "opl_load"
DECLARATION = re.compile(r"LOCAL PERS (?:tooldata|wobjdata|loaddata) \w+ ?:= ?\[.*\] ?;", re.I)
GRIP = f"GripLoad {LOAD};"
_ASIDE = 2e-4  # a number may differ by so much in [mm], [kg] and parts of a quaternion
_NUMBER = re.compile(NUMBER)


def declarations(settings: ProgramSettings, robot: Robot) -> tuple[str, ...]:
    """Return what the module of a job declares, one data object a line."""
    lines, stationary, load = [], settings.stationary, settings.load
    if stationary is not None:
        wheel = _pose(robot.T_controller_base @ stationary.T_base_tool)
        # without a gripper that is known, as in tool0
        gripper = settings.gripper or Load(0.001, np.array([0.0, 0.0, 1e-6]))
        weight = _load(gripper.mass, gripper.p_flange)
        part = _pose(stationary.T_flange_part)
        lines = [
            f"LOCAL PERS tooldata {WHEEL} := [FALSE,{wheel},{weight}];",
            f'LOCAL PERS wobjdata {PART} := [TRUE,TRUE,"",{part},[[0,0,0],[1,0,0,0]]];',
        ]
    if load is not None:
        T_flange_seen = settings.T_flange_tool if stationary is None else stationary.T_flange_part
        centre = transform(inverse(T_flange_seen), load.p_flange[None])[0]
        lines.append(f"LOCAL PERS loaddata {LOAD} := {_load(load.mass, centre)};")
    return tuple(lines)


def declaration_faults(
    found: Sequence[tuple[str, str]], settings: ProgramSettings, robot: Robot
) -> Iterator[tuple[str, str]]:
    """Give what a module declares that its job does not, and what is missing.

    Args:
        found: Place and text of each declaration.
        settings: Of the job.
        robot: Whose program.

    Yields:
        Place and message.
    """
    wanted = {_name(line): line for line in declarations(settings, robot)}
    for place, line in found:
        own = wanted.pop(_name(line), None)
        if own is None or not _same(line, own):
            yield place, f"{line} is not what the job asks for: {own or 'nothing of that name'}"
    for line in wanted.values():
        yield "module", f"{line} is missing"


def _name(line: str) -> str:
    return line.split(":=")[0].split()[-1].lower()


def _same(one: str, other: str) -> bool:
    """Return whether two declarations differ by digits alone."""
    words = [_NUMBER.sub("#", "".join(line.split())).lower() for line in (one, other)]
    numbers = [np.array([float(text) for text in _NUMBER.findall(line)]) for line in (one, other)]
    return words[0] == words[1] and bool((np.abs(numbers[0] - numbers[1]) <= _ASIDE).all())


def _pose(T: Array) -> str:
    x, y, z = T[:3, 3] * 1e3
    qx, qy, qz, qw = quaternion(T[:3, :3])
    return f"[[{x:.3f},{y:.3f},{z:.3f}],[{qw:.7f},{qx:.7f},{qy:.7f},{qz:.7f}]]"


def _load(mass: float, centre: Array) -> str:
    """Return loaddata of a mass in [kg] without inertia of its own, its centre in [m]."""
    place = ",".join(f"{value + 0.0:.3f}" for value in (centre * 1e3).round(3))
    return f"[{mass:.3f},[{place}],[1,0,0,0],0,0,0]"
