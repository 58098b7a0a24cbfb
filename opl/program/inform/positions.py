"""Positions, move words and speeds of an INFORM job, as its digits can express them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.geometry.frames import Array, inverse, rotation_angle
from opl.program.controller import ControllerProfile
from opl.program.inform.cartesian import (
    beside_half_turns,
    frame_pose,
    rconf_of,
    rectan,
    require_read_back,
)
from opl.program.moves import Move, Program
from opl.program.pulses import PulseScale
from opl.program.settings import PositionForm, ProgramSettings
from opl.program.speeds import SpeedRange, speeds_keeping_time

# Below so many last digits V is too coarse for a move in which the tool point hardly moves.
_FINE_ENOUGH = 10.0
_UNTIMED = 0.0  # stands for the time of a move whose speed alone is set


@dataclass(frozen=True)
class WrittenPositions:
    """Positions of a job as texts, and where they lead.

    Attributes:
        values: Of each position.
        rconfs: The numbers of RCONF, one text a position; none for pulses.
        q: Joint positions that the texts stand for in [rad], shape (n, 6).
    """

    values: tuple[str, ...]
    rconfs: tuple[str | None, ...]
    q: Array


def write_positions(
    program: Program, robot: Robot, settings: ProgramSettings, profile: ControllerProfile
) -> WrittenPositions:
    """Write the positions of a program.

    Raises:
        UnsafeError: If one is beyond the soft limits, or RCONF does not name its configuration.
    """
    q, scale = program.q, PulseScale.of(robot)
    if scale.complete or settings.positions is PositionForm.PULSES:
        pulses = scale.to_pulses(q)  # checks the soft limits, however positions are written
    if settings.positions is PositionForm.PULSES:
        texts = tuple(",".join(map(str, row)) for row in pulses.tolist())
        return WrittenPositions(texts, (None,) * len(q), scale.to_angles(pulses))
    q = beside_half_turns(q, robot)
    T_base_frame, T_flange_tool = frame_pose(settings), settings.T_flange_tool
    values = rectan(inverse(T_base_frame) @ forward_kinematics(robot, q) @ T_flange_tool, profile)
    numbers = [rconf_of(robot, configuration) for configuration in q]
    read_back = [
        require_read_back(robot, configuration, value, number, T_base_frame, T_flange_tool)
        for configuration, value, number in zip(q, values, numbers, strict=True)
    ]
    unused = (0,) * (profile.rconf_fields - 6)
    written = (",".join(map(str, (*number, *unused))) for number in numbers)
    return WrittenPositions(tuple(values), tuple(written), np.array(read_back).reshape(-1, 6))


def rounded_to_job(
    q: Array, robot: Robot, settings: ProgramSettings, profile: ControllerProfile
) -> Array:
    """Return the configurations nearest to some that a job can express, shape (n, 6) in [rad].

    Pulses are whole, poses have few digits. A joint at its limit is rounded inwards. In Cartesian
    positions, joints that stand at half a turn are moved beside it.

    Raises:
        UnsafeError: If one is beyond the limits, or no Cartesian position names it.
    """
    if settings.positions is PositionForm.PULSES:
        scale = PulseScale.of(robot)
        return scale.to_angles(scale.to_pulses(q, inwards=True))
    moves = tuple(
        Move(p, 1.0, exact_stop=True, on_wheel=False, motion_index=k) for k, p in enumerate(q)
    )
    return write_positions(Program("ROUNDED", moves=moves), robot, settings, profile).q


def write_speeds(
    program: Program, q: Array, robot: Robot, T_flange_tool: Array, profile: ControllerProfile
) -> list[tuple[str, str]]:
    """Return word and speed of each move, e.g. ``("MOVJ", "VJ=5.00")``.

    Args:
        program: The moves.
        q: Where they lead as written, shape (n, 6).
        robot: Whose moves.
        T_flange_tool: The tool whose point V speaks of, shape (4, 4).
        profile: The controller.
    """
    if not program.moves:
        return []
    Ts_base_tool = forward_kinematics(robot, q) @ T_flange_tool
    percent = 100.0 * (np.abs(np.diff(q, axis=0)) / robot.max_speed).max(axis=1)
    lengths = np.linalg.norm(np.diff(Ts_base_tool[:, :3, 3], axis=0), axis=1) * 1e3
    turns = np.rad2deg(rotation_angle(Ts_base_tool[:-1], Ts_base_tool[1:]))
    ranges = _ranges(profile)
    kinds, distances, times = [], [], []
    for move, *figures in zip(program.moves[1:], percent, lengths, turns, strict=True):
        duration = move.duration if move.duration is not None else _UNTIMED
        by_kind = dict(zip(ranges, figures, strict=True))
        kinds.append(_speed_kind(move.straight, duration, by_kind, ranges))
        distances.append(by_kind[kinds[-1]])
        times.append(duration)
    allowed = [ranges[kind] for kind in kinds]
    speeds = speeds_keeping_time(distances, times, allowed, program.chained)
    texts = [one.text(speed) for one, speed in zip(allowed, speeds, strict=True)]
    found = list(zip(["VJ", *kinds], ["", *texts], strict=True))
    for k, move in enumerate(program.moves):
        if move.duration is None:
            found[k] = ("VJ", profile.joint_speed.text(100.0 * move.speed))
    return [("MOVJ" if kind == "VJ" else "MOVL", f"{kind}={text}") for kind, text in found]


def _ranges(profile: ControllerProfile) -> dict[str, SpeedRange]:
    return {"VJ": profile.joint_speed, "V": profile.linear_speed, "VR": profile.angular_speed}


def _speed_kind(
    straight: bool, time: float, distances: Mapping[str, float], ranges: Mapping[str, SpeedRange]
) -> str:
    """Choose V for a straight move, VR where the tool point hardly moves, VJ where neither does."""
    if straight and time > 0.0:
        for kind in ("V", "VR"):
            fine = _FINE_ENOUGH * 10.0 ** -ranges[kind].decimals
            if fine <= distances[kind] / time <= ranges[kind].highest:
                return kind
    return "VJ"
