"""The cells of walls in one table, and the runs of them that a subproblem is about.

A row of the table is a cell in one image: joint positions at its two ends, how far below and above
the chord the postures can be, and its ends along the wall. A run of cells is a span. Where parts of
cells are beyond the limits of joints, or turn out to be forbidden, their rows are made shorter, for
all subproblems at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.forbidden import Forbidden
from opl.search.limit_cuts import within_limits
from opl.search.reach import Reach, around_families, ends_of
from opl.search.walls import Image, Piece, Wall

COLUMNS = 26  # start 0:6, end 6:12, pad_low 12:18, pad_high 18:24, places 24 and 25
WALL, KEY, SOURCE, FIRST, END = range(5)  # columns of a span
# columns of a source: its piece, number of its image, whether the whole motion has the wrist
# flipped, its cells, the first -1 where they are not in the table yet, its kind (family, side and
# image), and which flip of its piece the robot makes
PIECE, IMAGE, MIRRORED, FIRST_CELL, N_CELLS, KIND, FLIP = range(7)
Key = tuple[int, tuple[int, ...], int]  # a family, the key of its image, and the side
FORBIDDEN = 1e3  # [rad] presses on every face of any box by more than is of interest


class Cells:
    """All cells that some subproblem is about; grows.

    Args:
        images: The images of each family, the family itself first.
        cut: Cuts a cell of a wall into smaller ones.
        forbidden: Tells which parts of cells are forbidden; None to allow all.
        limits: As of `BoxProof`; what is beyond all of them is no part of a cell.
        reach: Boxes of this size or more in [rad] are not asked about.

    Attributes:
        walls: The walls.
        pass_index: The pass of each.
        table: The cells, shape (capacity, 26); rows not in use are at its end.
        entered: How many cells were entered into the table, again or for the first time.
        changes: How often cells in the table became shorter.
        reach: Tells which images are left out.
    """

    def __init__(
        self,
        images: Callable[[int], Sequence[Image]],
        cut: Callable[[Piece, int], Sequence[Piece]],
        forbidden: Forbidden | None,
        limits: Sequence[JointBox],
        reach: float = np.inf,
    ) -> None:
        self._limits = limits
        self.reach = Reach(reach)
        self._images = images
        self._cut = cut
        self._forbidden = forbidden
        self.walls: list[Wall] = []
        self.pass_index = np.empty(0, dtype=np.int64)
        self.table = np.empty((1024, COLUMNS))
        self._used = 0
        self._keys: dict[Key, int] = {}
        # a source is a piece in one image; those of a piece follow each other
        self._pieces: list[Piece] = []
        self._sources_of: list[slice] = []
        self._sources = np.empty((1024, 7), dtype=np.int64)
        self._n_sources = 0
        # of each family sign, shift and flip of its images
        self._moves: dict[int, tuple[Array, Array, np.ndarray]] = {}
        self._first_kind: dict[tuple[int, int], int] = {}  # of a family and side
        self._key_of_kind = np.empty(0, dtype=np.int64)  # number of its key, -1 where none has it
        # sources, their kinds, and boxes around them
        self._of_wall: list[tuple[np.ndarray, np.ndarray, Array, Array]] = []
        self._finer: dict[tuple[int, int], np.ndarray] = {}
        self._looks: dict[tuple[int, int], np.ndarray] = {}  # at the cells of a flip of a piece
        self.entered = self.changes = 0

    @property
    def n_keys(self) -> int:
        """Of how many kinds spans are that a pass cannot change between."""
        return len(self._keys)

    def add(self, wall: Wall) -> None:
        """Take in a wall."""
        first, low, high = self._n_sources, [np.empty((0, 6))], [np.empty((0, 6))]
        both = np.arange(1 if self._forbidden is None else self._forbidden.n_flips)
        around = around_families(wall.pieces)
        near = {one: self.reach.near(around, one, *self._moves_of(one)[:2]) for one in around}
        for piece in wall.pieces:
            numbers = near[piece.family]
            sign, shift, _ = (of[numbers] for of in self._moves_of(piece.family))
            moved = np.repeat(sign[:, None] * ends_of(piece) + shift[:, None], len(both), axis=0)
            low.append(moved.min(axis=1))
            high.append(moved.max(axis=1))
            self._new_sources(piece, np.repeat(numbers, len(both)), np.tile(both, len(numbers)))
        sources = np.arange(first, self._n_sources)
        kinds = self._sources[sources, KIND]
        self._of_wall.append((sources, kinds, np.concatenate(low), np.concatenate(high)))
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

    def kinds_of(self, spans: np.ndarray) -> np.ndarray:
        """Return numbers that tell family, side and image of spans, shape (n,)."""
        return np.asarray(self._sources[spans[:, SOURCE], KIND])

    def mirrored(self, spans: np.ndarray) -> bool:
        """Return whether spans are of whole motions with the wrist flipped."""
        return bool(self._sources[spans[0, SOURCE], MIRRORED])

    def spans_of(
        self,
        wall: int,
        low: Array,
        high: Array,
        closing: float,
        mirrored: bool,
        keys: np.ndarray | None = None,
    ) -> np.ndarray:
        """Return the spans of a wall that boxes below a size can hold, the core given.

        Of some keys, by their numbers; None for all.
        """
        sources, kinds, least, most = self._of_wall[wall]
        if keys is not None:
            some = np.flatnonzero(np.isin(self._key_of_kind, keys)[kinds])
            sources, least, most = sources[some], least[some], most[some]
        if wall == 0:
            # the whole motion has images: of these the first is looked at, and its flip
            kept = self._sources[sources, IMAGE] == 0
        else:
            kept = self._sources[sources, MIRRORED] == mirrored
        edges = np.maximum(least, high) - np.minimum(most, low)
        kept &= np.maximum(edges, 0.0).sum(axis=1) < closing
        return self._spans(wall, sources[kept])

    def n_sources(self, wall: int) -> int:
        """Return in how many images its pieces may cross a wall."""
        return len(self._of_wall[wall][0])

    def finer(self, span: np.ndarray) -> np.ndarray:
        """Return the spans of a single cell cut into smaller ones."""
        wall, _, source, cell, _ = span.tolist()
        at = source, cell
        if at not in self._finer:
            number, image, mirrored, first = self._sources[source, : FIRST_CELL + 1].tolist()
            begin = self._n_sources
            for smaller in self._cut(self._pieces[number], cell - first):
                self._new_sources(smaller, np.array([image]), np.array([mirrored]))
            self._finer[at] = self._spans(wall, np.arange(begin, self._n_sources))
        return self._finer[at]

    def cleared(self, spans: np.ndarray, looks: int) -> bool:
        """Make cells of spans shorter by what is forbidden; return whether any became so.

        Args:
            spans: The spans.
            looks: 1 to look at what was not looked at, 2 and 3 to look closer.
        """
        if self._forbidden is None:
            return False
        before = self.changes
        for _, _, source, first, end in spans.tolist():
            number, _, _, first_cell, _, _, flip = self._sources[source].tolist()
            piece = self._pieces[number]
            cells = slice(first - first_cell, end - first_cell)
            looked = self._looks.setdefault((number, flip), np.zeros(len(piece.pad_low), int))
            if (looked[cells] >= looks).all():
                continue
            looked[cells] = looks
            rows = self.table[first:end]
            known = rows.copy()
            self._forbidden.clear(piece, flip, cells.start, cells.stop, looks)
            same = self._sources_of[number]
            alike = (self._sources[same, FLIP] == flip) & (self._sources[same, FIRST_CELL] >= 0)
            self._enter(same.start + np.flatnonzero(alike))
            self.changes += int((rows != known).any())
        return self.changes > before

    def reaching(self, reach: float) -> Cells:
        """Return the cells of the same walls for boxes up to another size in [rad]."""
        others = Cells(self._images, self._cut, self._forbidden, self._limits, reach)
        for wall in self.walls:
            others.add(wall)
        return others

    def _moves_of(self, family: int) -> tuple[Array, Array, np.ndarray]:
        """Return sign, shift, shape (n, 6), and flip, shape (n,), of the images of a family."""
        if family not in self._moves:
            images = self._images(family)
            sign, shift = np.array([image.sign for image in images]), [one.shift for one in images]
            self._moves[family] = sign, np.array(shift), np.array([one.flip for one in images])
        return self._moves[family]

    def _kinds_of(self, family: int, side: int) -> int:
        """Return the kind of the first image of a family on a side; those of others follow."""
        if (family, side) not in self._first_kind:
            self._first_kind[family, side] = len(self._key_of_kind)
            more = np.full(len(self._images(family)), -1, dtype=np.int64)
            self._key_of_kind = np.concatenate([self._key_of_kind, more])
        return self._first_kind[family, side]

    def _new_sources(self, piece: Piece, numbers: np.ndarray, mirrored: np.ndarray) -> None:
        """Note a piece in some of its images."""
        first, end = self._n_sources, self._n_sources + len(numbers)
        self._sources = _with_room(self._sources, end)
        new = self._sources[first:end]
        new[:, PIECE], new[:, IMAGE], new[:, MIRRORED] = len(self._pieces), numbers, mirrored
        new[:, FIRST_CELL], new[:, N_CELLS] = -1, len(piece.pad_low)
        new[:, KIND] = self._kinds_of(piece.family, piece.side) + numbers
        # the one that the robot makes
        new[:, FLIP] = self._moves_of(piece.family)[2][numbers] ^ mirrored
        self._pieces.append(piece)
        self._sources_of.append(slice(first, end))
        self._n_sources = end

    def _spans(self, wall: int, sources: np.ndarray) -> np.ndarray:
        """Return whole pieces as spans; cells that are not in the table are entered."""
        new = sources[self._sources[sources, FIRST_CELL] < 0]
        if len(new):
            n_cells = self._sources[new, N_CELLS]
            self._sources[new, FIRST_CELL] = self._used + np.cumsum(n_cells) - n_cells
            self._used += int(n_cells.sum())
            self.table = _with_room(self.table, self._used)
            self._name(new)
            for number in np.unique(self._sources[new, PIECE]).tolist():
                own = new[self._sources[new, PIECE] == number]
                for flip in np.unique(self._sources[own, FLIP]).tolist():
                    self._enter(own[self._sources[own, FLIP] == flip])
        of = self._sources[sources]
        ends = of[:, FIRST_CELL] + of[:, N_CELLS]
        walls = np.full(len(sources), wall)
        return np.stack(
            [walls, self._key_of_kind[of[:, KIND]], sources, of[:, FIRST_CELL], ends], axis=1
        )

    def _name(self, sources: np.ndarray) -> None:
        """Give the keys of sources their numbers."""
        nameless = sources[self._key_of_kind[self._sources[sources, KIND]] < 0]
        for number, image, kind in self._sources[nameless][:, [PIECE, IMAGE, KIND]].tolist():
            piece = self._pieces[number]
            key = piece.family, self._images(piece.family)[image].key, piece.side
            self._key_of_kind[kind] = self._keys.setdefault(key, len(self._keys))

    def _enter(self, sources: np.ndarray) -> None:
        """Enter the cells of sources into the table, as far as they are not forbidden.

        Those of one piece, which the robot makes with the same flip of the wrist.
        """
        piece = self._pieces[self._sources[sources[0], PIECE]]
        sign, shift, _ = self._moves_of(piece.family)
        number, n = self._sources[sources, IMAGE], len(piece.pad_low)
        mirrored = sign[number, None] < 0.0
        corners = piece.corners * sign[number, None] + shift[number, None]
        start, end = corners[:, :-1], corners[:, 1:]
        rows = np.empty((len(sources), n, COLUMNS))
        rows[..., 0:6], rows[..., 6:12] = start, end
        rows[..., 12:18] = np.where(mirrored, -piece.pad_high, piece.pad_low)
        rows[..., 18:24] = np.where(mirrored, -piece.pad_low, piece.pad_high)
        rows[..., 24], rows[..., 25] = piece.at[:-1], piece.at[1:]
        low, high = within_limits(rows, self._limits)
        if self._forbidden is not None:
            flip = int(self._sources[sources[0], FLIP])
            begin, until = self._forbidden.clear(piece, flip, 0, 0, 1)
            low, high = np.maximum(low, begin), np.minimum(high, until)
        none, step, along = low > high, end - start, np.diff(piece.at)
        begins, ends = (low > 0.0) & ~none, (high < 1.0) & ~none
        rows[begins, 0:6] += (low[..., None] * step)[begins]
        rows[ends, 6:12] = (start + high[..., None] * step)[ends]
        rows[none, 6:12] = start[none]
        rows[none, 12:18], rows[none, 18:24] = FORBIDDEN, -FORBIDDEN
        rows[..., 24] += np.where(none, 0.0, low * along)
        rows[..., 25] -= np.where(none, 0.0, (1.0 - high) * along)
        self.table[self._sources[sources, FIRST_CELL][:, None] + np.arange(n)] = rows
        self.entered += len(sources) * n


def _with_room(table: Any, rows: int) -> Any:
    """Return a table with room for so many rows, twice of what it had at the least."""
    if rows <= len(table):
        return table
    larger = np.empty((max(rows, 2 * len(table)), *table.shape[1:]), table.dtype)
    larger[: len(table)] = table
    return larger
