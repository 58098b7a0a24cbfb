"""The keys of a cell file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field, model_validator

from opl.files.documents import Document
from opl.files.quantities import Number, at_most
from opl.job.bodies import Bodies, Clearance, Six, Triple
from opl.job.wheel import CellWheelSection

CLEARANCE_MM = 5.0
TwoNames = Annotated[list[str], Field(min_length=2, max_length=2)]


class MountingFace(Document):
    """Where the robot's mounting face is in the frame of the cell.

    Another arm needs no other change than its name: its base frame lies above the face by the
    height of its axis 2.
    """

    model_config = ConfigDict(title="Mounting face")

    at_mm: Triple = Field(description="Position of the mounting face (x, y, z).")
    rotation_deg: Triple = Field(
        default=[0.0, 0.0, 0.0],
        description="Roll, pitch, yaw: turns about the fixed axes x, then y, then z.",
    )


class Range(Document):
    """A range of a joint or of a sum of joints."""

    lower_deg: Number = Field(description="Lower limit, below upper_deg.")
    upper_deg: Number = Field(description="Upper limit, above lower_deg.")

    @model_validator(mode="after")
    def _in_order(self) -> Range:
        if self.lower_deg >= self.upper_deg:
            raise ValueError(f"lower_deg must be below upper_deg {self.upper_deg:g}")
        return self


class JointLimit(Range):
    """A range of one joint that is narrower than the robot's own."""

    model_config = ConfigDict(title="Joint limit")

    joint: str = Field(description="Name of the joint, as `opl robots show` prints it.")


class CoupledLimit(Range):
    """A range of a weighted sum of joints, such as R + T that winds a hose."""

    model_config = ConfigDict(title="Coupled limit")

    name: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="Name for messages; else the sum itself, such as R+T."
    )
    coefficients: Annotated[dict[str, Number], Field(min_length=1)] = Field(
        description="Factor of each joint in the sum, by the name of the joint; not all zero."
    )


class PairClearance(Document):
    """The clearance of one pair of bodies."""

    model_config = ConfigDict(title="Pair clearance")

    pair: TwoNames = Field(
        description="Names of two bodies or robot links; `robot` stands for all links, `part` for "
        "the part, `fixture` for the fixture of the job."
    )
    clearance_mm: Clearance = Field(description="Least distance between the two.")


class CellFile(Document):
    """What many jobs share: robot, wheels, and all that stands around.

    A job names this file as its key `cell`.
    """

    model_config = ConfigDict(title="Cell file")
    renamed: ClassVar[Mapping[str, str]] = {
        "stands": "mounting_face",
        "clearances": "pair_clearances",
    }

    robot: str = Field(
        description="Name of the robot as listed by `opl robots`, or the folder of your own one."
    )
    mounting_face: MountingFace | None = Field(
        default=None,
        description="Where the robot's mounting face is in the frame of the cell; else the frame "
        "of the cell is the robot's base frame.",
    )
    wheels: Annotated[list[CellWheelSection], Field(min_length=1, max_length=100)] = Field(
        description="The contact wheels; one or more."
    )
    obstacles: Bodies = Field(
        default=[], description="Solids that stand in the cell, in the frame of the cell."
    )
    gripper: Bodies = Field(
        default=[], description="Solids fixed to the flange, in the flange frame."
    )
    clearance_mm: Clearance = Field(
        default=CLEARANCE_MM,
        description="Least distance of everything that moves from everything else, other than part "
        "and belt while grinding.",
    )
    pair_clearances: Annotated[list[PairClearance], at_most(1000)] = Field(
        default=[], description="Clearances of single pairs, instead of clearance_mm."
    )
    allowed_contacts: Annotated[list[TwoNames], at_most(1000)] = Field(
        default=[],
        description="Pairs of bodies that may touch, such as gripper and part; names as in "
        "pair_clearances.",
    )
    joint_limits: Annotated[list[JointLimit], at_most(100)] = Field(
        default=[], description="Joint ranges that are narrower than the robot's own."
    )
    coupled_limits: Annotated[list[CoupledLimit], at_most(100)] = Field(
        default=[], description="Ranges of weighted sums of joints, for the dress pack."
    )
    home_deg: Six | None = Field(
        default=None,
        description="Joint positions at the start and the end of a program; given here or in the "
        "job, as process.home_deg.",
    )
