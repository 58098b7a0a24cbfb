"""``robot.yaml``: what is known of a robot, every group of numbers with source and certainty."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from opl.cell.robot import N_JOINTS
from opl.files.documents import Document, read
from opl.files.quantities import Number, Positive

FROM_URDF = "from the URDF"


class Sourced(Document):
    """Numbers with their origin.

    High: two or more independent sources agree. Medium: one good source, or carried over from an
    arm with the same drive. Low: a guess to be confirmed.
    """

    source: str
    certainty: Literal["high", "medium", "low", "from the URDF"]


class Base(Sourced):
    """Where the base frame is: on axis 1, so far above the mounting face.

    The maker's controller may count from elsewhere on axis 1, or from a frame turned about it;
    see ``controller_height_mm`` and ``controller_turn_deg``.
    """

    height_mm: Number
    controller_height_mm: Number | None = None
    controller_turn_deg: Number = 0.0


class ArmNumbers(Sourced):
    """Link lengths, zero offsets and signs, as in `opl.cell.spherical_wrist` or `parallel_axes`."""

    family: Literal["spherical wrist", "parallel axes"] = "spherical wrist"
    a1_mm: Number
    a2_mm: Number | None = None  # spherical wrist only
    b_mm: Number
    c1_mm: Number
    c2_mm: Positive
    c3_mm: Number
    c4_mm: Number
    c5_mm: Number | None = None  # parallel axes only
    offsets_deg: Annotated[list[Number], Field(min_length=N_JOINTS, max_length=N_JOINTS)]
    signs: Annotated[list[Literal[1, -1]], Field(min_length=N_JOINTS, max_length=N_JOINTS)]

    @model_validator(mode="after")
    def _one_family(self) -> ArmNumbers:
        own, other = ("c5_mm", "a2_mm") if self.parallel_axes else ("a2_mm", "c5_mm")
        if getattr(self, own) is None:
            raise ValueError(f"an arm of family {self.family} needs {own}")
        if getattr(self, other) is not None:
            raise ValueError(f"an arm of family {self.family} has no {other}")
        if self.parallel_axes and self.c3_mm <= 0.0:
            raise ValueError(f"c3_mm must be more than 0, got {self.c3_mm:g}")
        return self

    @property
    def parallel_axes(self) -> bool:
        """Whether axes 2, 3 and 4 are parallel, else the last three meet in one point."""
        return self.family == "parallel axes"

    def lengths_mm(self) -> dict[str, float]:
        """Return the link lengths of its family by their keys."""
        values = {key: getattr(self, key) for key in type(self).model_fields if key[-3:] == "_mm"}
        return {key: value for key, value in values.items() if value is not None}


class Payload(Sourced):
    """What the flange may carry."""

    max_kg: Positive


class Limits(Sourced):
    """Travel of a joint."""

    lower_deg: Number
    upper_deg: Number

    @model_validator(mode="after")
    def _in_order(self) -> Limits:
        if self.lower_deg >= self.upper_deg:
            raise ValueError(f"lower_deg must be below upper_deg {self.upper_deg:g}")
        return self


class TopSpeed(Sourced):
    """Top speed of a joint."""

    max_deg_s: Positive


class Acceleration(Sourced):
    """Largest acceleration of each joint, base first; makers hardly ever publish it."""

    max_deg_s2: Annotated[list[Positive], Field(min_length=N_JOINTS, max_length=N_JOINTS)]


class PulseCounts(Sourced):
    """Encoder counts of a joint, as Yaskawa programs give them."""

    per_degree: Positive
    verified: bool


class Joint(Document):
    """One joint; without pulses where nobody knows them or the maker does not count in them."""

    name: str
    limits: Limits
    speed: TopSpeed
    pulses: PulseCounts | None = None


class RobotFile(Document):
    """The keys of a ``robot.yaml``."""

    name: str
    title: str
    maker: str
    urdf: str
    base: Base
    arm: ArmNumbers
    payload: Payload | None = None
    acceleration: Acceleration | None = None  # None: as `opl.cell.robot_loading` assumes it
    shapes: Sourced | None = None  # of the shapes in the URDF
    joints: Annotated[list[Joint], Field(min_length=N_JOINTS, max_length=N_JOINTS)]


def read_robot_file(path: Path) -> RobotFile:
    """Read a ``robot.yaml``.

    Raises:
        InputError: If it is unusable; every fault with its key.
    """
    return read(path, RobotFile)
