"""The job file: YAML in, values in SI out. Keys, units and defaults are known only here."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from opl.cell.robot import Robot, load_robot
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.documents import Document, read
from opl.errors import InputError
from opl.geometry.frames import Array, NotARotationError, from_roll_pitch_yaw, nearest_pose
from opl.geometry.passes import MachinedSurface, Passes
from opl.geometry.shapes import Body, Box, Cylinder
from opl.geometry.wheel import ContactWheel
from opl.job_program import ProgramSection
from opl.job_search import Method, ProcessSection, Search, SearchSection
from opl.job_surface import PassesSection, WorkpieceSection
from opl.planning.timing import Pace
from opl.program.settings import ProgramSettings

MM = 1e-3

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]


def _proper(rows: list[list[float]]) -> list[list[float]]:
    """Check a 4x4 matrix with its origin in mm, as a calibration prints it."""
    try:
        nearest_pose(np.array(rows))
    except NotARotationError as error:
        raise ValueError(f"{error}, at most 0.02 is taken for rounding") from error
    return rows


Matrix = Annotated[list[Row], Field(min_length=4, max_length=4), AfterValidator(_proper)]

_NAME = r"^[A-Z0-9_-]{1,28}$"


def _legal_name(name: str) -> str:
    if not re.fullmatch(_NAME, name):
        raise ValueError("must be 1 to 28 capital letters, digits, _ or -")
    return name


class _Wheel(Document):
    T_base_contact0_mm: Matrix
    width_mm: Positive
    radius_mm: Positive
    max_roll_deg: Annotated[float, Field(ge=0.0, le=90.0)]
    contact_allowance_mm: NotNegative = 0.5


class _Body(Document):
    name: Annotated[str, Field(min_length=1)]
    at_mm: Triple
    rotation_deg: Triple = Field(default=[0.0, 0.0, 0.0])
    box_mm: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = None
    cylinder_mm: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = None

    @model_validator(mode="after")
    def _one_shape(self) -> _Body:
        if (self.box_mm is None) == (self.cylinder_mm is None):
            raise ValueError(
                "needs either box_mm (edges along x, y, z) or cylinder_mm (radius, length along z)"
            )
        return self

    @field_validator("name")
    @classmethod
    def _not_taken(cls, name: str) -> str:
        if name in (PART, WHEEL):
            raise ValueError("is the name of something else in the cell")
        return name

    def in_si(self) -> Body:
        shape = (
            Box((self.box_mm[0] * MM, self.box_mm[1] * MM, self.box_mm[2] * MM))
            if self.box_mm is not None
            else Cylinder(*(edge * MM for edge in self.cylinder_mm or ()))
        )
        origin = np.array(self.at_mm) * MM
        return Body(self.name, shape, from_roll_pitch_yaw(np.deg2rad(self.rotation_deg), origin))


class _Fixture(Document):
    T_flange_workpiece_mm: Matrix
    bodies: list[_Body] = Field(default=[])


class JobFile(Document):
    """The keys of a job file; `opl schema` prints them for editors."""

    name: Annotated[str, Field(json_schema_extra={"pattern": _NAME}), AfterValidator(_legal_name)]
    robot: str
    wheel: _Wheel
    obstacles: list[_Body] = Field(default=[])
    clearance_mm: NotNegative = 5.0
    fixture: _Fixture
    workpiece: WorkpieceSection
    passes: PassesSection
    search: SearchSection
    process: ProcessSection
    program: ProgramSection = ProgramSection()


@dataclass(frozen=True)
class Job:
    """Everything a job file says, validated, in SI.

    Attributes:
        path: The file, as the user named it.
        name: Name of the program.
        cell: Robot, wheel, part and surroundings.
        surface: The surface to be ground, in the workpiece frame.
        passes: How the surface is cut.
        search: How the path is sought.
        pace: Speeds, approach and home.
        program: How the program is written.
    """

    path: Path
    name: str
    cell: WorkCell
    surface: MachinedSurface
    passes: Passes
    search: Search
    pace: Pace
    program: ProgramSettings


def load(path: Path, method: str | None = None) -> Job:
    """Read and validate a job file and the files it names, relative to its folder.

    Args:
        path: The file.
        method: Search to use instead of the job's own.

    Raises:
        InputError: If anything in it is unusable; names file and key path.
    """
    file = read(path, JobFile)
    robot = _robot(path, file.robot)
    robot = file.process.robot_as_limited(file.program.robot_as_counted(path, robot))
    home = np.deg2rad(file.process.home_deg)
    _check_home(path, robot, home)
    if file.search.max_contact_error_mm <= file.passes.bow_height_mm:
        raise InputError(
            f"{path}: search.max_contact_error_mm",
            f"must be larger than passes.bow_height_mm, which is part of it, "
            f"got {file.search.max_contact_error_mm:g} and {file.passes.bow_height_mm:g}",
        )
    wheel = ContactWheel(
        file.wheel.width_mm * MM,
        file.wheel.radius_mm * MM,
        float(np.deg2rad(file.wheel.max_roll_deg)),
        _pose(file.wheel.T_base_contact0_mm),
    )
    part = file.workpiece.load_part(path)
    surface = file.workpiece.load_surface(path)
    file.workpiece.check_sizes(path, surface, part)
    file.workpiece.check_outside(path, surface, part)
    cell = WorkCell(
        robot=robot,
        wheel=wheel,
        obstacles=tuple(body.in_si() for body in file.obstacles),
        part=part,
        fixture=tuple(body.in_si() for body in file.fixture.bodies),
        T_flange_workpiece=_pose(file.fixture.T_flange_workpiece_mm),
        contact_allowance=file.wheel.contact_allowance_mm * MM,
        clearance=file.clearance_mm * MM,
    )
    search = file.search.in_si(file.passes.bow_height_mm)
    if method is not None:
        search = replace(search, method=Method(method))
    return Job(
        path=path,
        name=file.name,
        cell=cell,
        surface=surface,
        passes=file.passes.in_si(path, surface, wheel.radius),
        search=search,
        pace=file.process.in_si(),
        program=file.program.in_si(path, file.name, robot, home),
    )


def _robot(path: Path, name: str) -> Robot:
    try:
        return load_robot(name, path.parent)
    except InputError as error:
        # what is wrong with a robot's own file is told with that file's name
        where = f"{path}: robot" if error.where == "robot" else error.where
        raise InputError(where, error.message) from error


def _pose(matrix_mm: list[list[float]]) -> Array:
    matrix = np.array(matrix_mm)
    matrix[:3, 3] *= MM
    return nearest_pose(matrix)


def _check_home(path: Path, robot: Robot, home: Array) -> None:
    for k in np.flatnonzero((home < robot.lower) | (home > robot.upper)):
        raise InputError(
            f"{path}: process.home_deg",
            f"joint {robot.joint_names[k]} must be in {np.rad2deg(robot.lower[k]):g} to "
            f"{np.rad2deg(robot.upper[k]):g}, got {np.rad2deg(home[k]):g}",
        )
