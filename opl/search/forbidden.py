"""What a proof is told of walls that may not be crossed everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from opl.geometry.frames import Array
from opl.search.walls import Piece, Wall


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


def crossed_by_any(walls: Sequence[Wall], forbidden: Forbidden | None) -> bool:
    """Return whether each pass may cross all its walls in one posture, as far as is known.

    Where a pass may not, there is no motion, whatever full turns joints make.

    Args:
        walls: The walls.
        forbidden: Tells where they may not be crossed; None if everywhere.
    """
    flips = range(1 if forbidden is None else forbidden.n_flips)
    left: dict[int, set[tuple[int, int, int]]] = {}
    for wall in walls:
        open_in = {
            (piece.family, piece.side, flip)
            for piece in wall.pieces
            for flip in flips
            if forbidden is None or _any_left(*forbidden.clear(piece, flip, 0, 0, 1))
        }
        left[wall.pass_index] = left.get(wall.pass_index, open_in) & open_in
    return all(left.values())


def _any_left(begin: Array, end: Array) -> bool:
    return bool((begin <= end).any())
