"""Keys with a value for each kind of move: position levels, and ramps in percent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import ConfigDict, Field

from opl.files.documents import Document
from opl.program.settings import ByKind

_Level = Annotated[int, Field(ge=0, le=8)]
_Percent = Annotated[int, Field(ge=1, le=100, json_schema_extra={"unit": "%"})]


class PositionLevels(Document):
    """Position level (PL) of each kind of move: how far its corners may be rounded.

    At 0 the robot stops at the position, at 8 it rounds most.
    """

    model_config = ConfigDict(title="Position levels")
    renamed: ClassVar[Mapping[str, str]] = {"air": "free_move"}

    on_wheel: _Level = Field(default=1, description="While grinding.")
    lead: _Level = Field(default=1, description="Approach and retract.")
    free_move: _Level = Field(default=1, description="From and to home, and between passes.")


class Percents(Document):
    """A ramp for each kind of move, in percent of the controller's own; else the controller's."""

    model_config = ConfigDict(title="Ramp percents")
    renamed: ClassVar[Mapping[str, str]] = {"air": "free_move"}

    on_wheel: _Percent | None = Field(default=None, description="While grinding.")
    lead: _Percent | None = Field(default=None, description="Approach and retract.")
    free_move: _Percent | None = Field(
        default=None, description="From and to home, and between passes."
    )

    def in_si(self) -> ByKind:
        """Return the percents by kind of move."""
        return ByKind(self.on_wheel, self.lead, self.free_move)
