"""Robots from ``robots/<name>/`` or a folder of the user's own: the value, checked and in SI.

The closed form of `opl.cell.inverse_kinematics` has its own numbers, in ``robot.yaml``; a robot
whose URDF disagrees with them is refused.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from opl.cell.full_turns import angular_distance
from opl.cell.inverse_kinematics import Arm, inverse_kinematics
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.robot import ENDS, Robot, forward_kinematics, urdf_chain
from opl.cell.robot_file import RobotFile, read_robot_file
from opl.cell.spherical_wrist import SphericalWristArm
from opl.cell.urdf_tree import UrdfTree
from opl.errors import InputError
from opl.files.confining import require_inside
from opl.files.resources import folder

# In which a joint is taken to reach its top speed where nobody knows its acceleration, in [s].
# Integrators guess 0.1 s for arms of this kind; slower is the safe side.
ASSUMED_RAMP = 0.4


def known_robots() -> list[str]:
    """Return the names of the robots that come with opl."""
    return sorted(path.parent.name for path in folder("robots").glob("*/robot.yaml"))


def robot_path(name_or_folder: str, relative_to: Path | None = None) -> Path:
    """Return where the ``robot.yaml`` of a robot lies; arguments as of `load_robot`.

    Raises:
        InputError: If there is no such robot.
    """
    if name_or_folder in known_robots():
        return folder("robots") / name_or_folder / "robot.yaml"
    path = (relative_to or Path()) / name_or_folder / "robot.yaml"
    if not path.is_file():
        known = ", ".join(known_robots())
        message = f"unknown robot {name_or_folder!r}; known: {known}, or a folder with a robot.yaml"
        raise InputError("robot", message)
    return path


def load_robot(name_or_folder: str, relative_to: Path | None = None) -> Robot:
    """Load a robot that comes with opl, or one of the user's own.

    Args:
        name_or_folder: One of `known_robots`, else a folder that holds a ``robot.yaml``.
        relative_to: Where a relative folder starts, default the working directory.

    Raises:
        InputError: If there is no such robot, or its file or URDF is unusable.
    """
    path = robot_path(name_or_folder, relative_to)
    robot = _robot(read_robot_file(path), path.parent)
    require_inside(robot.urdf)
    if not robot.urdf.is_file():
        raise InputError(str(path), f"urdf: no such file, got {robot.urdf.name!r}")
    UrdfTree(robot.urdf).require_shapes_on_joints()
    if name_or_folder not in known_robots():
        _check_by_pinocchio(robot.urdf)  # tests do that with those that come with opl
    _check_urdf(robot)
    if not _arm_fits_urdf(robot):
        raise InputError(str(path), f"arm: is not the arm that {robot.urdf.name} describes")
    return robot


def _check_by_pinocchio(urdf: Path) -> None:
    """Refuse a URDF that pinocchio, which moves the solids, does not read."""
    import pinocchio as pin

    try:
        pin.buildModelFromUrdf(str(urdf))
    except ValueError as error:
        raise InputError(str(urdf), "is not a URDF of one robot") from error


def _check_urdf(robot: Robot) -> None:
    """Refuse a URDF that has other joints, or lacks a frame."""
    found = urdf_chain(robot)
    joints = tuple(joint.name for joint in found.joints)
    if joints != robot.joint_names or any(joint.kind != "revolute" for joint in found.joints):
        wanted = " ".join(robot.joint_names)
        message = f"must have the revolute joints {wanted} in this order, has {' '.join(joints)}"
        raise InputError(str(robot.urdf), message)
    missing = [link for link in ENDS if link not in found.all_links]
    if missing:
        raise InputError(str(robot.urdf), f"must have links base and tool0, lacks {missing[0]}")
    if found.chain is None:
        message = "must have its joints one after the other, from base to tool0"
        raise InputError(str(robot.urdf), message)


def _arm_fits_urdf(robot: Robot) -> bool:
    """Return whether the closed form finds configurations again that the URDF was put in."""
    fractions = np.array([[0.3, 0.6, 0.4, 0.7, 0.2, 0.6], [0.8, 0.3, 0.7, 0.4, 0.6, 0.3]])
    q = robot.lower + fractions * (robot.upper - robot.lower)  # any two
    found = inverse_kinematics(robot.arm, forward_kinematics(robot, q), q)
    distance = angular_distance(found, q[:, None]).max(axis=-1)
    # some URDFs round right angles to seven digits
    return bool((distance < 1e-5).any(axis=-1).all())


def _robot(document: RobotFile, home: Path) -> Robot:
    """Return the robot in SI units."""
    base, joints = document.base, document.joints
    controller = base.controller_height_mm
    speed = np.radians([joint.speed.max_deg_s for joint in joints])
    known = document.acceleration
    counts = [joint.pulses.per_degree if joint.pulses else math.nan for joint in joints]
    return Robot(
        name=document.name,
        title=document.title,
        maker=document.maker,
        joint_names=tuple(joint.name for joint in joints),
        lower=np.radians([joint.limits.lower_deg for joint in joints]),
        upper=np.radians([joint.limits.upper_deg for joint in joints]),
        max_speed=speed,
        max_acceleration=speed / ASSUMED_RAMP if known is None else np.radians(known.max_deg_s2),
        acceleration_assumed=known is None or known.certainty == "low",
        pulses_per_radian=np.array(counts) / np.radians(1.0),
        unverified_pulses=tuple(
            joint.name for joint in joints if joint.pulses and not joint.pulses.verified
        ),
        arm=_arm(document),
        urdf=(home / document.urdf).resolve(),
        base_height=base.height_mm / 1e3,
        controller_base_height=(base.height_mm if controller is None else controller) / 1e3,
        controller_base_turn=math.radians(base.controller_turn_deg),
        payload=None if document.payload is None else document.payload.max_kg,
    )


def _arm(document: RobotFile) -> Arm:
    """Return the closed form in SI units."""
    lengths = document.arm.lengths_mm()
    kind = ParallelAxesArm if document.arm.parallel_axes else SphericalWristArm
    return kind(
        **{key.removesuffix("_mm"): length / 1e3 for key, length in lengths.items()},
        offsets=tuple(math.radians(offset) for offset in document.arm.offsets_deg),
        signs=tuple(document.arm.signs),
    )
