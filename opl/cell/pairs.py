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
        clearances: Distance in [m] that a pair must keep, instead of the clearance of the cell.
    """

    allowed: frozenset[PairOfNames] = frozenset()
    clearances: Mapping[PairOfNames, float] = field(default_factory=dict)

    def needed(self, first: str, second: str, otherwise: float) -> float | None:
        """Return how far two bodies must stay apart in [m], None if they may touch.

        Args:
            first: Name of one.
            second: Name of the other.
            otherwise: The distance if nothing is said of this pair, in [m].
        """
        pair = frozenset((first, second))
        return None if pair in self.allowed else self.clearances.get(pair, otherwise)

    def widened(self, by: float) -> PairRules:
        """Return rules that ask for so much more distance in [m]."""
        wider = {pair: clearance + by for pair, clearance in self.clearances.items()}
        return replace(self, clearances=wider)
