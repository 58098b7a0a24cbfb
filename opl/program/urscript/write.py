"""Writing UR scripts: joint positions in [rad], each move with its time."""

from __future__ import annotations

import re
from datetime import datetime

import numpy as np

from opl.cell.robot import Robot, controller_poses
from opl.files import resources
from opl.geometry.frames import Array
from opl.geometry.rotations import rotation_vector
from opl.program import dialect
from opl.program.dialect import ActionTexts, Dialect, rounded_times
from opl.program.digits import fixed
from opl.program.loads import carried
from opl.program.moves import Program
from opl.program.posts import Written
from opl.program.settings import ProgramSettings
from opl.program.urscript.read import DECIMALS, LARGEST_BLEND, tool_text

DIALECT = Dialect(
    maker="URScript",
    suffix=".script",
    template=resources.folder("templates") / "urscript" / "program.script.j2",
    name=re.compile(r"[A-Z][A-Z0-9_]{0,49}"),
    name_rule="a letter and up to 49 letters, digits or _",
    comment_length=80,
    motion=re.compile(r"^(?:move[jlpc]|servo[jc]|speed[jl])\("),
    line_end="\n",
    actions=ActionTexts(
        states=("False", "True"),
        output="set_standard_digital_out({number}, {state})",
        dwell="sleep({seconds:.2f})",
        wait=("while get_standard_digital_in({number}) != {state}:", "sync()", "end"),
        timed_wait=(
            "waited = 0.0",
            "while get_standard_digital_in({number}) != {state}:",
            "sleep(0.01)",
            "waited = waited + 0.01",
            "if waited >= {timeout:.2f}:",
            'popup("no signal at input {number}", blocking=True)',
            "waited = 0.0",
            "end",
            "end",
        ),
        call="{name}()",
        remark="# {text}",
    ),
)
VARIABLES = {
    **dialect.VARIABLES,
    "load": "instruction that sets the payload of gripper and part, or none",
}
_BLEND_SHARE = 0.4  # of the shorter neighbouring move: two blends must not overlap
_START_ACCELERATION = 0.3  # [rad/s^2] of the move to the first configuration


def tool_name(settings: ProgramSettings) -> str:
    """Return the pose of a job's tool as a reader names it."""
    return tool_text([float(value) for value in _tool_pose(settings)])


def _tool_pose(settings: ProgramSettings) -> list[str]:
    x, y, z = settings.T_flange_tool[:3, 3]
    turn = rotation_vector(settings.T_flange_tool[:3, :3])
    return [f"{value + 0.0:.6f}" for value in (x, y, z, *turn)]


def write(program: Program, robot: Robot, settings: ProgramSettings, date: datetime) -> Written:
    """Return the program as URScript."""
    times = rounded_times(program.moves, 4, 0.0001)
    Ts_base_tool = controller_poses(robot, program.q) @ settings.T_flange_tool
    blends = _blends(program, Ts_base_tool)
    moves = []
    for move, time, blend in zip(program.moves, times, blends, strict=True):
        target = "[" + ", ".join(fixed(float(a), DECIMALS) for a in move.q) + "]"
        speed = f"t={time:.4f}"
        if np.isnan(time):
            speed = f"a={_START_ACCELERATION}, v={move.speed * robot.max_speed.min():.4f}"
        word = "movel" if move.straight else "movej"
        moves.append((f"{word}({target}, {speed}, r={blend:.5f})", target, speed, float(time)))
    tool = "p[" + ", ".join(_tool_pose(settings)) + "]"
    own = {"load": _load(settings)}
    return DIALECT.write(program, settings, date, tool, moves, lambda steps: own)


def _load(settings: ProgramSettings) -> str | None:
    """Return the instruction that sets mass and centre of what the flange carries, in its frame.

    It is the whole payload (UR, script manual, set_target_payload), so it is not set where the
    gripper is unknown: that of the installation holds then.
    """
    load = carried(settings)
    if load is None:
        return None
    centre = ", ".join(fixed(float(value), 4) for value in load.p_flange)
    return f"set_target_payload({load.mass:.3f}, [{centre}])"


def _blends(program: Program, Ts_base_tool: Array) -> Array:
    """Return the blend radius at the end of each move in [m]."""
    lengths = np.linalg.norm(np.diff(Ts_base_tool[:, :3, 3], axis=0), axis=1)
    before, after = np.r_[0.0, lengths], np.r_[lengths, 0.0]
    room = np.minimum(_BLEND_SHARE * np.minimum(before, after), LARGEST_BLEND)
    stops = np.array([move.exact_stop for move in program.moves], dtype=bool)
    return np.where(stops, 0.0, room)
