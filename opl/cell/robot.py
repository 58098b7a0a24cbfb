"""The robot: joints, limits, speeds and pulses from ``robots/<name>/``, and forward kinematics.

Forward kinematics is pinocchio's, on the URDF. The closed form of `opl.cell.inverse` has its own
numbers, in ``robot.yaml``; a robot whose two descriptions disagree is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
from pydantic import Field, model_validator

from opl.cell.inverse import SphericalWristArm, inverse
from opl.documents import Document, read
from opl.errors import InputError
from opl.geometry.frames import Array
from opl.resources import folder

N_JOINTS = 6


@dataclass(frozen=True, eq=False)
class Robot:
    """What is known of a robot. Its base frame is that of the controller.

    Attributes:
        name: Short name.
        title: Name for people.
        joint_names: In the order of every q.
        lower: Smallest joint positions in [rad], shape (6,).
        upper: Largest joint positions in [rad], shape (6,).
        max_speed: Largest joint speeds in [rad/s], shape (6,).
        pulses_per_radian: Encoder counts as programs give them in [1/rad], shape (6,).
        unverified_pulses: Joints whose pulses were never confirmed on this robot.
        arm: Closed form of the geometry.
        urdf: The geometry with shapes; has the frames ``base`` and ``tool0`` (flange face, z out).
        base_height: Base frame above the mounting face in [m].
    """

    name: str
    title: str
    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    max_speed: Array
    pulses_per_radian: Array
    unverified_pulses: tuple[str, ...]
    arm: SphericalWristArm
    urdf: Path
    base_height: float

    def __post_init__(self) -> None:
        for name in ("lower", "upper", "max_speed", "pulses_per_radian"):
            copy = np.array(getattr(self, name), dtype=float)
            if copy.shape != (N_JOINTS,):
                raise ValueError(f"{name} has shape {copy.shape}, must have ({N_JOINTS},)")
            copy.setflags(write=False)
            object.__setattr__(self, name, copy)


def known_robots() -> list[str]:
    """Return the names of the robots that come with opl."""
    return sorted(path.parent.name for path in folder("robots").glob("*/robot.yaml"))


def load_robot(name_or_folder: str, relative_to: Path | None = None) -> Robot:
    """Load a robot that comes with opl, or one of the user's own.

    Args:
        name_or_folder: One of `known_robots`, else a folder that holds a ``robot.yaml``.
        relative_to: Where a relative folder starts, default the working directory.

    Raises:
        InputError: If there is no such robot, or its file or URDF is unusable.
    """
    if name_or_folder in known_robots():
        home = folder("robots") / name_or_folder
    else:
        home = (relative_to or Path()) / name_or_folder
    path = home / "robot.yaml"
    if not path.is_file():
        known = ", ".join(known_robots())
        message = f"unknown robot {name_or_folder!r}; known: {known}, or a folder with a robot.yaml"
        raise InputError("robot", message)
    robot = _robot(read(path, _RobotDocument), home)
    if not robot.urdf.is_file():
        raise InputError(str(path), f"urdf: no such file, got {robot.urdf.name!r}")
    _check_urdf(robot)
    if not _arm_fits_urdf(robot):
        raise InputError(str(path), f"arm: is not the arm that {robot.urdf.name} describes")
    return robot


def forward(robot: Robot, q: Array) -> Array:
    """Return the flange poses Ts_base_flange of postures.

    Args:
        robot: Whose postures.
        q: Joint positions in [rad], shape (..., 6).

    Returns:
        Shape (..., 4, 4).
    """
    model = _model(robot.urdf)
    data = model.createData()
    base, flange = model.getFrameId("base"), model.getFrameId("tool0")
    postures = np.asarray(q, dtype=float).reshape(-1, N_JOINTS)
    Ts_base_flange = np.empty((len(postures), 4, 4))
    for T_base_flange, posture in zip(Ts_base_flange, postures, strict=True):
        pin.framesForwardKinematics(model, data, posture)
        T_base_flange[:] = data.oMf[base].actInv(data.oMf[flange]).homogeneous
    return Ts_base_flange.reshape(*np.shape(q)[:-1], 4, 4)


@cache
def _model(urdf: Path) -> pin.Model:
    return pin.buildModelFromUrdf(str(urdf))


def _check_urdf(robot: Robot) -> None:
    """Refuse a URDF that speaks of other joints or lacks a frame."""
    try:
        model = _model(robot.urdf)
    except ValueError as error:
        raise InputError(str(robot.urdf), "is not a URDF of one robot") from error
    joints = tuple(model.names)[1:]  # the first is the universe
    if joints != robot.joint_names or model.nq != N_JOINTS:
        wanted = " ".join(robot.joint_names)
        message = f"must have the revolute joints {wanted} in this order, has {' '.join(joints)}"
        raise InputError(str(robot.urdf), message)
    missing = [frame for frame in ("base", "tool0") if not model.existFrame(frame)]
    if missing:
        raise InputError(str(robot.urdf), f"must have links base and tool0, lacks {missing[0]}")


def _arm_fits_urdf(robot: Robot) -> bool:
    """Return whether the closed form finds postures again that the URDF was put in."""
    fractions = np.array([[0.3, 0.6, 0.4, 0.7, 0.2, 0.6], [0.8, 0.3, 0.7, 0.4, 0.6, 0.3]])
    q = robot.lower + fractions * (robot.upper - robot.lower)  # any two
    difference = inverse(robot.arm, forward(robot, q), q[:, 3]) - q[:, None]
    distance = np.abs(np.remainder(difference + np.pi, 2.0 * np.pi) - np.pi).max(axis=-1)
    # some URDFs round right angles to seven digits
    return bool((distance < 1e-5).any(axis=-1).all())


_Positive = Annotated[float, Field(gt=0)]


class _Sourced(Document):
    source: str
    certainty: Literal["high", "medium", "low"]


class _Base(_Sourced):
    height_mm: float


class _Arm(_Sourced):
    a1_mm: float
    a2_mm: float
    b_mm: float
    c1_mm: float
    c2_mm: _Positive
    c3_mm: float
    c4_mm: float
    offsets_deg: Annotated[list[float], Field(min_length=N_JOINTS, max_length=N_JOINTS)]
    signs: Annotated[list[Literal[1, -1]], Field(min_length=N_JOINTS, max_length=N_JOINTS)]


class _Limits(_Sourced):
    lower_deg: float
    upper_deg: float

    @model_validator(mode="after")
    def _in_order(self) -> _Limits:
        if self.lower_deg >= self.upper_deg:
            raise ValueError(f"lower_deg must be below upper_deg {self.upper_deg:g}")
        return self


class _Speed(_Sourced):
    max_deg_s: _Positive


class _Pulses(_Sourced):
    per_degree: _Positive
    verified: bool


class _Joint(Document):
    name: str
    limits: _Limits
    speed: _Speed
    pulses: _Pulses


class _RobotDocument(Document):
    name: str
    title: str
    maker: str
    urdf: str
    base: _Base
    arm: _Arm
    joints: Annotated[list[_Joint], Field(min_length=N_JOINTS, max_length=N_JOINTS)]


def _robot(document: _RobotDocument, home: Path) -> Robot:
    """Return the robot in SI units."""
    arm, joints = document.arm, document.joints
    return Robot(
        name=document.name,
        title=document.title,
        joint_names=tuple(joint.name for joint in joints),
        lower=np.radians([joint.limits.lower_deg for joint in joints]),
        upper=np.radians([joint.limits.upper_deg for joint in joints]),
        max_speed=np.radians([joint.speed.max_deg_s for joint in joints]),
        pulses_per_radian=np.array([joint.pulses.per_degree for joint in joints]) / np.radians(1.0),
        unverified_pulses=tuple(joint.name for joint in joints if not joint.pulses.verified),
        arm=SphericalWristArm(
            a1=arm.a1_mm / 1e3,
            a2=arm.a2_mm / 1e3,
            b=arm.b_mm / 1e3,
            c1=arm.c1_mm / 1e3,
            c2=arm.c2_mm / 1e3,
            c3=arm.c3_mm / 1e3,
            c4=arm.c4_mm / 1e3,
            offsets=tuple(math.radians(offset) for offset in arm.offsets_deg),
            signs=tuple(arm.signs),
        ),
        urdf=(home / document.urdf).resolve(),
        base_height=document.base.height_mm / 1e3,
    )
