"""Positions, move words and speeds of an INFORM job, as written."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.geometry.frames import Array, inverse, rotation_angle
from opl.program.controller import ControllerProfile
from opl.program.inform.cartesian import frame_pose, rconf_of, rectan, require_read_back
from opl.program.moves import Program
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
    q = np.array([move.q for move in program.moves]).reshape(-1, 6)
    scale = PulseScale.of(robot)
    if scale.complete or settings.positions is PositionForm.PULSES:
        pulses = scale.to_pulses(q)  # checks the soft limits, however positions are written
    if settings.positions is PositionForm.PULSES:
        texts = tuple(",".join(map(str, row)) for row in pulses.tolist())
        return WrittenPositions(texts, (None,) * len(q), scale.to_angles(pulses))
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
    kinds, ways, times, ranges, chained = [], [], [], [], []
    before = program.moves[0]
    for move, *figures in zip(program.moves[1:], percent, lengths, turns, strict=True):
        duration = move.duration if move.duration is not None else _UNTIMED
        kind = _speed_kind(move.straight, duration, figures[1], figures[2], profile)
        kinds.append(kind)
        ways.append(dict(zip(_RANGES, figures, strict=True))[kind])
        times.append(duration)
        ranges.append(_range(kind, profile))
        chained.append(move.ground_pass is not None and move.ground_pass == before.ground_pass)
        before = move
    speeds = speeds_keeping_time(ways, times, ranges, chained)
    told = [("VJ", "")] + [
        (kind, allowed.text(speed))
        for kind, allowed, speed in zip(kinds, ranges, speeds, strict=True)
    ]
    for k, move in enumerate(program.moves):
        if move.duration is None:
            told[k] = ("VJ", profile.joint_speed.text(100.0 * move.speed))
    return [("MOVJ" if kind == "VJ" else "MOVL", f"{kind}={text}") for kind, text in told]


_RANGES = ("VJ", "V", "VR")


def _range(kind: str, profile: ControllerProfile) -> SpeedRange:
    ranges = (profile.joint_speed, profile.linear_speed, profile.angular_speed)
    return dict(zip(_RANGES, ranges, strict=True))[kind]


def _speed_kind(
    straight: bool, time: float, length: float, turn: float, profile: ControllerProfile
) -> str:
    """Choose V for a straight move, VR where the tool point hardly moves, VJ where neither does."""
    if straight and time > 0.0:
        for kind, way in (("V", length), ("VR", turn)):
            allowed = _range(kind, profile)
            fine = _FINE_ENOUGH * 10.0**-allowed.decimals
            if fine <= way / time <= allowed.highest:
                return kind
    return "VJ"
