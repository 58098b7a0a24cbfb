"""What a check found."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Level(str, Enum):
    """How bad it is."""

    WARNING = "warning"  # reported, and the work goes on
    ERROR = "error"  # no program is written


@dataclass(frozen=True)
class Finding:
    """One thing found by a check.

    Attributes:
        level: How bad it is.
        kind: A short fixed word, e.g. ``collision``, ``limit``, ``speed``, ``contact``.
        where: The place: cutter point, pass, move of the motion.
        message: The bodies or the joint, and the amount.
    """

    level: Level
    kind: str
    where: str
    message: str

    def __str__(self) -> str:
        return f"{self.kind} at {self.where}: {self.message}"
