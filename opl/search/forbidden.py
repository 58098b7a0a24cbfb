"""What a proof is told of walls that may not be crossed everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from opl.geometry.frames import Array
from opl.search.walls import Piece, Wall

AT_ONCE = 32  # cells looked at


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
    """Return whether each pass may cross all its walls in one posture, as far as one look tells.

    Where a pass may not, there is no motion, whatever full turns joints make.

    Args:
        walls: The walls.
        forbidden: Tells where they may not be crossed; None if everywhere.
    """
    flips = range(1 if forbidden is None else forbidden.n_flips)
    passes: dict[int, list[Wall]] = {}
    for wall in walls:
        passes.setdefault(wall.pass_index, []).append(wall)

    def crossed(wall: Wall, family: int, side: int, flip: int) -> bool:
        own = (one for one in wall.pieces if (one.family, one.side) == (family, side))
        return any(forbidden is None or _any_left(forbidden, one, flip) for one in own)

    return all(
        any(
            all(crossed(wall, *posture, flip) for wall in own)
            for posture in {(piece.family, piece.side): None for piece in own[0].pieces}
            for flip in flips
        )
        for own in passes.values()
    )


def _any_left(forbidden: Forbidden, piece: Piece, flip: int) -> bool:
    """Return whether a part of a piece is not known to be forbidden; looks no further than that."""
    n = len(piece.pad_low)
    for first in range(0, n, AT_ONCE):
        end = min(first + AT_ONCE, n)
        begin, last = forbidden.clear(piece, flip, first, end, 1)
        if (begin[first:end] <= last[first:end]).any():
            return True
    return False
