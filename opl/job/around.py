"""What is around the part: given by the job itself, or by the cell file that it names.

With a cell file, robot, wheel, obstacles and clearance stand only there, and home in one of the
two: what both give would have to be looked up in both.
"""

from __future__ import annotations

import numpy as np

from opl.cell.workcell import PairRules, WorkCell
from opl.errors import InputError
from opl.geometry.frames import Array
from opl.job import keys
from opl.job.bodies import MM, bodies_in_si
from opl.job.cell import load_cell, robot_of
from opl.job.file import JobFile
from opl.job.pairs import NO_PAIRS
from opl.job.source import Source
from opl.job.values import Cell, Surroundings


def surroundings(source: Source, file: JobFile) -> Surroundings:
    """Return what is around the part.

    Args:
        source: The job file or mapping.
        file: Its content.

    Raises:
        InputError: If something is missing, given twice or unusable; names file and key path.
    """
    return _own(source, file) if file.cell is None else _from_cell(source, file.cell, file)


def _own(source: Source, file: JobFile) -> Surroundings:
    """Return the surroundings in a job without a cell file."""
    wheel, home = file.wheel, file.process.home_deg
    for key, value in (("robot", file.robot), ("wheel", wheel), (keys.PROCESS_HOME, home)):
        if value is None:
            raise InputError(source.at(key), "is missing, and there is no cell file to say it")
    if file.wheel_name is not None:
        raise InputError(source.at("wheel_name"), "goes with a cell file, whose wheels have names")
    assert file.robot is not None and wheel is not None and home is not None
    robot = robot_of(source, file.robot)
    placed = wheel.in_si(source, "wheel", robot, np.eye(4))
    cell = Cell(
        path=None,
        robot=robot,
        T_cell_base=np.eye(4),
        wheels=(placed,),
        obstacles=bodies_in_si(source, "obstacles", file.obstacles),
        gripper=(),
        clearance=file.clearance_mm * MM,
        pairs=NO_PAIRS,
        limits=(),
        home=np.deg2rad(home),
    )
    home_key = source.at(keys.PROCESS_HOME)
    return Surroundings(cell, placed, PairRules(), np.deg2rad(home), home_key, keys.WHEEL_POSE)


def _from_cell(source: Source, cell_name: str, file: JobFile) -> Surroundings:
    """Return the surroundings in the cell file that a job names."""
    path = source.file(cell_name, "cell")
    cell = load_cell(path)
    for key in ("robot", "wheel", "obstacles", keys.CLEARANCE):
        if key in file.model_fields_set:
            raise InputError(source.at(key), f"is for the cell file, {path}, to say")
    own_home, home_key = file.process.home_deg, source.at(keys.PROCESS_HOME)
    if own_home is None:
        if cell.home is None:
            raise InputError(home_key, f"is missing here, and home_deg in {path}")
        home, home_key = cell.home, Source.of_file(path).at("home_deg")
    elif cell.home is None:
        home = np.deg2rad(own_home)
    else:
        raise InputError(home_key, f"is given here and as home_deg in {path}; leave one out")
    placed = cell.pick(file.wheel_name, source.at("wheel_name"))
    held = tuple(body.name for body in file.fixture.bodies)
    for place, name in enumerate(held):
        if name in cell.pairs.names.known or name in held[:place]:
            where = source.at(f"fixture.bodies.{place}.name")
            raise InputError(where, f"{name!r} is something else in {path} or here")
    rules = cell.pairs.rules(placed.name, held)
    return Surroundings(cell, placed, rules, home, home_key, f"where the wheel is in {path}")


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
