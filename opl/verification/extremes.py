"""Where a replayed motion comes nearest to what it must not do: the pair, the place, the joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.motion.motion import Motion


@dataclass(frozen=True, eq=False)
class Extreme:
    """The least or largest of a quantity, and where it was.

    Attributes:
        amount: In [m].
        subject: The pair of bodies, or what was measured.
        place: Of the move, as a person would look for it.
        q: Joint positions in [rad], shape (6,).
    """

    amount: float
    subject: str
    place: str
    q: Array


class Least:
    """Keeps the least of what it is told.

    Args:
        most: In [m]; what is not less is not kept.
    """

    def __init__(self, most: float = 0.0) -> None:
        self.amount = most
        self._found: tuple[str, int, Array] | None = None

    def note(self, amount: float, subject: str, move: int, q: Array) -> None:
        """Take note of an amount in [m] on the move to a configuration, at ``q``, shape (6,)."""
        if amount < self.amount:
            self.amount, self._found = amount, (subject, move, q)

    def add(self, other: Least) -> None:
        """Take note of what was kept later."""
        if other._found is not None:
            self.note(other.amount, *other._found)

    def found(self, motion: Motion, sign: float = 1.0) -> Extreme | None:
        """Return the least, times a sign; None if nothing was below the first value."""
        if self._found is None:
            return None
        subject, move, q = self._found
        return Extreme(sign * self.amount, subject, motion.place(move), np.array(q))
