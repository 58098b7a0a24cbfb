"""The figures of ``result.json`` that tell what was proven of a motion and of its files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class CornersReport:
    """What rounding the corners of the program leaves of it."""

    rounded: int
    zones_unknown: int  # corners of which nobody knows the zone: half of each move was taken
    max_contact_error_mm: float
    max_contact_error_at: str  # pass and cutter point, empty without contact
    allowed_contact_error_mm: float
    max_contact_error_at_ends_mm: float  # where the part meets and leaves the belt: not limited


@dataclass(frozen=True)
class FileReport:
    """What was found when the files of the program were read back."""

    proven: bool
    files: Sequence[str]
    postures: int
    largest_rounding_mm: float
    largest_difference_mm: float
    replayed: bool
    corners: CornersReport | None  # None where something else is wrong with the file


@dataclass(frozen=True)
class PlaceReport:
    """Where something is least or largest."""

    subject: str  # the pair of bodies
    place: str  # pass and cutter point, or which move
    joints_deg: Sequence[float]


@dataclass(frozen=True)
class VerificationReport:
    """What the replay found."""

    engine: str
    poses: int
    collisions: int
    min_clearance_mm: float
    max_contact_error_mm: float
    limit_violations: int
    file: FileReport | None  # None if nothing was read back
    max_belt_penetration_mm: float  # deepest that the part was in the belt
    allowed_belt_penetration_mm: float
    min_clearance_at: PlaceReport | None  # None if it is the farthest that is measured
    max_contact_error_at: PlaceReport | None
    max_belt_penetration_at: PlaceReport | None
