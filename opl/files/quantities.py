"""Numbers as they stand in files, each with bounds that no real thing exceeds."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

LARGEST = 1e5  # in mm, degrees, seconds and what is made of them
MOST_PULSES = 2**31 - 1  # as controllers count

Number = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(gt=0.0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0.0, le=LARGEST)]
Pulses = Annotated[int, Field(ge=-MOST_PULSES, le=MOST_PULSES)]


def between(low: float, high: float) -> Any:
    """Return the bounds of a number, both allowed."""
    return Field(ge=low, le=high)


def at_most(count: int) -> Any:
    """Return the bound of a list."""
    return Field(max_length=count)
