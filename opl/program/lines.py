"""Straight moves of the tool point, made only where they stay near the verified path.

The verification replayed joint moves. A straight move leaves that path in between its ends, where
it is the same; how far is measured at the corners of the box around the held part: no point of the
part moves farther off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from opl.cell.robot import Robot, forward_kinematics
from opl.geometry.frames import inverse, pose, transform
from opl.program.moves import Kind, Program

Array = NDArray[np.float64]

_BETWEEN = np.array([0.25, 0.5, 0.75])


def with_straight_moves(
    program: Program, robot: Robot, T_flange_tool: Array, corners: Array, tolerance: float
) -> Program:
    """Return a program with moves on the wheel and along its normal straight where they may be.

    Args:
        program: Joint moves.
        robot: Whose moves.
        T_flange_tool: The tool whose point runs straight, shape (4, 4).
        corners: Corners of a box around the held part in the flange frame in [m], shape (8, 3).
        tolerance: Farthest that any of them may be from the verified path in [m].
    """
    strays = stray(robot, np.array([move.q for move in program.moves]), T_flange_tool, corners)
    moves = [program.moves[0]] if program.moves else []
    for move, distance in zip(program.moves[1:], strays, strict=True):
        straight = move.kind is not Kind.AIR and bool(distance <= tolerance)
        moves.append(replace(move, straight=straight))
    return replace(program, moves=tuple(moves))


def stray(robot: Robot, q: Array, T_flange_tool: Array, corners: Array) -> Array:
    """Return how far straight moves lead from joint moves between the same postures.

    Args:
        robot: Whose moves.
        q: Postures in [rad], shape (n, 6).
        T_flange_tool: The tool whose point runs straight, shape (4, 4).
        corners: Points that move along, in the flange frame in [m], shape (k, 3).

    Returns:
        The largest distance of a point in each move in [m], shape (n - 1,).
    """
    start, end = q[:-1], q[1:]
    s = _BETWEEN[:, None, None]
    Ts_joint = forward_kinematics(robot, start + s * (end - start))
    Ts_straight = _straight(
        forward_kinematics(robot, start) @ T_flange_tool,
        forward_kinematics(robot, end) @ T_flange_tool,
    ) @ inverse(T_flange_tool)
    apart = transform(Ts_joint[..., None, :, :], corners) - transform(
        Ts_straight[..., None, :, :], corners
    )
    return np.linalg.norm(apart, axis=-1).max(axis=(0, 2))


def _straight(Ts_start: Array, Ts_end: Array) -> Array:
    """Return poses between two, origin on a line and turned about one axis, shape (3, n, 4, 4)."""
    first = Rotation.from_matrix(Ts_start[:, :3, :3])
    turn = (first.inv() * Rotation.from_matrix(Ts_end[:, :3, :3])).as_rotvec()
    p_start, p_end = Ts_start[:, :3, 3], Ts_end[:, :3, 3]
    return np.stack(
        [
            pose(
                (first * Rotation.from_rotvec(s * turn)).as_matrix(),
                p_start + s * (p_end - p_start),
            )
            for s in _BETWEEN
        ]
    )
