"""Barriers: contact positions that no motion gets past between two places of a pass.

A pass goes on and never back, so all along a barrier it stays on one side of it. Which side it
takes of each barrier is one of a few choices that exclude each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import Piece


@dataclass(frozen=True)
class Barrier:
    """Where the part surely cuts into the wheel all the way.

    Attributes:
        first: From this place on, a fractional cutter point,
        last: to this one.
        contact_position: There, in belt units.
    """

    first: float
    last: float
    contact_position: float


@dataclass(frozen=True)
class Side:
    """On which side of each barrier a pass stays.

    Attributes:
        number: Differs from those of the other sides of the pass.
        above: Barriers that it stays at greater contact positions of.
        below: Barriers that it stays at lesser ones of.
    """

    number: int = 0
    above: tuple[Barrier, ...] = ()
    below: tuple[Barrier, ...] = ()

    def excludes(self, first: Array, last: Array, low: Array, high: Array) -> np.ndarray:
        """Return where the pass never is, all over: places and contact positions from and to."""
        out = np.zeros(np.broadcast_shapes(*map(np.shape, (first, last, low, high))), dtype=bool)
        for one in self.above:
            out |= (one.first <= first) & (last <= one.last) & (high <= one.contact_position)
        for one in self.below:
            out |= (one.first <= first) & (last <= one.last) & (low >= one.contact_position)
        return out

    def holds(self, places: Array, t: Array) -> np.ndarray:
        """Return which contact positions the pass may use at places of shape (n,).

        In belt units, shape (m,) or (n, m).
        """
        return ~self.excludes(places[:, None], places[:, None], t, t)

    def parts(self, piece: Piece, place: float | None) -> Iterator[Piece]:
        """Yield the parts of a piece that the pass may use; a cell with a barrier in it is left.

        Args:
            piece: The piece.
            place: Where it runs over contact positions; None if it runs along one.
        """
        ends = piece.at[:-1], piece.at[1:]
        t = np.array(piece.line.contact_position)
        where = (*ends, t, t) if place is None else (np.array(place), np.array(place), *ends)
        left = np.concatenate([[False], ~self.excludes(*where), [False]])
        for first, end in np.flatnonzero(np.diff(left.astype(int))).reshape(-1, 2).tolist():
            yield replace(piece.part(first, end), side=self.number)


ANY_SIDE = Side()


def sides_of(
    barriers: Sequence[Barrier], shut: Callable[[float, float, float], bool], most: int
) -> list[Side]:
    """Return the sides of a pass: the choices that do not exclude themselves.

    Args:
        barriers: The barriers of the pass; of too many, only the first count.
        shut: Whether no motion is at a place between two contact positions.
        most: How many sides there may be.
    """
    sides = [ANY_SIDE]
    for barrier in barriers:
        more = []
        for side in sides:
            above = replace(side, above=(*side.above, barrier))
            below = replace(side, below=(*side.below, barrier))
            more += [one for one in (below, above) if not _is_shut(one, shut)]
        if len(more) > most:
            break
        sides = more
    return [replace(side, number=number) for number, side in enumerate(sides)]


def _is_shut(side: Side, shut: Callable[[float, float, float], bool]) -> bool:
    """Return whether nothing is left of a side at some place where two barriers meet."""
    for above in side.above:
        for below in side.below:
            place = max(above.first, below.first)
            if place > min(above.last, below.last):
                continue
            low, high = above.contact_position, below.contact_position
            if low >= high or shut(place, low, high):
                return True
    return False
