"""The cell file: what many jobs share. YAML in, values in the robot's base frame out.

Everything that stands in the cell is given in the frame of the cell. ``mounting_face`` says where
the robot's mounting face is in it, so another arm needs no other line than its name: its base frame
comes to lie as high above the face as its axis 2. Without it the frame of the cell is the
robot's base frame.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from opl.cell.robot import Robot, link_names
from opl.cell.robot_loading import load_robot
from opl.cell.workcell import PART, WHEEL, JointLimit
from opl.errors import InputError
from opl.files.documents import read
from opl.geometry.frames import Array, from_roll_pitch_yaw, inverse, pose
from opl.geometry.shapes import Body
from opl.job.bodies import MM, bodies_in_si
from opl.job.cell_file import CellFile, MountingFace, Range
from opl.job.pairs import FIXTURE, ROBOT, PairNames, given_pairs
from opl.job.source import Source
from opl.job.values import Cell


def load_cell(path: Path) -> Cell:
    """Read and validate a cell file and the files it names, relative to its folder.

    Raises:
        InputError: If anything in it is unusable; names file and key path.
    """
    file, source = read(path, CellFile), Source.of_file(path)
    robot = robot_of(source, file.robot)
    T_cell_base = _base(file.mounting_face, robot)
    T_base_cell = inverse(T_cell_base)
    _require_names(source, file, robot)
    obstacles = tuple(
        Body(body.name, body.shape, T_base_cell @ body.T_parent_body)
        for body in bodies_in_si(source, "obstacles", file.obstacles)
    )
    gripper = bodies_in_si(source, "gripper", file.gripper)
    wheels = tuple(
        wheel.in_si(source, f"wheels.{place}", robot, T_cell_base)
        for place, wheel in enumerate(file.wheels)
    )
    names = PairNames(
        links=link_names(robot),
        held=tuple(body.name for body in gripper),
        wheels=tuple(wheel.name for wheel in wheels),
        obstacles=tuple(body.name for body in obstacles),
    )
    pairs = given_pairs(
        source,
        names,
        [tuple(pair) for pair in file.allowed_contacts],
        [(tuple(one.pair), one.clearance_mm * MM) for one in file.pair_clearances],
    )
    return Cell(
        path=path,
        robot=robot,
        T_cell_base=T_cell_base,
        wheels=wheels,
        obstacles=obstacles,
        gripper=gripper,
        clearance=file.clearance_mm * MM,
        pairs=pairs,
        limits=_limits(source, file, robot),
        home=None if file.home_deg is None else np.deg2rad(file.home_deg),
    )


def robot_of(source: Source, name: str) -> Robot:
    """Load the robot that a file names.

    Raises:
        InputError: If there is none of the name, or its own file is unusable.
    """
    try:
        source.file(name, "robot")  # refused if it is none that may be read
        return load_robot(name, source.folder)
    except InputError as error:
        # a fault in a robot's own file is reported with that file's name
        where = source.at("robot") if error.where == "robot" else error.where
        raise InputError(where, error.message) from error


def _base(face: MountingFace | None, robot: Robot) -> Array:
    """Return T_cell_base: the base frame lies straight above the mounting face."""
    if face is None:
        return np.eye(4)
    T_cell_face = from_roll_pitch_yaw(np.deg2rad(face.rotation_deg), np.array(face.at_mm) * MM)
    return T_cell_face @ pose(np.eye(3), np.array([0.0, 0.0, robot.base_height]))


def _require_names(source: Source, file: CellFile, robot: Robot) -> None:
    """Refuse two things of one name: a pair would not tell which is meant."""
    taken = {PART: "the part", ROBOT: "all links of the robot", FIXTURE: "the job's fixture"}
    taken.update(dict.fromkeys(link_names(robot), "a link of the robot"))
    places = [(f"wheels.{place}.name", wheel.name) for place, wheel in enumerate(file.wheels)]
    for key, bodies in (("obstacles", file.obstacles), ("gripper", file.gripper)):
        places += [(f"{key}.{place}.name", body.name) for place, body in enumerate(bodies)]
    for where, name in places:
        if name in taken:
            raise InputError(source.at(where), f"{name!r} is the name of {taken[name]} already")
        taken[name] = where
    if len(file.wheels) > 1 and WHEEL in (wheel.name for wheel in file.wheels):
        raise InputError(
            source.at("wheels"), f"each of several needs a name of its own, other than {WHEEL!r}"
        )


def _limits(source: Source, file: CellFile, robot: Robot) -> tuple[JointLimit, ...]:
    limits = []
    for place, one in enumerate(file.joint_limits):
        where = source.at(f"joint_limits.{place}")
        joint = _joint(robot, one.joint, f"{where}.joint")
        if one.joint in (other.joint for other in file.joint_limits[:place]):
            raise InputError(f"{where}.joint", f"joint {one.joint} is given twice")
        lower, upper = np.rad2deg(robot.lower[joint]), np.rad2deg(robot.upper[joint])
        if one.lower_deg >= upper or one.upper_deg <= lower:
            raise InputError(where, f"leaves nothing of {lower:g} to {upper:g}, the robot's own")
        limits.append(_limit(one.joint, np.eye(6)[joint], one))
    for place, sums in enumerate(file.coupled_limits):
        where = source.at(f"coupled_limits.{place}.coefficients")
        coefficients = np.zeros(6)
        for name, value in sums.coefficients.items():
            coefficients[_joint(robot, name, where)] = value
        if not coefficients.any():
            raise InputError(where, "all are zero")
        limits.append(_limit(sums.name or _sum(sums.coefficients), coefficients, sums))
    return tuple(limits)


def _joint(robot: Robot, name: str, where: str) -> int:
    if name not in robot.joint_names:
        raise InputError(where, f"no such joint {name!r}; have: {', '.join(robot.joint_names)}")
    return robot.joint_names.index(name)


def _limit(name: str, coefficients: Array, limits: Range) -> JointLimit:
    lower, upper = np.deg2rad([limits.lower_deg, limits.upper_deg])
    return JointLimit(name, coefficients, float(lower), float(upper))


def _sum(coefficients: dict[str, float]) -> str:
    """Return a sum as people write it, such as ``R+T`` or ``R-0.5T``."""
    terms = [
        f"{value:+g}{name}".replace("+1" + name, "+" + name).replace("-1" + name, "-" + name)
        for name, value in coefficients.items()
    ]
    return "".join(terms).removeprefix("+")
