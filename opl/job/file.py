"""The keys of a job file."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field

from opl.files.documents import Document
from opl.job.bodies import BodySection, Matrix, NotNegative
from opl.job.cell import CLEARANCE_MM
from opl.job.program import ProgramSection
from opl.job.search import ProcessSection, SearchSection
from opl.job.surface import PassesSection, WorkpieceSection
from opl.job.wheel import WheelSection

_NAME = r"^[A-Z0-9_-]{1,28}$"


def _legal_name(name: str) -> str:
    if not re.fullmatch(_NAME, name):
        raise ValueError("must be 1 to 28 capital letters, digits, _ or -")
    return name


class _Fixture(Document):
    T_flange_workpiece_mm: Matrix
    bodies: list[BodySection] = Field(default=[])


class JobFile(Document):
    """The keys of a job file; `opl schema` prints them for editors."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["cell"]}, {"required": ["robot", "wheel"]}]}
    )

    name: Annotated[str, Field(json_schema_extra={"pattern": _NAME}), AfterValidator(_legal_name)]
    cell: str | None = None
    robot: str | None = None
    wheel: WheelSection | None = None
    wheel_name: str | None = None
    obstacles: list[BodySection] = Field(default=[])
    clearance_mm: NotNegative = CLEARANCE_MM
    fixture: _Fixture
    workpiece: WorkpieceSection
    passes: PassesSection
    search: SearchSection
    process: ProcessSection
    program: ProgramSection = ProgramSection()
