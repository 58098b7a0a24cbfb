"""Keys with a value for each kind of move: how corners are rounded, and ramps in percent."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, PlainValidator, WithJsonSchema, model_validator

from opl.files.documents import Document
from opl.files.quantities import Positive
from opl.program.moves import Purpose
from opl.program.settings import ByKind

_HIGHEST = 8


def _level(value: object) -> int | Literal["none"]:
    if value == "none":
        return "none"
    if type(value) is int and 0 <= value <= _HIGHEST:  # true is no 1
        return value
    raise ValueError(f"must be a whole number of 0 to {_HIGHEST}, or none")


_Level = Annotated[
    int | Literal["none"],
    PlainValidator(_level),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "integer", "minimum": 0, "maximum": _HIGHEST},
                {"type": "string", "enum": ["none"]},
            ]
        }
    ),
]
_Radius = Annotated[Positive, Field(json_schema_extra={"unit": "mm"})]
_Percent = Annotated[int, Field(ge=1, le=100, json_schema_extra={"unit": "%"})]


class PositionLevels(Document):
    """Position level (PL) of each kind of move: how far its corners may be rounded.

    At 0 the robot stops at the position, at 8 it rounds most. With `none` no PL is written and the
    controller rounds as its own parameters say: which of them is not public, so half of each move
    is taken for the zone.
    """

    model_config = ConfigDict(title="Position levels")
    renamed: ClassVar[Mapping[str, str]] = {"air": "free_move"}

    on_wheel: _Level = Field(default=1, description="While grinding.")
    lead: _Level = Field(default=1, description="Approach and retract.")
    free_move: _Level = Field(default=1, description="From and to home, and between passes.")

    def in_si(self) -> ByKind:
        """Return the levels by kind of move, None where no PL is written."""
        levels = (self.on_wheel, self.lead, self.free_move)
        return ByKind(*(None if level == "none" else level for level in levels))


class CornerRadii(Document):
    """Corner radius (CR) of the straight moves of a kind, else they have its position level.

    Moves that are written as joint moves, all of those in the air among them, keep the level.
    """

    model_config = ConfigDict(title="Corner radii")

    on_wheel: _Radius | None = Field(default=None, description="While grinding.")
    lead: _Radius | None = Field(default=None, description="Approach and retract.")

    @model_validator(mode="before")
    @classmethod
    def _not_in_the_air(cls, keys: object) -> object:
        if isinstance(keys, dict) and "free_move" in keys:
            raise ValueError(
                "free_move: is for straight moves, those in the air are joint moves; "
                "write position_levels.free_move"
            )
        return keys

    def given(self) -> Iterator[str]:
        """Yield the keys that have a value."""
        yield from (key for key in ("on_wheel", "lead") if getattr(self, key) is not None)

    def in_si(self) -> Mapping[Purpose, float]:
        """Return the radii in [m] by kind of move."""
        return {Purpose(key): 1e-3 * getattr(self, key) for key in self.given()}


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
