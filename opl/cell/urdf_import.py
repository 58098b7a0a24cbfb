"""A robot of the user's own from its URDF: ``robot.yaml``, URDF and meshes in one folder.

The URDF is changed in two places only: the frame ``base`` comes to where opl counts from, and the
meshes are named relative to the file.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import indent

import numpy as np

from opl.cell.full_turns import FULL_TURN, angular_distance
from opl.cell.inverse_kinematics import Arm, inverse_kinematics, singularity_margins
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.robot import Robot, forward_kinematics
from opl.cell.robot_file import FROM_URDF
from opl.cell.robot_loading import load_robot
from opl.cell.urdf_arm import UrdfArm, arm_of_urdf
from opl.cell.urdf_tree import UrdfTree
from opl.cell.xacro_file import SUFFIX, expand
from opl.errors import InputError
from opl.files.writing import write_folder

N_CHECKED = 500
# Farthest that a configuration found may be from its pose: what rounded right angles cost.
CLOSURE = 2e-5  # [m], and as much in the entries of the rotation matrix
# Stands for a speed that the URDF does not give: slow, for programs use a share of it.
SLOW = np.deg2rad(10.0)
# Height [m] and turn [rad] of the controller's own base frame, where the URDF has one.
Controller = tuple[float, float] | None
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")


@dataclass(frozen=True)
class ImportedRobot:
    """What came of an import.

    Attributes:
        robot: The robot, as a job would load it.
        files: What was written.
        closure: Largest error of FK(IK) over random configurations, in [m] and in entries of
            rotations.
        cautions: What the user should put right in ``robot.yaml``, one line each.
    """

    robot: Robot
    files: tuple[Path, ...]
    closure: float
    cautions: tuple[str, ...]


def import_urdf(
    urdf: Path, name: str, folder: Path, *, base_at_floor: bool = False, maker: str = "unknown"
) -> ImportedRobot:
    """Make a robot folder from a URDF.

    Args:
        urdf: The file, or a xacro that makes it.
        name: Name of the robot, small letters, digits, _ and -.
        folder: Where to write; must not hold a robot already.
        base_at_floor: Whether the base frame shall lie on the mounting face instead of at the
            height of axis 2, where it lies for the robots that come with opl.
        maker: Who builds it.

    Raises:
        InputError: If the URDF is unusable or its arm has no closed form here, the name is not
            legal, or the folder holds a robot.
    """
    if not _NAME.fullmatch(name):
        raise InputError("name", f"must be small letters, digits, _ and -, got {name!r}")
    if not urdf.is_file():
        raise InputError(str(urdf), "no such file")
    path = folder / "robot.yaml"
    if path.exists():
        raise InputError(str(path), "exists already; name a new folder")
    tree, found = _read(urdf)
    height = 0.0 if base_at_floor else found.arm.c1
    controller = tree.base_frame()
    tree.set_base(height)
    tree.gather_shapes()
    tree.leave_out_pictures()
    meshes = tree.collect_meshes()
    cautions = [*tree.cautions(), *_doubts(found)]
    found = replace(found, arm=replace(found.arm, c1=found.arm.c1 - height))

    with TemporaryDirectory() as scratch:  # nothing is left behind by what fails
        draft = Path(scratch)
        (draft / "meshes" if meshes else draft).mkdir(exist_ok=True)
        for target, source in meshes.items():
            shutil.copyfile(source, draft / target)
        tree.write(draft / f"{name}.urdf")
        text = _robot_yaml(found, name, maker, height, controller, urdf.name)
        (draft / path.name).write_text(text, encoding="utf-8")
        closure = closure_error(load_robot(str(draft)))
        if closure > CLOSURE:
            message = f"FK(IK) misses by {closure:.1g}: the closed form is not that of the URDF"
            raise InputError(str(urdf), message)
        write_folder(draft, folder)
    robot = load_robot(str(folder))
    files = (path, robot.urdf, *(folder / target for target in meshes))
    return ImportedRobot(robot, files, closure, tuple(cautions))


def _read(urdf: Path) -> tuple[UrdfTree, UrdfArm]:
    if urdf.suffix != SUFFIX:
        return UrdfTree(urdf), arm_of_urdf(urdf)  # the tree first: it refuses what falls over
    with TemporaryDirectory() as scratch:
        plain = Path(scratch) / "arm.urdf"
        plain.write_text(expand(urdf), encoding="utf-8")
        return UrdfTree(plain, urdf), arm_of_urdf(plain, urdf)


def closure_error(robot: Robot, n: int = N_CHECKED, seed: int = 0) -> float:
    """Return the largest error of FK(IK) over random configurations within the limits.

    Infinite if a configuration is not found again at all, apart from full turns; next to
    singularities, where rounded right angles move joints far, that does not count.
    """
    q = np.random.default_rng(seed).uniform(robot.lower, robot.upper, (n, 6))
    Ts_base_flange = forward_kinematics(robot, q)
    found = inverse_kinematics(robot.arm, Ts_base_flange)
    apart = angular_distance(found, q[:, None]).max(axis=-1)
    regular = singularity_margins(robot.arm, q).min(axis=-1) > 0.02
    nearest = np.where(np.isnan(apart), np.inf, apart).min(axis=1)
    if not (nearest[regular] < 1e-2).all():
        return float("inf")
    exists = ~np.isnan(found).any(axis=-1)
    wanted = np.broadcast_to(Ts_base_flange[:, None], (*exists.shape, 4, 4))[exists]
    return float(np.abs(forward_kinematics(robot, found[exists]) - wanted).max())


def _doubts(found: UrdfArm) -> Iterator[str]:
    """Yield what looks like a placeholder."""
    names = found.joint_names
    for name, speed in zip(names, found.max_speed, strict=True):
        if speed <= 0.0:
            yield f"{name}: the URDF gives no speed, 10 deg/s stands there; see the data sheet"
    # no arm turns these all round, unless its axes 2 to 4 are parallel
    for k in () if isinstance(found.arm, ParallelAxesArm) else (1, 4):
        low, high = found.lower[k], found.upper[k]
        if high - low > FULL_TURN - 1e-3:
            yield (
                f"{names[k]}: limits {np.rad2deg(low):.0f} to {np.rad2deg(high):.0f} deg look like "
                "a placeholder; see the data sheet"
            )
    if np.ptp(found.upper) < 1e-6 and np.ptp(found.lower) < 1e-6:
        yield "all joints have the same limits, which look like placeholders; see the data sheet"
    if np.ptp(found.max_speed) < 1e-6 and found.max_speed[0] > 0.0:
        yield "all joints have the same speed, which looks like a placeholder; see the data sheet"


def _robot_yaml(
    found: UrdfArm, name: str, maker: str, height: float, controller: Controller, urdf: str
) -> str:
    """Return the text of ``robot.yaml``."""
    origin = f"source: {urdf}\n  certainty: {FROM_URDF}"
    counts = ""
    if controller is not None:
        counts = f"  controller_height_mm: {_mm(controller[0])}\n"
        if controller[1]:
            counts += f"  controller_turn_deg: {_deg(controller[1])}\n"
    text = f"""\
