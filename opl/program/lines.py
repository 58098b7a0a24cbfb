"""Straight moves of the tool point: where they may be made, and through which configurations.

The verification replayed joint moves. A straight move leaves that path in between its ends, where
it is the same; how far is measured at the corners of the box around the held part: no point of the
part moves farther off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import Robot, forward_kinematics
from opl.geometry.frames import Array, rotation_angle, transform
from opl.geometry.rotations import straight_between
from opl.program.led import Led
from opl.program.moves import Program, Purpose

_BETWEEN = np.array([0.25, 0.5, 0.75])
LINE_STEP = 1e-3  # [m] of the tool point between configurations on a line
LINE_TURN = np.deg2rad(0.5)  # of the hand and of any joint between them
# Farthest that the end of a line may be from the configuration it is written with in [rad]: poses
# have few digits. A line that ends on another ik_branch is off by far more.
_SAME_END = np.deg2rad(0.5)
_FURTHEST_TURN = np.deg2rad(20.0)  # of a joint from one to the next on a line: beyond, it flips


def with_straight_moves(
    program: Program, robot: Robot, led: Led, corners: Array, tolerance: float
) -> Program:
    """Return a program with moves on the wheel and along its normal straight where they may be.

    Args:
        program: Joint moves.
        robot: Whose moves.
        led: What runs straight.
        corners: Corners of a box around the held part in the flange frame in [m], shape (8, 3).
        tolerance: Farthest that any of them may be from the verified path in [m].
    """
    strays = stray(robot, np.array([move.q for move in program.moves]), led, corners)
    moves = [program.moves[0]] if program.moves else []
    for move, distance in zip(program.moves[1:], strays, strict=True):
        straight = move.kind is not Purpose.AIR and bool(distance <= tolerance)
        moves.append(replace(move, straight=straight))
    return replace(program, moves=tuple(moves))


def stray(robot: Robot, q: Array, led: Led, corners: Array) -> Array:
    """Return how far straight moves lead from joint moves between the same configurations.

    Args:
        robot: Whose moves.
        q: Configurations in [rad], shape (n, 6).
        led: What runs straight.
        corners: Points that move along, in the flange frame in [m], shape (k, 3).

    Returns:
        The largest distance of a point in each move in [m], shape (n - 1,).
    """
    start, end = q[:-1], q[1:]
    s = _BETWEEN[:, None, None]
    Ts_joint = forward_kinematics(robot, start + s * (end - start))
    Ts_start, Ts_end = (led.frames(forward_kinematics(robot, one)) for one in (start, end))
    Ts_straight = led.flanges(
        np.stack([straight_between(Ts_start, Ts_end, np.full(len(start), s)) for s in _BETWEEN])
    )
    apart = transform(Ts_joint[..., None, :, :], corners) - transform(
        Ts_straight[..., None, :, :], corners
    )
    return np.asarray(np.linalg.norm(apart, axis=-1).max(axis=(0, 2)))


def straight_configurations(robot: Robot, start: Array, end: Array, led: Led) -> Array | None:
    """Return the configurations of a straight move after its start, the last of them its end.

    Args:
        robot: Whose move.
        start: Joint positions in [rad], shape (6,).
        end: As start.
        led: What runs straight.

    Returns:
        Joint positions in [rad], shape (k, 6); None if the line leaves the reach, passes through a
        singularity, or ends in another configuration.
    """
    T_start, T_end = led.frames(forward_kinematics(robot, np.stack([start, end])))
    longest = max(
        np.linalg.norm(T_end[:3, 3] - T_start[:3, 3]) / LINE_STEP,
        float(rotation_angle(T_start, T_end)) / LINE_TURN,
        np.abs(end - start).max() / LINE_TURN,
        1.0,
    )
    s = np.arange(1, int(np.ceil(longest)) + 1) / np.ceil(longest)
    Ts_base_flange = led.flanges(straight_between(T_start, T_end, s))
    guess = start + s[:, None] * (end - start)
    slots = inverse_kinematics(robot.arm, Ts_base_flange, guess)
    found, q = [], start
    for candidates in slots:
        turned = nearest_turn(candidates, q)
        apart = np.abs(turned - q).max(axis=1)
        if np.isnan(apart).all() or np.nanmin(apart) > _FURTHEST_TURN:
            return None
        q = turned[int(np.nanargmin(apart))]
        found.append(q)
    if np.abs(found[-1] - end).max() > _SAME_END:
        return None
    found[-1] = end
    return np.array(found)
