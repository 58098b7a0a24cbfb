"""Which images of the pieces of walls any box of interest can reach: most cannot, and need not be.

A box holds a point of the first wall, of which no image but the first is looked at. So an image of
another wall that is farther from all of that one than a box is large is of no interest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import Piece

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

    def near(self, around: Around, family: int, sign: Array, shift: Array) -> np.ndarray:
        """Return which images of a family on a wall are within reach, by their numbers, (n,).

        Args:
            around: What holds the wall; the one asked about first is the first wall.
            family: The family.
            sign: Of each of its images, shape (m, 6).
            shift: Likewise, in [rad].
        """
        self._first = self._first or around
        one, other = (sign * end + shift for end in around[family])
        low, high = np.minimum(one, other), np.maximum(one, other)
        least = np.full(len(sign), np.inf)
        for first_low, first_high in self._first.values():
            apart = np.maximum(low - first_high, first_low - high)
            least = np.minimum(least, np.maximum(apart, 0.0).sum(axis=1))
        return np.flatnonzero(least < self.size)
