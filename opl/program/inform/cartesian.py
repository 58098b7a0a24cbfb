"""Cartesian positions of INFORM jobs: RECTAN values and RCONF, written and read.

RCONF names one of the eight configurations of a pose: flip or not, upper or lower arm, front or
rear, and whether R, T and S stand beyond half a turn. Flip is the configuration with B not
negative, as jobs saved by controllers show.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from opl.cell.full_turns import FULL_TURN, angular_distance
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import Robot, forward_kinematics
from opl.errors import UnsafeError
from opl.geometry.frames import Array, from_roll_pitch_yaw, inverse, roll_pitch_yaw
from opl.program.controller import ControllerProfile
from opl.program.digits import fixed
from opl.program.settings import PositionForm, ProgramSettings

# In the order of RCONF, the joints whose half turn it names.
_HALF_TURN_JOINTS = (3, 5, 0)  # R, T, S
# Farthest from the planned configuration [rad] that one read back may be. Rounding a pose moves the
# configurations by far less, except next to a singularity, where the controller would be as lost.
_SAME_CONFIGURATION = np.deg2rad(1.0)
# At half a turn exactly, controllers differ on which side they see a joint. What is that near is
# written a little beside it.
_HALF_TURN_WIDTH = np.deg2rad(0.01)
_BESIDE = 1.5 * _HALF_TURN_WIDTH


def nameable(q: Array, robot: Robot, margin: float) -> NDArray[np.bool_]:
    """Return which configurations a Cartesian position names without doubt, shape (...,).

    RCONF tells whether a joint is beyond half a turn, not in which sense, and next to half a turn
    it is anybody's guess.

    Args:
        q: Joint positions in [rad], shape (..., 6).
        robot: Whose positions.
        margin: How far in [rad] from half a turn a joint has to be.
    """
    named = np.ones(q.shape[:-1], dtype=bool)
    for joint in _HALF_TURN_JOINTS:
        angle = q[..., joint]
        named &= np.abs(np.abs(angle) - np.pi) >= margin
        other = np.remainder(angle + np.pi, FULL_TURN) - np.pi - np.sign(angle) * FULL_TURN
        in_reach = (other >= robot.lower[joint]) & (other <= robot.upper[joint])
        named &= ~((np.abs(angle) > np.pi) & in_reach)
    return named


def beside_half_turns(
    q: Array, robot: Robot, width: float = _HALF_TURN_WIDTH, beside: float = _BESIDE
) -> Array:
    """Return configurations with no joint so near to half a turn that its side is in doubt.

    Args:
        q: Joint positions in [rad], shape (n, 6).
        robot: Whose positions.
        width: How near in [rad] is too near.
        beside: How far away in [rad] such a joint is put: to the side where it is, or below half a
            turn where it stands there exactly or the limits leave no other room.
    """
    q = np.array(q)
    for joint in _HALF_TURN_JOINTS:
        angle = q[:, joint]
        near = np.abs(np.abs(angle) - np.pi) < width
        outside = np.copysign(np.pi + beside, angle)
        fits = (outside >= robot.lower[joint]) & (outside <= robot.upper[joint])
        inside = np.copysign(np.pi - beside, angle)
        moved = np.where((np.abs(angle) > np.pi) & fits, outside, inside)
        q[:, joint] = np.where(near, moved, angle)
    return q


def frame_pose(settings: ProgramSettings) -> Array:
    """Return the frame positions are written in, T_base_frame, shape (4, 4)."""
    if settings.positions is PositionForm.USER and settings.user_frame is not None:
        return settings.user_frame.T_base_user
    return np.eye(4)  # BASE and ROBOT are one without a track


def rectan(Ts_frame_tool: Array, profile: ControllerProfile) -> list[str]:
    """Return x, y, z in [mm] and rx, ry, rz in [deg] of poses, as written."""
    lengths = Ts_frame_tool[:, :3, 3] * 1e3
    angles = np.rad2deg(roll_pitch_yaw(Ts_frame_tool))
    return [
        ",".join(
            [fixed(float(value), profile.length_decimals) for value in length]
            + [fixed(float(value), profile.angle_decimals) for value in angle]
        )
        for length, angle in zip(lengths, angles, strict=True)
    ]


def rectan_pose(values: tuple[float, ...]) -> Array:
    """Return the pose of RECTAN values, T_frame_tool, shape (4, 4)."""
    return from_roll_pitch_yaw(np.deg2rad(values[3:6]), np.array(values[:3]) * 1e-3)


def rconf_of(robot: Robot, q: Array) -> tuple[int, ...]:
    """Return the six meaningful numbers of RCONF for a configuration, shape (6,)."""
    slots = inverse_kinematics(robot.arm, forward_kinematics(robot, q), q)
    apart = angular_distance(slots, q).max(axis=-1)
    slot = int(np.nanargmin(apart))
    flip, back, elbow = slot // 4, slot // 2 % 2, slot % 2
    beyond = (int(abs(q[joint]) > np.pi) for joint in _HALF_TURN_JOINTS)
    return (1 - flip, int(elbow != back), back, *beyond)


def configurations(
    robot: Robot, T_base_flange: Array, numbers: tuple[int, ...], near: Array | None = None
) -> Array:
    """Return the configurations within the limits that a pose and RCONF name.

    Args:
        robot: Whose configurations.
        T_base_flange: The pose, shape (4, 4).
        numbers: Of RCONF, six or more.
        near: Joint positions in [rad] that fix axis 4 where the wrist is straight.

    Returns:
        Joint positions in [rad], shape (k, 6): one, none out of reach, more where only a full turn
        beyond half a turn is left open.
    """
    if not set(numbers[:6]) <= {0, 1}:
        return np.empty((0, 6))
    no_flip, lower, back, *beyond = numbers[:6]
    slot = 4 * (1 - no_flip) + 2 * back + int(lower != back)
    q = inverse_kinematics(robot.arm, T_base_flange, near)[slot]
    if np.isnan(q).any():
        return np.empty((0, 6))
    found = [q]
    for joint, is_beyond in zip(_HALF_TURN_JOINTS, beyond, strict=True):
        turns = FULL_TURN * np.array([-1.0, 1.0]) if is_beyond else np.zeros(1)
        found = [p + turn * np.eye(6)[joint] for p in found for turn in turns]
    stack = np.array(found)
    slack = 1e-6  # a configuration at its limit, rounded
    inside = ((stack >= robot.lower - slack) & (stack <= robot.upper + slack)).all(axis=1)
    return stack[inside]


def require_read_back(robot: Robot, q: Array, values: str, numbers: tuple[int, ...],
                      T_base_frame: Array, T_flange_tool: Array) -> Array:  # fmt: skip
    """Return the configuration that a written position names; it must be the planned one.

    Raises:
        UnsafeError: If the controller would take another configuration, or could.
    """
    T_frame_tool = rectan_pose(tuple(float(value) for value in values.split(",")))
    T_base_flange = T_base_frame @ T_frame_tool @ inverse(T_flange_tool)
    found = configurations(robot, T_base_flange, numbers, q)
    for other in found:
        apart = np.abs(other - q)
        if apart.max() > _SAME_CONFIGURATION:
            joint = int(apart.argmax())
            raise _ambiguous(robot, q, joint, f"{np.rad2deg(other[joint]):.1f} deg")
    if not len(found):
        raise _ambiguous(robot, q, 4, "a configuration out of reach")
    configuration: Array = found[0]
    return configuration


def _ambiguous(robot: Robot, q: Array, joint: int, other: str) -> UnsafeError:
    shown = " ".join(f"{angle:.2f}" for angle in np.rad2deg(q))
    return UnsafeError(
        f"configuration {shown} deg: a Cartesian job cannot tell joint {robot.joint_names[joint]} "
        f"from {other}; move it away from there or write pulses"
    )
