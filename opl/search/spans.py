"""Runs of cells of walls: which of them a small box can hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit

from opl.geometry.frames import Array
from opl.search.outside import outside
from opl.search.walls import Image, Piece, Wall


@dataclass(frozen=True)
class Span:
    """A run of cells of one image of a piece.

    Attributes:
        piece: Index of the piece of its wall.
        image: Index of the image of its family.
        first: First cell.
        end: After the last cell.
    """

    piece: int
    image: int
    first: int
    end: int


class Body:
    """A wall with all of its pieces and images as arrays."""

    def __init__(self, wall: Wall, images: Callable[[int], Sequence[Image]]) -> None:
        self.wall = wall
        self.images = images
        self.pieces = list(wall.pieces)
        self._finer: dict[tuple[int, int], tuple[int, int]] = {}
        self._moved: dict[tuple[int, int], Piece] = {}
        self._chords: dict[tuple[int, int], Array] = {}
        self._boxes: dict[tuple[int, int], tuple[Array, Array]] = {}

    @cached_property
    def all_spans(self) -> tuple[list[Span], Array, Array]:
        """All pieces in all images, and a box around each."""
        spans, low, high = [], [], []
        for index, piece in enumerate(self.wall.pieces):
            least, most = piece.low.min(axis=0), piece.high.max(axis=0)
            for number, image in enumerate(self.images(piece.family)):
                ends = image.sign * least + image.shift, image.sign * most + image.shift
                spans.append(Span(index, number, 0, len(piece.pad_low)))
                low.append(np.minimum(*ends))
                high.append(np.maximum(*ends))
        return spans, np.array(low).reshape(-1, 6), np.array(high).reshape(-1, 6)

    def key(self, span: Span) -> tuple[int, tuple[int, ...]]:
        """Return what all spans of a pass share."""
        family = self.pieces[span.piece].family
        return family, self.images(family)[span.image].key

    def moved(self, span: Span) -> Piece:
        """Return the image of the piece of a span."""
        at = (span.piece, span.image)
        if at not in self._moved:
            piece = self.pieces[span.piece]
            self._moved[at] = self.images(piece.family)[span.image].of(piece)
        return self._moved[at]

    def finer(self, span: Span, cut: Callable[[Piece, int], Sequence[Piece]]) -> list[Span]:
        """Return the spans of a single cell cut into smaller ones."""
        at = (span.piece, span.first)
        if at not in self._finer:
            found = cut(self.pieces[span.piece], span.first)
            self._finer[at] = len(self.pieces), len(found)
            self.pieces += found
        first, count = self._finer[at]
        return [
            Span(piece, span.image, 0, len(self.pieces[piece].pad_low))
            for piece in range(first, first + count)
        ]

    def whole_box(self, span: Span) -> tuple[Array, Array]:
        """Return the boxes of all cells of the piece of a span."""
        at = (span.piece, span.image)
        if at not in self._boxes:
            piece = self.moved(span)
            self._boxes[at] = np.ascontiguousarray(piece.low), np.ascontiguousarray(piece.high)
        return self._boxes[at]

    def distance(self, span: Span, low: Array, high: Array) -> float:
        """Return by how much a box misses the chords of a span, in [rad]; 0 where one is open."""
        piece = self.pieces[span.piece]
        if piece.open_cells[span.first : span.end].any():
            return 0.0
        at = (span.piece, span.image)
        if at not in self._chords:
            self._chords[at] = np.ascontiguousarray(self.moved(span).corners.T)[None]
        chords = np.ascontiguousarray(self._chords[at][:, :, span.first : span.end + 1])
        missing, row = np.empty(1), np.empty(1)
        outside(chords, np.ones((1, chords.shape[2]), dtype=bool), low, high, np.inf, missing, row)
        return float(missing[0])


def grown(cell_low: Array, cell_high: Array, low: Array, high: Array) -> Array:
    """Return the size of a core with a point of each cell taken in, in [rad], shape (n,)."""
    edges = np.maximum(cell_low, high) - np.minimum(cell_high, low)
    return np.asarray(np.maximum(edges, 0.0).sum(axis=-1))


@njit(
    "Tuple((int64,int64,float64))(float64[:,::1],float64[:,::1],int64,int64,float64[::1],"
    "float64[::1],float64,float64[::1],float64[::1])",
    cache=True,
)
def fitting(  # type: ignore[no-untyped-def]
    cell_low, cell_high, first, end, low, high, closing, least, most
):
    """Return first and end of the cells of a run that a small box can hold, and the least size.

    Args:
        cell_low: Lower faces of the cells in [rad], shape (n, 6).
        cell_high: Upper faces.
        first: First cell.
        end: After the last.
        low: Lower faces of the core in [rad], shape (6,).
        high: Upper faces.
        closing: Boxes of this size or more are not small, in [rad].
        least: Lowered to the least lower faces of these cells, shape (6,).
        most: Raised to the greatest upper faces, shape (6,).
    """
    begin, stop, smallest = end, end, np.inf
    for cell in range(first, end):
        size = 0.0
        for joint in range(6):
            edge = max(cell_low[cell, joint], high[joint]) - min(cell_high[cell, joint], low[joint])
            size += max(edge, 0.0)
        if size < closing:
            if begin == end:
                begin = cell
            stop = cell + 1
            smallest = min(smallest, size)
    for cell in range(begin, stop):
        for joint in range(6):
            least[joint] = min(least[joint], cell_low[cell, joint])
            most[joint] = max(most[joint], cell_high[cell, joint])
    return begin, stop, smallest
