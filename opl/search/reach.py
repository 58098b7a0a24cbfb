"""Which images of the pieces of walls any box of interest can reach: most cannot, and need not be.

A box holds a point of the first wall, of which no image but the first is looked at. So an image of
another wall that is farther from all of that one than a box is large is of no interest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import Moves, Piece

Around = Mapping[int, Array]  # what holds the pieces of a wall, by family, as of `Piece.ends`


def around_families(pieces: Sequence[Piece]) -> dict[int, Array]:
    """Return what holds pieces of each family."""
    found: dict[int, Array] = {}
    for piece in pieces:
        (low, high), ends = found.get(piece.family, piece.ends), piece.ends
        found[piece.family] = np.stack([np.minimum(low, ends[0]), np.maximum(high, ends[1])])
    return found


class Reach:
    """How far from the first wall images may be.

    Args:
        size: Boxes of this size or more in [rad] are of no interest.
    """

    def __init__(self, size: float) -> None:
        self.size = size
        self._first: Around | None = None  # what holds the first wall

    def near(self, around: Around, family: int, moves: Moves) -> np.ndarray:
        """Return which images of a family on a wall are within reach, by their numbers, (n,).

        Args:
            around: What holds the wall; the one asked about first is the first wall.
            family: The family.
            moves: Its images.
        """
        self._first = self._first or around
        near = np.zeros(len(moves.sign), dtype=bool)
        for first in self._first.values():
            left, away = np.arange(len(near)), np.zeros(len(near))
            for joint, (sign, shift, which) in enumerate(moves.of_joints):
                one, other = (sign * end[joint] + shift for end in around[family])
                above = np.minimum(one, other) - first[1, joint]
                below = first[0, joint] - np.maximum(one, other)
                away = away + np.maximum(np.maximum(above, below), 0.0)[which[left]]
                kept = away < self.size
                left, away = left[kept], away[kept]
            near[left] = True
        return np.flatnonzero(near)
