"""How long the moves of a written job take: its own positions and speeds, read back."""

from __future__ import annotations

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.geometry.frames import Array, inverse, rotation_angle
from opl.program.inform.cartesian import configurations, pose_of
from opl.program.inform.job import InformJob
from opl.program.pulses import PulseScale


def job_configurations(
    job: InformJob, robot: Robot, T_base_frame: Array, T_flange_tool: Array
) -> Array:
    """Return the joint positions of the taught positions of a job in [rad], shape (n, 6).

    NaN stands for a position that no configuration within the limits, or more than one, belongs to.

    Args:
        job: The job.
        robot: Whose job.
        T_base_frame: The frame of its Cartesian positions.
        T_flange_tool: Its tool.
    """
    scale = PulseScale.of(robot)
    q = np.full((len(job.positions), 6), np.nan)
    for k, position in enumerate(job.positions):
        if position.kind != "C" or len(position.values) < 6:
            continue
        if position.coordinates == "PULSE":
            q[k] = scale.to_angles(np.array(position.values[:6]))
        elif position.coordinates == "RECTAN" and len(position.rconf) >= 6:
            T_base_flange = T_base_frame @ pose_of(position.values) @ inverse(T_flange_tool)
            found = configurations(robot, T_base_flange, position.rconf)
            if len(found) == 1:
                q[k] = found[0]
    return q


def move_times(job: InformJob, robot: Robot, T_base_frame: Array, T_flange_tool: Array) -> Array:
    """Return the time of each move at its written speed in [s], ramps left out; NaN for the first.

    Args:
        job: A job whose moves use its positions in order, one each.
        robot: Whose job.
        T_base_frame: The frame of its Cartesian positions.
        T_flange_tool: Its tool.
    """
    q = job_configurations(job, robot, T_base_frame, T_flange_tool)
    Ts_base_tool = forward_kinematics(robot, q) @ T_flange_tool
    times = np.full(len(q), np.nan)
    for k, move in enumerate(job.moves[1:], start=1):
        if percent := move.tag("VJ"):
            at_top_speed = (np.abs(q[k] - q[k - 1]) / robot.max_speed).max()
            times[k] = at_top_speed * 100.0 / float(percent)
        elif mm_per_second := move.tag("V"):
            way = np.linalg.norm(Ts_base_tool[k, :3, 3] - Ts_base_tool[k - 1, :3, 3])
            times[k] = way * 1e3 / float(mm_per_second)
        elif degrees_per_second := move.tag("VR"):
            turn = rotation_angle(Ts_base_tool[k - 1], Ts_base_tool[k])
            times[k] = np.rad2deg(turn) / float(degrees_per_second)
    return times
