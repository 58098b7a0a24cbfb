"""The keys of a job file."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field

from opl.files.documents import Document
from opl.job.bodies import Bodies, Clearance, Matrix
from opl.job.cell_file import CLEARANCE_MM
from opl.job.passes import PassesSection
from opl.job.process import ProcessSection
from opl.job.program import ProgramSection
from opl.job.search import SearchSection
from opl.job.wheel import WheelSection
from opl.job.workpiece import WorkpieceSection

_NAME = r"^[A-Z0-9_-]{1,28}$"


def _legal_name(name: str) -> str:
    if not re.fullmatch(_NAME, name):
        raise ValueError("must be 1 to 28 capital letters, digits, _ or -")
    return name


class _Fixture(Document):
    """How the robot holds the part."""

    model_config = ConfigDict(title="Fixture")

    T_flange_workpiece_mm: Matrix = Field(
        description="Pose of the workpiece frame in the flange frame, 4x4 with its origin in mm."
    )
    bodies: Bodies = Field(
        default=[], description="Solids between flange and part, in the flange frame."
    )


class JobFile(Document):
    """What is ground, with what, how and how fast.

    With a cell file, its robot, wheels, obstacles and clearance hold; without one, robot and wheel
    are needed here.
    """

    model_config = ConfigDict(
        title="Job file",
        json_schema_extra={"anyOf": [{"required": ["cell"]}, {"required": ["robot", "wheel"]}]},
    )

    name: Annotated[
        str, Field(json_schema_extra={"pattern": _NAME}), AfterValidator(_legal_name)
    ] = Field(
        description="Name of the program and of its files: 1 to 28 capital letters, digits, _ or -."
    )
    cell: str | None = Field(
        default=None,
        description="A cell file that says what stands around the part, relative to this file.",
    )
    robot: str | None = Field(
        default=None,
        description="Name of the robot as listed by `opl robots`, or the folder of your own one.",
    )
    wheel: WheelSection | None = Field(default=None, description="The contact wheel.")
    wheel_name: str | None = Field(
        default=None, description="Which wheel of the cell file, where it has several."
    )
    obstacles: Bodies = Field(
        default=[], description="Solids that stand in the cell, in the robot's base frame."
    )
    clearance_mm: Clearance = Field(
        default=CLEARANCE_MM,
        description="Least distance of everything that moves from everything else, other than part "
        "and belt while grinding.",
    )
    fixture: _Fixture = Field(description="How the robot holds the part.")
    workpiece: WorkpieceSection = Field(description="The part, and its surface to be ground.")
    passes: PassesSection = Field(description="How the surface is cut into passes.")
    search: SearchSection = Field(description="How the path is searched.")
    process: ProcessSection = Field(description="Feed, speeds, approach and home.")
    program: ProgramSection = Field(
        default=ProgramSection(), description="The controller, and how the program is written."
    )
