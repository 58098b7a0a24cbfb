"""What a proof is told of walls that may not be crossed everywhere."""

from __future__ import annotations

from typing import Protocol

from opl.geometry.frames import Array
from opl.search.walls import Piece


class Forbidden(Protocol):
    """Tells which parts of cells are forbidden."""

    @property
    def n_flips(self) -> int:
        """How many flips of the wrist a posture has that are forbidden each for itself."""

    def clear(
        self, piece: Piece, flip: int, first: int, end: int, looks: int
    ) -> tuple[Array, Array]:
        """Return which part of each cell of a piece is not known to be forbidden.

        Args:
            piece: The piece.
            flip: Which flip of its postures.
            first: Cells from this one on are looked at,
            end: to before this one.
            looks: 1 to look at them, 2 and 3 to look closer.

        Returns:
            Where it begins and ends in fractions of the cell, each of shape (n,); it ends before it
            begins where nothing is left.
        """
