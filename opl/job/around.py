"""What is around the part: told by the job itself, or by the cell file that it names.

With a cell file, robot, wheel, obstacles and clearance are the cell's to say, and home is either's:
what two files say would have to be looked up in both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.robot import Robot
from opl.cell.workcell import JointLimit, PairRules, WorkCell
from opl.errors import InputError
from opl.geometry.frames import Array
from opl.geometry.shapes import Body
from opl.job.bodies import MM, bodies_in_si
from opl.job.cell import Cell, load_cell, robot_of
from opl.job.file import JobFile
from opl.job.source import Source
from opl.job.wheel import PlacedWheel


@dataclass(frozen=True)
class Surroundings:
    """What is around the part: from the job file, or from the cell file that it names.

    Attributes:
        cell: The cell file's content, None without one.
        robot: The arm.
        placed: The wheel, and how it was found.
        obstacles: What stands around, in the base frame.
        gripper: Bodies of the cell that are fixed to the flange.
        clearance: Distance to keep in [m].
        pairs: The pairs that keep another distance, or none.
        limits: Limits of joints beside the robot's own.
        home: Joint positions in [rad], shape (6,).
        home_key: File and key that say so.
        wheel_key: What says where the wheel is.
    """

    cell: Cell | None
    robot: Robot
    placed: PlacedWheel
    obstacles: tuple[Body, ...]
    gripper: tuple[Body, ...]
    clearance: float
    pairs: PairRules
    limits: tuple[JointLimit, ...]
    home: Array
    home_key: str
    wheel_key: str


def surroundings(source: Source, file: JobFile) -> Surroundings:
    """Return what is around the part.

    Args:
        source: The job file or mapping.
        file: Its content.

    Raises:
        InputError: If something is missing, told twice or unusable; names file and key path.
    """
    return _own(source, file) if file.cell is None else _from_cell(source, file)


def _own(source: Source, file: JobFile) -> Surroundings:
    """Return what a job without a cell file says of everything but the part."""
    missing = [key for key in ("robot", "wheel") if getattr(file, key) is None]
    missing += ["process.home_deg"] if file.process.home_deg is None else []
    if missing:
        raise InputError(source.at(missing[0]), "is missing, and there is no cell file to say it")
    if file.wheel_name is not None:
        raise InputError(source.at("wheel_name"), "goes with a cell file, whose wheels have names")
    assert file.robot is not None and file.wheel is not None and file.process.home_deg is not None
    robot = robot_of(source, file.robot)
    return Surroundings(
        cell=None,
        robot=robot,
        placed=file.wheel.in_si(source, "wheel", robot, np.eye(4)),
        obstacles=bodies_in_si(source, "obstacles", file.obstacles),
        gripper=(),
        clearance=file.clearance_mm * MM,
        pairs=PairRules(),
        limits=(),
        home=np.deg2rad(file.process.home_deg),
        home_key=source.at("process.home_deg"),
        wheel_key="wheel.T_base_contact0_mm",
    )


_OF_THE_CELL = ("robot", "wheel", "obstacles", "clearance_mm")  # with a cell file, only there


def _from_cell(source: Source, file: JobFile) -> Surroundings:
    """Return what the cell file of a job says of everything but the part."""
    cell_path = source.file(str(file.cell))
    cell = load_cell(cell_path)
    for key in _OF_THE_CELL:
        if key in file.model_fields_set:
            raise InputError(source.at(key), f"is for the cell file, {cell_path}, to say")
    of_job = file.process.home_deg
    if (of_job is None) == (cell.home is None):
        both = f"is given here and as home_deg in {cell_path}; leave one out"
        told = both if of_job is not None else f"is missing here, and home_deg in {cell_path}"
        raise InputError(source.at("process.home_deg"), told)
    placed = cell.pick(file.wheel_name, source.at("wheel_name"))
    held = tuple(body.name for body in file.fixture.bodies)
    for place, name in enumerate(held):
        if name in cell.pairs.names.known or name in held[:place]:
            where = source.at(f"fixture.bodies.{place}.name")
            raise InputError(where, f"{name!r} is something else in {cell_path} or here")
    return Surroundings(
        cell=cell,
        robot=cell.robot,
        placed=placed,
        obstacles=cell.around(placed),
        gripper=cell.gripper,
        clearance=cell.clearance,
        pairs=cell.pairs.rules(placed.name, held),
        limits=cell.limits,
        home=np.deg2rad(of_job) if of_job is not None else _given(cell.home),
        home_key=(
            Source.of_file(cell_path).at("home_deg")
            if of_job is None
            else source.at("process.home_deg")
        ),
        wheel_key=f"where the wheel is in {cell_path}",
    )


def _given(home: Array | None) -> Array:
    assert home is not None
    return home


def check_home(key: str, cell: WorkCell, home: Array) -> None:
    """Refuse a home beyond a limit.

    Args:
        key: File and key that say where it is.
        cell: For the limits.
        home: Joint positions in [rad], shape (6,).

    Raises:
        InputError: If it is; names the joint or the limit.
    """
    robot = cell.robot
    for k in np.flatnonzero((home < robot.lower) | (home > robot.upper)):
        raise InputError(
            key,
            f"joint {robot.joint_names[k]} must be in {np.rad2deg(robot.lower[k]):g} to "
            f"{np.rad2deg(robot.upper[k]):g}, got {np.rad2deg(home[k]):g}",
        )
    for limit in cell.limits:
        total = float(home @ limit.coefficients)
        if limit.name in cell.broken_limits(home):
            raise InputError(
                key,
                f"{limit.name} must be in {np.rad2deg(limit.lower):g} to "
                f"{np.rad2deg(limit.upper):g}, got {np.rad2deg(total):g}",
            )
