"""What a controller does with written job files: the postures it visits, and when.

A joint move (MOVJ) turns all joints in step. A straight move (MOVL) leads the point of the tool
along a line and turns the hand about one axis; here it becomes postures so near to each other that
turning the joints in step between them is the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from opl.cell.full_turns import nearest_turn
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import Robot, forward_kinematics
from opl.errors import InputError
from opl.findings import Finding, Level
from opl.geometry.frames import inverse, pose, rotation_angle
from opl.program.inform.job import InformJob
from opl.program.inform.sequence import Visit, first_job, visits
from opl.program.inform.times import job_postures
from opl.program.settings import ProgramSettings

Array = NDArray[np.float64]

LINE_STEP = 1e-3  # [m] of the tool point between postures on a line
LINE_TURN = np.deg2rad(0.5)  # of the hand and of any joint between them
# Farthest that the end of a line may be from the posture it is written with in [rad]: RECTAN values
# have few digits. A line that ends on another branch is off by far more.
_SAME_POSTURE = np.deg2rad(0.5)
_FURTHEST_TURN = np.deg2rad(20.0)  # of a joint between two postures on a line: beyond, it flips


@dataclass(frozen=True, eq=False)
class Playback:
    """Postures in the order they are visited, joined by linear joint interpolation.

    Attributes:
        q: Joint positions in [rad], shape (n, 6).
        duration: Time of the move that ends at each posture at the written speed, ramps left out,
            in [s], shape (n,); 0 for the first, which is reached from wherever the robot stands.
        stations: Indices of the postures that are written, in order; the others lie on lines
            between them, shape (m,).
        visits: The move to each of these, m items.
    """

    q: Array
    duration: Array
    stations: NDArray[np.intp]
    visits: tuple[Visit, ...]


def play(
    jobs: Mapping[str, InformJob],
    robot: Robot,
    settings: ProgramSettings,
) -> tuple[Playback | None, list[Finding]]:
    """Return what a controller does with jobs, and what cannot be told; None if nothing can.

    Args:
        jobs: All jobs of a program by name.
        robot: Whose program.
        settings: Tool, user frame, and which jobs of the user's own may be called.

    Raises:
        InputError: If the jobs are not those of one program, or of another robot.
    """
    order, found = visits(jobs, first_job(jobs), settings.actions.calls)
    postures = {}
    for name, job in jobs.items():
        _require_robot(job, robot)
        postures[name] = _postures(job, robot, settings)
    for visit in order:
        if np.isnan(postures[visit.job.name][visit.position]).any():
            found.append(_fault(visit, "no single posture within the limits belongs to it"))
        if visit.step.word == "MOVL" and _tool(visit) != settings.tool:
            told = f"moves tool {_tool(visit)} straight; the job knows tool {settings.tool} only"
            found.append(_fault(visit, told))
    if found or not order:
        nothing = Finding(Level.ERROR, "program", "program", "moves nothing")
        return None, found or [nothing]
    q = np.array([postures[visit.job.name][visit.position] for visit in order])
    return _played(order, q, robot, settings.T_flange_tool)


def _played(
    order: list[Visit], q: Array, robot: Robot, T_flange_tool: Array
) -> tuple[Playback | None, list[Finding]]:
    Ts_base_tool = forward_kinematics(robot, q) @ T_flange_tool
    way = np.linalg.norm(np.diff(Ts_base_tool[:, :3, 3], axis=0), axis=1)
    turn = rotation_angle(Ts_base_tool[:-1], Ts_base_tool[1:])
    at_top_speed = (np.abs(np.diff(q, axis=0)) / robot.max_speed).max(axis=1)
    legs, times, found = [q[:1]], [np.zeros(1)], []
    for k, visit in enumerate(order[1:]):
        leg: Array | None = q[k + 1][None]
        if visit.step.word == "MOVL":
            leg = line(robot, q[k], q[k + 1], T_flange_tool)
            if leg is None:
                told = "the straight move does not lead to the posture that is written"
                found.append(_fault(visit, told))
                leg = q[k + 1][None]
        needed = {"VJ": 100.0 * at_top_speed[k], "V": 1e3 * way[k], "VR": np.rad2deg(turn[k])}
        tag = next(name for name, _ in visit.step.tags if name in needed)
        time = needed[tag] / float(visit.step.tag(tag) or "nan")
        assert leg is not None
        legs.append(leg)
        times.append(np.full(len(leg), time / len(leg)))
    if found:
        return None, found
    ends = np.cumsum([len(leg) for leg in legs]) - 1
    return Playback(np.concatenate(legs), np.concatenate(times), ends, tuple(order)), []


def line(robot: Robot, start: Array, end: Array, T_flange_tool: Array) -> Array | None:
    """Return the postures of a straight move after its start, the last of them its end.

    Args:
        robot: Whose move.
        start: Joint positions in [rad], shape (6,).
        end: As start.
        T_flange_tool: The tool whose point runs straight, shape (4, 4).

    Returns:
        Joint positions in [rad], shape (k, 6); None if the line leaves the reach, passes through a
        singularity, or ends in another posture.
    """
    T_start, T_end = forward_kinematics(robot, np.stack([start, end])) @ T_flange_tool
    first = Rotation.from_matrix(T_start[:3, :3])
    turn = (first.inv() * Rotation.from_matrix(T_end[:3, :3])).as_rotvec()
    way = T_end[:3, 3] - T_start[:3, 3]
    longest = max(
        np.linalg.norm(way) / LINE_STEP,
        np.linalg.norm(turn) / LINE_TURN,
        np.abs(end - start).max() / LINE_TURN,
        1.0,
    )
    s = np.arange(1, int(np.ceil(longest)) + 1)[:, None] / np.ceil(longest)
    Ts_base_tool = pose(
        (first * Rotation.from_rotvec(s * turn)).as_matrix(), T_start[:3, 3] + s * way
    )
    guess = start + s * (end - start)
    slots = inverse_kinematics(robot.arm, Ts_base_tool @ inverse(T_flange_tool), guess)
    found, q = [], start
    for candidates in slots:
        turned = nearest_turn(candidates, q)
        apart = np.abs(turned - q).max(axis=1)
        if np.isnan(apart).all() or np.nanmin(apart) > _FURTHEST_TURN:
            return None
        q = turned[int(np.nanargmin(apart))]
        found.append(q)
    if np.abs(found[-1] - end).max() > _SAME_POSTURE:
        return None
    found[-1] = end
    return np.array(found)


def _postures(job: InformJob, robot: Robot, settings: ProgramSettings) -> Array:
    """Return the posture of each position, NaN where the file or the job leave it open."""
    q = job_postures(job, robot, np.eye(4), settings.T_flange_tool)
    frame = settings.user_frame
    in_frame = None
    for k, position in enumerate(job.positions):
        if position.coordinates == "PULSE":
            continue
        if position.frame == "USER" and frame is not None and position.user == frame.number:
            if in_frame is None:
                in_frame = job_postures(job, robot, frame.T_base_user, settings.T_flange_tool)
            q[k] = in_frame[k]
        elif position.frame not in ("BASE", "ROBOT"):
            q[k] = np.nan
        if position.tool != settings.tool:
            q[k] = np.nan
    return q


def _require_robot(job: InformJob, robot: Robot) -> None:
    """Refuse jobs that can only be those of another robot."""
    groups = [h.value for h in job.headers if h.key.startswith("///GROUP")]
    if groups not in ([], ["RB1"]):
        raise InputError(job.name, f"moves {', '.join(groups)}; opl knows programs of RB1 alone")
    for position in job.positions:
        if position.kind == "C" and len(position.values) != len(robot.joint_names):
            raise InputError(
                f"{job.name} line {position.line}",
                f"{len(position.values)} values; {robot.title} has {len(robot.joint_names)} joints",
            )


def _tool(visit: Visit) -> int | None:
    return visit.job.positions[visit.position].tool


def _fault(visit: Visit, told: str) -> Finding:
    label = visit.job.positions[visit.position].label
    return Finding(Level.ERROR, "program", f"{visit.place}, {label}", told)
