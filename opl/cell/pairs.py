"""How far which bodies of a cell must stay apart, where that is not the same for all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

PairOfNames = frozenset[str]


@dataclass(frozen=True)
class PairRules:
    """What is said of single pairs, by the names of links and bodies.

    Attributes:
        allowed: Pairs that may touch; they are not looked at.
        required: Distance in [m] that a pair must keep, instead of that of the cell.
    """

    allowed: frozenset[PairOfNames] = frozenset()
    required: Mapping[PairOfNames, float] = field(default_factory=dict)

    def between(self, first: str, second: str, otherwise: float) -> float | None:
        """Return how far two bodies must stay apart in [m], None if they may touch.

        Args:
            first: Name of one.
            second: Name of the other.
            otherwise: The distance if nothing is said of this pair, in [m].
        """
        pair = frozenset((first, second))
        return None if pair in self.allowed else self.required.get(pair, otherwise)

    def widened(self, by: float) -> PairRules:
        """Return rules that ask for so much more distance in [m]."""
        return replace(self, required={pair: far + by for pair, far in self.required.items()})
