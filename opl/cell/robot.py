"""The robot: joints, limits, speeds and pulses, and forward kinematics.

Forward kinematics is that of the URDF, to the last digit as pinocchio has it.

Base frame of every robot that comes with opl, whatever its maker counts from: on axis 1 at the
height of axis 2, z up, x ahead. So a cell stays as it is when another arm takes its place.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from opl.cell.inverse_kinematics import Arm
from opl.cell.urdf_chain import UrdfChain, read_chain
from opl.cell.urdf_tree import UrdfTree
from opl.geometry.frames import Array, from_roll_pitch_yaw, read_only

N_JOINTS = 6
# Configurations nearer to each other than this in every joint [rad] are one: a micrometre at the
# end of the arm, a tenth of an encoder pulse.
SAME_CONFIGURATION = 1e-6
ENDS = "base", "tool0"  # links of every URDF


@dataclass(frozen=True, eq=False)
class Robot:
    """What is known of a robot.

    Attributes:
        name: Short name.
        title: Name for people.
        maker: Who builds it.
        joint_names: In the order of every q.
        lower: Smallest joint positions in [rad], shape (6,).
        upper: Largest joint positions in [rad], shape (6,).
        max_speed: Largest joint speeds in [rad/s], shape (6,).
        max_acceleration: Largest joint accelerations in [rad/s^2], shape (6,).
        acceleration_assumed: Whether these are a guess.
        pulses_per_radian: Encoder counts as programs give them in [1/rad], shape (6,); NaN where
            they are not known.
        unverified_pulses: Joints whose pulses are known, but were never confirmed on this robot.
        arm: Closed form of the geometry.
        urdf: The geometry with shapes; has the frames ``base`` and ``tool0`` (flange face, z out).
        base_height: Base frame above the mounting face in [m].
        controller_base_height: The same of the base frame that the maker's controller counts from.
        controller_base_turn: How far that one is turned about axis 1 against ours in [rad].
        payload: What the flange may carry in [kg], None if not known.
        position_level_zones: How far its controller may cut a corner at the position levels PL=1 to
            PL=8 in [m], eight, as its own parameters say; None if they are not known.
    """

    name: str
    title: str
    maker: str
    joint_names: tuple[str, ...]
    lower: Array
    upper: Array
    max_speed: Array
    max_acceleration: Array
    acceleration_assumed: bool
    pulses_per_radian: Array
    unverified_pulses: tuple[str, ...]
    arm: Arm
    urdf: Path
    base_height: float
    controller_base_height: float
    controller_base_turn: float
    payload: float | None
    position_level_zones: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("lower", "upper", "max_speed", "max_acceleration", "pulses_per_radian"):
            copy = read_only(getattr(self, name))
            if copy.shape != (N_JOINTS,):
                raise ValueError(f"{name} has shape {copy.shape}, must have ({N_JOINTS},)")
            object.__setattr__(self, name, copy)

    @property
    def missing_pulses(self) -> tuple[str, ...]:
        """Joints whose pulses are not known."""
        missing = np.isnan(self.pulses_per_radian)
        return tuple(name for name, gone in zip(self.joint_names, missing, strict=True) if gone)

    @property
    def reach(self) -> float:
        """Farthest from axis 1 that the wrist centre, or where axes 5 and 6 meet, can be in [m]."""
        return self.arm.reach

    @property
    def T_controller_base(self) -> Array:
        """The base frame, as the maker's controller counts, shape (4, 4)."""
        return from_roll_pitch_yaw(
            np.array([0.0, 0.0, -self.controller_base_turn]),
            np.array([0.0, 0.0, self.base_height - self.controller_base_height]),
        )


def forward_kinematics(robot: Robot, q: Array) -> Array:
    """Return the flange poses Ts_base_flange, (..., 4, 4), of configurations in [rad], (..., 6)."""
    configurations = np.asarray(q, dtype=float).reshape(-1, N_JOINTS)
    chain = urdf_chain(robot).chain
    assert chain is not None, "see load_robot"
    return chain.poses(configurations).reshape(*np.shape(q)[:-1], 4, 4)


def controller_poses(robot: Robot, q: Array) -> Array:
    """Return the poses of `forward_kinematics` from the controller's own base frame."""
    return robot.T_controller_base @ forward_kinematics(robot, q)


def link_names(robot: Robot) -> tuple[str, ...]:
    """Return the links that carry its shapes, from the foot to the one with the flange."""
    return urdf_chain(robot).links


def urdf_chain(robot: Robot) -> UrdfChain:
    """Return what moves in its URDF, read once."""
    return _chain(robot.urdf)


@lru_cache(maxsize=16)  # a service may see a robot of its own in each job
def _chain(urdf: Path) -> UrdfChain:
    return read_chain(UrdfTree(urdf), *ENDS)
