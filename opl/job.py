"""The job file: YAML in, values in SI out. Keys, units and defaults are known only here."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Field, field_validator, model_validator

from opl.cell.robot import Robot, load_robot
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.documents import Document, read
from opl.errors import InputError
from opl.geometry.frames import Array, NotARotationError, from_roll_pitch_yaw, nearest_pose
from opl.geometry.mesh import load_mesh
from opl.geometry.nurbs import NurbsSurface, load_surface
from opl.geometry.shapes import Body, Box, Cylinder
from opl.geometry.wheel import ContactWheel
from opl.planning.path import Interpolation
from opl.planning.starts import Start
from opl.planning.timing import Pace

MM = 1e-3
MAX_JOINT_STEP = np.deg2rad(15.0)  # between adjacent nodes; more is a jump through a singularity


class Order(str, Enum):
    """In which direction the passes are ground."""

    ONE_WAY = "one_way"
    ZIGZAG = "zigzag"


class Method(str, Enum):
    """How the path is searched."""

    RECURSIVE = "recursive"


Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]


def _proper(rows: object) -> object:
    """Check a 4x4 matrix with its origin in mm, as a calibration prints it."""
    matrix = np.array(rows, dtype=float)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise ValueError("must be 4 rows of 4 finite numbers")
    try:
        nearest_pose(matrix)
    except NotARotationError as error:
        raise ValueError(f"{error}, at most 0.02 is taken for rounding") from error
    return rows


Matrix = Annotated[list[Row], Field(min_length=4, max_length=4), BeforeValidator(_proper)]


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


class _Workpiece(Document):
    surface: str
    reversed_normal: bool = False
    mesh: str
    mesh_unit: Literal["mm", "m"]
    sample_spacing_mm: Positive = 2.0


class _Passes(Document):
    plane_normal: Triple
    pitch_mm: Positive
    margin_mm: NotNegative = 0.0
    rows: Annotated[int, Field(ge=1)] | None = None
    bow_height_mm: Positive
    largest_step_mm: Positive
    order: Literal["one_way", "zigzag"] = "one_way"


class _Search(Document):
    method: Literal["recursive"] = "recursive"
    start: Literal["best", "nearest"] = "best"
    contact_positions: Annotated[int, Field(ge=2)]
    max_contact_step: Positive
    max_contact_error_mm: Positive = 0.1


class _Process(Document):
    feed_mm_s: Positive
    home_deg: Six
    approach_mm: Positive = 50.0
    approach_mm_s: Positive = 50.0
    air_speed_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 10.0


class _Program(Document):
    tool: Annotated[int, Field(ge=0, le=63)] = 0
    template: str | None = None


class JobFile(Document):
    """The keys of a job file; `opl schema` prints them for editors."""

    name: Annotated[str, Field(pattern=r"^[A-Z0-9_-]{1,28}$")]
    robot: str
    wheel: _Wheel
    obstacles: list[_Body] = Field(default=[])
    clearance_mm: NotNegative = 5.0
    fixture: _Fixture
    workpiece: _Workpiece
    passes: _Passes
    search: _Search
    process: _Process
    program: _Program = _Program()


@dataclass(frozen=True)
class Passes:
    """How the surface is cut into passes; lengths in [m]."""

    plane_normal: Array
    pitch: float
    margin: float
    rows: int | None
    max_bow_height: float
    largest_step: float
    order: Order


@dataclass(frozen=True)
class Job:
    """Everything a job file says, validated, in SI.

    Attributes:
        path: The file, as the user named it.
        name: Name of the program.
        cell: Robot, wheel, part and surroundings.
        surface: The surface to be ground, in the workpiece frame.
        reversed_normal: Whether its outward normal is -(du x dv).
        sample_spacing: Of the part's surface samples in [m].
        passes: How the surface is cut.
        n_contact_positions: M, the number of values of t.
        method: The search.
        start: Its start node.
        interpolation: How the path between nodes is filled in.
        max_contact_error: Largest distance of part and wheel on the wheel in [m].
        pace: Speeds, approach and home.
        tool: Number of the tool that the program names.
        template: The user's own template of the program, or None.
    """

    path: Path
    name: str
    cell: WorkCell
    surface: NurbsSurface
    reversed_normal: bool
    sample_spacing: float
    passes: Passes
    n_contact_positions: int
    method: Method
    start: Start
    interpolation: Interpolation
    max_contact_error: float
    pace: Pace
    tool: int
    template: Path | None


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
    cell = WorkCell(
        robot=robot,
        wheel=wheel,
        obstacles=tuple(body.in_si() for body in file.obstacles),
        part=load_mesh(path.parent / file.workpiece.mesh, file.workpiece.mesh_unit),
        fixture=tuple(body.in_si() for body in file.fixture.bodies),
        T_flange_workpiece=_pose(file.fixture.T_flange_workpiece_mm),
        contact_allowance=file.wheel.contact_allowance_mm * MM,
        clearance=file.clearance_mm * MM,
    )
    template = file.program.template
    return Job(
        path=path,
        name=file.name,
        cell=cell,
        surface=load_surface(path.parent / file.workpiece.surface),
        reversed_normal=file.workpiece.reversed_normal,
        sample_spacing=file.workpiece.sample_spacing_mm * MM,
        passes=Passes(
            np.array(file.passes.plane_normal),
            file.passes.pitch_mm * MM,
            file.passes.margin_mm * MM,
            file.passes.rows,
            file.passes.bow_height_mm * MM,
            file.passes.largest_step_mm * MM,
            Order(file.passes.order),
        ),
        n_contact_positions=file.search.contact_positions,
        method=Method(method or file.search.method),
        start=Start(file.search.start),
        interpolation=Interpolation(
            file.search.max_contact_step,
            # the rest of what is allowed is the bow height of the path itself
            (file.search.max_contact_error_mm - file.passes.bow_height_mm) * MM,
            float(MAX_JOINT_STEP),
        ),
        max_contact_error=file.search.max_contact_error_mm * MM,
        pace=Pace(
            file.process.feed_mm_s * MM,
            file.process.approach_mm * MM,
            file.process.approach_mm_s * MM,
            file.process.air_speed_percent / 100.0,
            home,
        ),
        tool=file.program.tool,
        template=None if template is None else path.parent / template,
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
