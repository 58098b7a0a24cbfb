"""From the joint axes of a URDF to the closed form of its arm.

All is read off the zero configuration, where every axis is a line in space. In the drawings of
`opl.cell.spherical_wrist` and `opl.cell.parallel_axes`: axis 1 gives z, axis 2 the side y of the
arm, the line from axis 2 to axis 3 the tilt of the upper arm, axis 4 or the line to it that of the
forearm, axes 5 and 6 the wrist. What a drawing leaves open (the same arm seen from behind, or with
its wrist turned half round) is settled by the zeros nearest to the drawing's own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from opl.cell.full_turns import principal
from opl.cell.inverse_kinematics import Arm
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.robot import N_JOINTS
from opl.cell.spherical_wrist import SphericalWristArm
from opl.errors import InputError
from opl.geometry.frames import Array

FLANGE = "tool0"
# URDFs round right angles to five digits or more, which moves axes by hundredths of a millimetre.
_LENGTH = 2e-5  # [m]
_ANGLE = 2e-5  # [rad]


@dataclass(frozen=True, eq=False)
class UrdfArm:
    """An arm as its URDF has it.

    Attributes:
        joint_names: Six, from the base on.
        arm: Closed form; its base frame is the root link of the URDF, on the mounting face.
        lower: Smallest joint positions in [rad], shape (6,).
        upper: Largest joint positions in [rad], shape (6,).
        max_speed: Largest joint speeds in [rad/s], shape (6,); 0 where the URDF gives none.
    """

    joint_names: tuple[str, ...]
    arm: Arm
    lower: Array
    upper: Array
    max_speed: Array


def arm_of_urdf(urdf: Path, source: Path | None = None) -> UrdfArm:
    """Return the closed form of the arm in a URDF, made from ``source`` if that is given.

    Raises:
        InputError: If the file is no URDF of six revolute joints in a row with a link tool0, or the
            arm has another build than the closed forms; names the axes.
    """
    where = str(source or urdf)
    try:
        model = pin.buildModelFromUrdf(str(urdf))
    except ValueError as error:
        raise InputError(where, "is not a URDF of one robot") from error
    names = tuple(model.names)[1:]  # the first is the universe
    in_a_row = list(model.parents)[1:] == list(range(len(names)))
    if len(names) != N_JOINTS or model.nq != N_JOINTS or not in_a_row:
        raise InputError(
            where,
            "must have six revolute joints with limits, one after the other, has "
            f"{' '.join(names) or 'none'}"
            + (", some of them continuous" if model.nq > model.nv else ""),
        )
    if not model.existFrame(FLANGE):
        raise InputError(where, f"lacks the link {FLANGE}: flange face, z out of the flange")
    data = model.createData()
    pin.computeJointJacobians(model, data, np.zeros(N_JOINTS))
    pin.updateFramePlacements(model, data)
    flange = data.oMf[model.getFrameId(FLANGE)].homogeneous
    axes, moments = data.J[3:].T, data.J[:3].T
    if not np.allclose(np.linalg.norm(axes, axis=1), 1.0):
        raise InputError(where, "has a joint that does not turn: all six must be revolute")
    points = np.cross(axes, moments)
    if not _parallel(axes[0], np.array([0.0, 0.0, 1.0])) or np.hypot(*points[0, :2]) > _LENGTH:
        raise InputError(where, "axis 1 must be the z axis of the root link")
    read_off = _parallel_axes if _parallel(axes[1], axes[3]) else _spherical_wrist
    arm = read_off(where, axes, points, flange)
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    return UrdfArm(names, arm, lower.copy(), upper.copy(), model.velocityLimit.copy())


def _spherical_wrist(
    where: str, axes: Array, points: Array, T_root_flange: Array
) -> SphericalWristArm:
    """Return the closed form, from directions of the joint axes and a point [m] on each, (6, 3)."""
    x_tool, z_tool = T_root_flange[:3, 0], T_root_flange[:3, 2]
    z = np.array([0.0, 0.0, 1.0])
    wrist, miss = _meeting(axes[3:], points[3:])
    if miss > _LENGTH:
        raise InputError(
            where,
            f"axes 4, 5 and 6 do not meet in one point, they pass it by {miss * 1e3:.3g} mm: the "
            "wrist is not spherical, nor are axes 2, 3 and 4 parallel; opl has no closed form for "
            "such an arm",
        )
    _require_build(where, axes, parallel=(2,))
    from_wrist = _from_wrist(where, axes, wrist, T_root_flange)
    sign2, x, y = _side(axes)
    theta1 = np.arctan2(x[1], x[0])
    upper_arm = _across(points[2] - points[1], y)
    theta2 = np.arctan2(upper_arm @ x, upper_arm @ z)
    # the wrist centre lies ahead along the forearm
    sign4 = _sign(axes[3] @ (wrist - points[2]))
    forearm = sign4 * axes[3]
    tilt = np.arctan2(forearm @ x, forearm @ z)
    across = np.cross(y, forearm)
    sign5 = _sign(axes[4] @ y if abs(axes[4] @ y) > _ANGLE else -axes[4] @ across)
    y5 = sign5 * axes[4]
    theta4 = np.arctan2(-y5 @ across, y5 @ y)
    x5 = np.cross(y5, forearm)
    theta5 = np.arctan2(z_tool @ x5, z_tool @ forearm)
    x6 = np.cross(y5, z_tool)
    theta6 = np.arctan2(x_tool @ y5, x_tool @ x6)
    zeros = np.array([theta1, theta2, tilt - theta2, theta4, theta5, theta6])
    signs = (axes[0] @ z, sign2, axes[2] @ y, sign4, sign5, axes[5] @ z_tool)
    return SphericalWristArm(
        a1=float((points[1] - points[0]) @ x),
        a2=float((wrist - points[2]) @ across),
        b=float(wrist @ y),
        c1=float(points[1] @ z),
        c2=float(np.linalg.norm(upper_arm)),
        c3=float((wrist - points[2]) @ forearm),
        c4=float(from_wrist @ z_tool),
        offsets=tuple(_rounded_principal(-zero) for zero in zeros),
        signs=tuple(_sign(value) for value in signs),
    )


def _parallel_axes(where: str, axes: Array, points: Array, T_root_flange: Array) -> ParallelAxesArm:
    x_tool, y_tool, z_tool = T_root_flange[:3, :3].T
    z = np.array([0.0, 0.0, 1.0])
    _require_build(where, axes, parallel=(2, 3))
    meeting, miss = _meeting(axes[4:], points[4:])
    if miss > _LENGTH:
        raise InputError(where, f"axes 5 and 6 must meet, they pass by {2e3 * miss:.3g} mm")
    from_wrist = _from_wrist(where, axes, meeting, T_root_flange)
    sign2, x, y = _side(axes)
    theta1 = np.arctan2(x[1], x[0])
    upper_arm, forearm = (_across(points[k + 1] - points[k], y) for k in (1, 2))
    hand = _across(meeting - points[3], y)
    sideways = float(np.linalg.norm(np.cross(hand, axes[4])))
    if sideways > _LENGTH:
        message = f"seen along axis 4, axis 5 must meet it, it passes by {1e3 * sideways:.3g} mm"
        raise InputError(where, message)
    # the meeting of axes 5 and 6 lies ahead along axis 5
    sign5 = _sign(axes[4] @ hand)
    e3 = sign5 * axes[4]
    e1 = np.cross(y, e3)
    tilts = [np.arctan2(link @ x, link @ z) for link in (upper_arm, forearm, e3)]
    theta5 = np.arctan2(-z_tool @ e1, z_tool @ y)
    theta6 = np.arctan2(-x_tool @ e3, -y_tool @ e3)
    zeros = np.array([theta1, tilts[0], *np.diff(tilts), theta5, theta6])
    signs = (axes[0] @ z, sign2, axes[2] @ y, axes[3] @ y, sign5, axes[5] @ z_tool)
    return ParallelAxesArm(
        a1=float((points[1] - points[0]) @ x),
        b=float(meeting @ y),
        c1=float(points[1] @ z),
        c2=float(np.linalg.norm(upper_arm)),
        c3=float(np.linalg.norm(forearm)),
        c4=float(hand @ e3),
        c5=float(from_wrist @ z_tool),
        offsets=tuple(_rounded_principal(-zero) for zero in zeros),
        signs=tuple(_sign(value) for value in signs),
    )


def _require_build(where: str, axes: Array, parallel: tuple[int, ...]) -> None:
    """Refuse neighbouring axes that are not at right angles, or parallel where they must be."""
    for first in range(1, N_JOINTS):
        one, other = axes[first - 1], axes[first]
        wanted = "parallel" if first in parallel else "at right angles"
        square = abs(float(one @ other)) < _ANGLE
        if not (_parallel(one, other) if first in parallel else square):
            raise InputError(where, f"axes {first} and {first + 1} must be {wanted}")


def _from_wrist(where: str, axes: Array, wrist: Array, T_root_flange: Array) -> Array:
    """Return the vector from the wrist to the flange, which must lie on axis 6."""
    from_wrist, z_tool = T_root_flange[:3, 3] - wrist, T_root_flange[:3, 2]
    if not _parallel(z_tool, axes[5]) or np.linalg.norm(np.cross(from_wrist, z_tool)) > _LENGTH:
        raise InputError(where, f"{FLANGE} must lie on axis 6, its z along that axis")
    return np.asarray(from_wrist)


def _side(axes: Array) -> tuple[int, Array, Array]:
    """Return the sign of axis 2, where the arm heads, and y, to the left of an arm that heads x."""
    sign2 = _sign(axes[1, 1] if abs(axes[1, 1]) > _ANGLE else -axes[1, 0])
    y = sign2 * axes[1]
    return sign2, np.cross(y, [0.0, 0.0, 1.0]), y


def _across(v: Array, y: Array) -> Array:
    return v - (v @ y) * y


def _meeting(axes: Array, points: Array) -> tuple[Array, float]:
    """Return the point nearest to lines, shape (k, 3) each, and how far it is from the farthest."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    total = across.sum(axis=0)
    point = np.linalg.lstsq(total, (across @ points[:, :, None]).sum(axis=0)[:, 0], rcond=None)[0]
    miss = np.linalg.norm(np.cross(point - points, axes), axis=1).max()
    return np.asarray(point), float(miss)


def _parallel(one: Array, other: Array) -> bool:
    return float(np.linalg.norm(np.cross(one, other))) < _ANGLE


def _sign(value: float) -> int:
    return 1 if value > 0.0 else -1


def _rounded_principal(angle: float) -> float:
    """Return an angle in (-pi, pi], half a turn positive however it is rounded."""
    turned = float(principal(np.asarray(angle)))
    return np.pi if turned < -np.pi + 1e-9 else turned
