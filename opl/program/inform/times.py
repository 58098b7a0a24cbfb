"""How long the moves of a written job take: its own positions and speeds, read back."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array, inverse
from opl.program.inform.cartesian import configurations, rectan_pose
from opl.program.inform.job import ROBOT_KINDS, InformJob, Instruction
from opl.program.led import HandTool
from opl.program.played import SpeedUnit, WrittenSpeed, move_time
from opl.program.pulses import PulseScale

# What the number of each speed is multiplied by to be in SI, and its decimals.
_UNITS = {
    "VJ": (SpeedUnit.TOP_SPEED, 1e-2, 2),
    "V": (SpeedUnit.TOOL_POINT, 1e-3, 1),
    "VR": (SpeedUnit.HAND, float(np.deg2rad(1.0)), 1),
}


def job_configurations(
    job: InformJob, robot: Robot, T_base_frame: Array, T_flange_tool: Array
) -> Array:
    """Return the joint positions of the robot's own positions of a job in [rad], shape (n, 6).

    NaN stands for a position that no configuration within the limits, or more than one, belongs to.
    """
    scale = PulseScale.of(robot)
    q = np.full((len(job.positions), 6), np.nan)
    for k, position in enumerate(job.positions):
        if position.kind not in ROBOT_KINDS or len(position.values) < 6:
            continue
        if position.coordinates == "PULSE" and len(position.values) == 6:
            q[k] = scale.to_angles(np.array(position.values[:6]))
        elif position.coordinates == "RECTAN" and len(position.rconf) >= 6:
            T_base_flange = T_base_frame @ rectan_pose(position.values) @ inverse(T_flange_tool)
            found = configurations(robot, T_base_flange, position.rconf)
            if len(found) == 1:
                q[k] = found[0]
    return q


def written_speed(move: Instruction) -> WrittenSpeed:
    """Return the one speed of a move, VJ, V or VR."""
    tag, value = next((name, value) for name, value in move.tags if name in _UNITS)
    unit, factor, decimals = _UNITS[tag]
    return WrittenSpeed.of_number(unit, factor, value, decimals, f"{tag}={value}")


def move_times(job: InformJob, robot: Robot, T_base_frame: Array, T_flange_tool: Array) -> Array:
    """Return the time of each move at its written speed in [s], ramps left out; NaN for the first.

    Args:
        job: A job whose moves use its positions in order, one each.
        robot: Whose job.
        T_base_frame: The frame of its Cartesian positions.
        T_flange_tool: Its tool.
    """
    q = job_configurations(job, robot, T_base_frame, T_flange_tool)
    times = [
        move_time(written_speed(move), start, end, robot, HandTool(T_flange_tool))
        for move, (start, end) in zip(job.moves[1:], pairwise(q), strict=True)
    ]
    return np.array([np.nan, *times][: len(q)])
