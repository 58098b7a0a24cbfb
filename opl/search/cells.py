"""The cells of walls in one table, and the runs of them that a subproblem is about.

A row of the table is a cell in one image: joint positions at its two ends, how far below and above
the chord the postures can be, and its ends along the wall. A run of cells is a span.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import Image, Piece, Wall

COLUMNS = 26  # start 0:6, end 6:12, pad_low 12:18, pad_high 18:24, places 24 and 25
WALL, KEY, SOURCE, FIRST, END = range(5)  # columns of a span
Key = tuple[int, tuple[int, ...]]  # a family, and the key of its image
# what is left of a run of cells of a piece without those that are forbidden; None if none is
Clear = Callable[[Piece, int, int], Sequence[Piece] | None]


class Cells:
    """All cells that some subproblem is about; grows.

    Args:
        images: The images of each family, the family itself first.
        cut: Cuts a cell of a wall into smaller ones.

    Attributes:
        walls: The walls.
        pass_index: The pass of each.
        table: The cells, shape (capacity, 26); rows not in use are at its end.
        n_keys: Of how many kinds spans are that a pass cannot change between.
    """

    def __init__(
        self,
        images: Callable[[int], Sequence[Image]],
        cut: Callable[[Piece, int], Sequence[Piece]],
    ) -> None:
        self._images = images
        self._cut = cut
        self.walls: list[Wall] = []
        self.pass_index = np.empty(0, dtype=np.int64)
        self.table = np.empty((1024, COLUMNS))
        self._used = 0
        self._keys: dict[Key, int] = {}
        self._sources: list[tuple[Piece, int]] = []  # piece and number of its image
        self._first: list[int] = []  # cell of each source, -1 for those not in the table yet
        self._of_wall: list[tuple[np.ndarray, Array, Array]] = []  # sources and boxes around them
        self._finer: dict[tuple[int, int], np.ndarray] = {}
        self._clear: dict[int, np.ndarray] = {}  # which cells of a source are not forbidden

    @property
    def n_keys(self) -> int:
        """Of how many kinds spans are that a pass cannot change between."""
        return len(self._keys)

    def add(self, wall: Wall) -> None:
        """Take in a wall."""
        first, low, high = len(self._sources), [], []
        for piece in wall.pieces:
            ends = piece.low.min(axis=0), piece.high.max(axis=0)
            for number, image in enumerate(self._images(piece.family)):
                self._new_source(piece, number)
                moved = image.sign * np.array(ends) + image.shift
                low.append(moved.min(axis=0))
                high.append(moved.max(axis=0))
        sources = np.arange(first, len(self._sources))
        self._of_wall.append((sources, np.reshape(low, (-1, 6)), np.reshape(high, (-1, 6))))
        self.walls.append(wall)
        self.pass_index = np.append(self.pass_index, wall.pass_index)

    def keys_of(self, spans: np.ndarray) -> dict[int, list[Key]]:
        """Return the families and images of spans, by their pass, as all its walls have them."""
        names = list(self._keys)
        both = np.unique(np.stack([self.pass_index[spans[:, WALL]], spans[:, KEY]]), axis=1)
        found: dict[int, list[Key]] = {}
        for index, key in both.T.tolist():
            found.setdefault(index, []).append(names[key])
        return found

    def spans_of(self, wall: int, low: Array, high: Array, closing: float) -> np.ndarray:
        """Return the spans of a wall that boxes below a size can hold, the core given."""
        sources, least, most = self._of_wall[wall]
        edges = np.maximum(least, high) - np.minimum(most, low)
        kept = sources[np.maximum(edges, 0.0).sum(axis=1) < closing].tolist()
        if wall == 0:
            # the whole motion has images: of these the first is looked at
            kept = [source for source in kept if self._sources[source][1] == 0]
        return np.array([self._span(wall, source) for source in kept], np.int64).reshape(-1, 5)

    def finer(self, span: np.ndarray) -> np.ndarray:
        """Return the spans of a single cell cut into smaller ones."""
        wall, _, source, cell, _ = span.tolist()
        at = source, cell
        if at not in self._finer:
            piece, image = self._sources[source]
            found = []
            for smaller in self._cut(piece, cell - self._first[source]):
                self._new_source(smaller, image)
                found.append(self._span(wall, len(self._sources) - 1))
            self._finer[at] = np.array(found, np.int64).reshape(-1, 5)
        return self._finer[at]

    def cleared(self, spans: np.ndarray, clear: Clear) -> np.ndarray | None:
        """Return spans without the cells that are forbidden, None if none of theirs is."""
        found, forbidden = [], False
        for span in spans.tolist():
            wall, _, source, first, end = span
            piece, image = self._sources[source]
            looked_at = self._clear.setdefault(source, np.zeros(len(piece.pad_low), dtype=bool))
            begin, stop = first - self._first[source], end - self._first[source]
            left = None if looked_at[begin:stop].all() else clear(piece, begin, stop)
            if left is None:
                looked_at[begin:stop] = True
                found.append(tuple(span))
                continue
            forbidden = True
            for part in left:
                self._new_source(part, image)
                number = len(self._sources) - 1
                self._clear[number] = np.ones(len(part.pad_low), dtype=bool)
                found.append(self._span(wall, number))
        return np.array(found, np.int64).reshape(-1, 5) if forbidden else None

    def _new_source(self, piece: Piece, image: int) -> None:
        self._sources.append((piece, image))
        self._first.append(-1)

    def _span(self, wall: int, source: int) -> tuple[int, int, int, int, int]:
        """Return a whole piece in one image as a span; its cells are entered if they are not."""
        piece, number = self._sources[source]
        image, n = self._images(piece.family)[number], len(piece.pad_low)
        first = self._first[source]
        if first < 0:
            first = self._first[source] = self._used
            self._used += n
            if self._used > len(self.table):
                more = np.empty((self._used, COLUMNS))
                self.table = np.concatenate([self.table, more])
            moved = image.of(piece)
            self.table[first : self._used] = np.concatenate(
                [
                    moved.corners[:-1],
                    moved.corners[1:],
                    moved.pad_low,
                    moved.pad_high,
                    moved.at[:-1, None],
                    moved.at[1:, None],
                ],
                axis=1,
            )
        key = self._keys.setdefault((piece.family, image.key), len(self._keys))
        return wall, key, source, first, first + n