# {name}, made by opl robots import-urdf from {urdf}.
# Check limits and speeds against the data sheet, and state it under source and certainty
# (high, medium, low).
name: {name}
title: {name}
maker: {maker}
urdf: {name}.urdf

# The base frame lies on axis 1, so far above the mounting face; jobs are written in it.
base:
  height_mm: {_mm(height)}
{counts}  {origin}

arm:
{_arm_lines(found.arm)}
  {origin}

shapes:
  {origin}

joints:
"""
    deeper = origin.replace("\n", "\n    ")
    for k, joint in enumerate(found.joint_names):
        speed, speed_origin = found.max_speed[k], deeper
        if speed <= 0.0:
            speed, speed_origin = SLOW, "source: none, a slow placeholder\n      certainty: low"
        text += f"""\
  - name: {joint}
    limits:
      lower_deg: {_deg(found.lower[k])}
      upper_deg: {_deg(found.upper[k])}
      {deeper}
    speed:
      max_deg_s: {_deg(speed)}
      {speed_origin}
"""
    return text


def _arm_lines(arm: Arm) -> str:
    keys = [field.name for field in fields(arm) if isinstance(getattr(arm, field.name), float)]
    lengths = [f"{key}_mm: {_mm(getattr(arm, key))}" for key in keys]
    offsets = ", ".join(_deg(offset) for offset in arm.offsets)
    signs = ", ".join(map(str, arm.signs))
    family = ["family: parallel axes"] if isinstance(arm, ParallelAxesArm) else []
    lines = [*family, *lengths, f"offsets_deg: [{offsets}]", f"signs: [{signs}]"]
    return indent("\n".join(lines), "  ")


def _mm(length: float) -> str:
    return f"{round(length * 1e3, 8) + 0.0:.12g}"


def _deg(angle: float) -> str:
    return f"{round(float(np.rad2deg(angle)), 8) + 0.0:.12g}"
