"""What a search knows at some moment; with that it can be followed, and ended with its best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class SoFar:
    """What a search knows at some moment.

    Attributes:
        done: How much of the work allowed is done, 0 to 1.
        value: Of the best motion so far: what the search keeps small, in its unit; None before a
            motion is known.
        lower_bound: No motion has less.
    """

    done: float
    value: float | None
    lower_bound: float


# Given what is known, often; may raise. Says whether the search goes on: otherwise it ends with its
# best motion, as soon as it has one.
Follow = Callable[[SoFar], bool]

ENDED = "the search was ended before its proof was complete"


def to_the_end(_: SoFar) -> bool:
    """Let a search go on to its end."""
    return True
