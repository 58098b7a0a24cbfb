"""The cells of walls in one table, and the runs of them that a subproblem is about.

A row of the table is a cell in one image: joint positions at its two ends, how far below and above
the chord the postures can be, and its ends along the wall. A run of cells is a span. Where parts of
cells turn out to be forbidden, their rows are made shorter, for all subproblems at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import Image, Piece, Wall

COLUMNS = 26  # start 0:6, end 6:12, pad_low 12:18, pad_high 18:24, places 24 and 25
WALL, KEY, SOURCE, FIRST, END = range(5)  # columns of a span
Key = tuple[int, tuple[int, ...], int]  # a family, the key of its image, and the side
FORBIDDEN = 1e3  # [rad] presses on every face of any box by more than is of interest


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
            looks: 1 to look at them, 2 to look closer.

        Returns:
            Where it begins and ends in fractions of the cell, each of shape (n,); it ends before it
            begins where nothing is left.
        """


class Cells:
    """All cells that some subproblem is about; grows.

    Args:
        images: The images of each family, the family itself first.
        cut: Cuts a cell of a wall into smaller ones.
        forbidden: Tells which parts of cells are forbidden; None to allow all.

    Attributes:
        walls: The walls.
        pass_index: The pass of each.
        table: The cells, shape (capacity, 26); rows not in use are at its end.
        changes: How often cells in the table became shorter.
    """

    def __init__(
        self,
        images: Callable[[int], Sequence[Image]],
        cut: Callable[[Piece, int], Sequence[Piece]],
        forbidden: Forbidden | None = None,
    ) -> None:
        self._images = images
        self._cut = cut
        self._forbidden = forbidden
        self.walls: list[Wall] = []
        self.pass_index = np.empty(0, dtype=np.int64)
        self.table = np.empty((1024, COLUMNS))
        self._used = 0
        self._keys: dict[Key, int] = {}
        # piece, number of its image, and whether the whole motion has the wrist flipped
        self._sources: list[tuple[Piece, int, bool]] = []
        self._first: list[int] = []  # cell of each source, -1 for those not in the table yet
        # sources, whether mirrored, and boxes around them
        self._of_wall: list[tuple[np.ndarray, np.ndarray, Array, Array]] = []
        self._finer: dict[tuple[int, int], np.ndarray] = {}
        # sources of a flip of a piece, by its place in memory, and looks at its cells
        self._of_piece: dict[tuple[int, int], list[int]] = {}
        self._looks: dict[tuple[int, int], np.ndarray] = {}
        self.changes = 0

    @property
    def n_keys(self) -> int:
        """Of how many kinds spans are that a pass cannot change between."""
        return len(self._keys)

    def add(self, wall: Wall) -> None:
        """Take in a wall."""
        first, low, high = len(self._sources), [], []
        both = [False, True][: 1 if self._forbidden is None else self._forbidden.n_flips]
        for piece in wall.pieces:
            ends = piece.low.min(axis=0), piece.high.max(axis=0)
            for number, image in enumerate(self._images(piece.family)):
                moved = image.sign * np.array(ends) + image.shift
                for mirrored in both:
                    self._new_source(piece, number, mirrored)
                    low.append(moved.min(axis=0))
                    high.append(moved.max(axis=0))
        sources = np.arange(first, len(self._sources))
        mirrors = np.array([self._sources[source][2] for source in sources.tolist()], dtype=bool)
        boxes = np.reshape(low, (-1, 6)), np.reshape(high, (-1, 6))
        self._of_wall.append((sources, mirrors, *boxes))
        self.walls.append(wall)
        self.pass_index = np.append(self.pass_index, wall.pass_index)

    def keys_of(self, spans: np.ndarray) -> dict[int, list[Key]]:
        """Return the families, images and sides of spans, by pass, as all its walls have them."""
        names = list(self._keys)
        both = np.unique(np.stack([self.pass_index[spans[:, WALL]], spans[:, KEY]]), axis=1)
        found: dict[int, list[Key]] = {}
        for index, key in both.T.tolist():
            found.setdefault(index, []).append(names[key])
        return found

    def mirrored(self, spans: np.ndarray) -> bool:
        """Return whether spans are of whole motions with the wrist flipped."""
        return self._sources[int(spans[0, SOURCE])][2]

    def spans_of(
        self, wall: int, low: Array, high: Array, closing: float, mirrored: bool
    ) -> np.ndarray:
        """Return the spans of a wall that boxes below a size can hold, the core given."""
        sources, mirrors, least, most = self._of_wall[wall]
        edges = np.maximum(least, high) - np.minimum(most, low)
        small = np.maximum(edges, 0.0).sum(axis=1) < closing
        if wall == 0:
            # the whole motion has images: of these the first is looked at, and its flip
            kept = [one for one in sources[small].tolist() if self._sources[one][1] == 0]
        else:
            kept = sources[small & (mirrors == mirrored)].tolist()
        return np.array([self._span(wall, source) for source in kept], np.int64).reshape(-1, 5)

    def finer(self, span: np.ndarray) -> np.ndarray:
        """Return the spans of a single cell cut into smaller ones."""
        wall, _, source, cell, _ = span.tolist()
        at = source, cell
        if at not in self._finer:
            piece, image, mirrored = self._sources[source]
            found = []
            for smaller in self._cut(piece, cell - self._first[source]):
                self._new_source(smaller, image, mirrored)
                found.append(self._span(wall, len(self._sources) - 1))
            self._finer[at] = np.array(found, np.int64).reshape(-1, 5)
        return self._finer[at]

    def cleared(self, spans: np.ndarray, looks: int) -> bool:
        """Make cells of spans shorter by what is forbidden; return whether any became so.

        Args:
            spans: The spans.
            looks: 1 to look at what was not looked at, 2 to look closer.
        """
        if self._forbidden is None:
            return False
        before = self.changes
        for _, _, source, first, end in spans.tolist():
            piece, flip = self._flipped(source)
            cells = slice(first - self._first[source], end - self._first[source])
            at = id(piece), flip
            looked = self._looks.setdefault(at, np.zeros(len(piece.pad_low), int))
            if (looked[cells] >= looks).all():
                continue
            looked[cells] = looks
            rows = self.table[first:end]
            known = rows.copy()
            self._forbidden.clear(piece, flip, cells.start, cells.stop, looks)
            for same in self._of_piece[at]:
                if self._first[same] >= 0:
                    self._enter(same)
            self.changes += int((rows != known).any())
        return self.changes > before

    def _flipped(self, source: int) -> tuple[Piece, int]:
        """Return the piece of a source, and which flip of it the robot makes."""
        piece, number, mirrored = self._sources[source]
        return piece, self._images(piece.family)[number].flip ^ mirrored

    def _new_source(self, piece: Piece, image: int, mirrored: bool) -> None:
        number = len(self._sources)
        self._sources.append((piece, image, mirrored))
        self._first.append(-1)
        self._of_piece.setdefault((id(piece), self._flipped(number)[1]), []).append(number)

    def _span(self, wall: int, source: int) -> tuple[int, int, int, int, int]:
        """Return a whole piece in one image as a span; its cells are entered if they are not."""
        piece, number, _ = self._sources[source]
        image, n = self._images(piece.family)[number], len(piece.pad_low)
        first = self._first[source]
        if first < 0:
            first = self._first[source] = self._used
            self._used += n
            if self._used > len(self.table):
                more = np.empty((self._used, COLUMNS))
                self.table = np.concatenate([self.table, more])
            self._enter(source)
        key = self._keys.setdefault((piece.family, image.key, piece.side), len(self._keys))
        return wall, key, source, first, first + n

    def _enter(self, source: int) -> None:
        """Enter the cells of a source into the table, as far as they are not forbidden."""
        piece, number, _ = self._sources[source]
        moved = self._images(piece.family)[number].of(piece)
        rows = self.table[self._first[source] : self._first[source] + len(piece.pad_low)]
        low, high = np.zeros(len(rows)), np.ones(len(rows))
        if self._forbidden is not None:
            low, high = self._forbidden.clear(*self._flipped(source), 0, 0, 1)
        low, high = low[:, None], high[:, None]
        step, along = np.diff(moved.corners, axis=0), np.diff(moved.at)[:, None]
        rows[:, 0:6] = np.where(low > 0.0, moved.corners[:-1] + low * step, moved.corners[:-1])
        rows[:, 6:12] = np.where(high < 1.0, moved.corners[:-1] + high * step, moved.corners[1:])
        rows[:, 12:18], rows[:, 18:24] = moved.pad_low, moved.pad_high
        none = (low > high)[:, 0]
        rows[none, :12] = np.tile(moved.corners[:-1][none], 2)
        rows[none, 12:18], rows[none, 18:24] = FORBIDDEN, -FORBIDDEN
        rows[:, 24], rows[:, 25] = moved.at[:-1], moved.at[1:]
        some = ~none
        rows[some, 24:25] += (low * along)[some]
        rows[some, 25:26] -= ((1.0 - high) * along)[some]
