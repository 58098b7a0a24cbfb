"""The cells of walls in one table, and the runs of them that a subproblem is about.

A run of cells in one image is a span. Images that only full turns tell apart share rows, each of
them shifted. What turns out to be forbidden of cells is cut off their rows, for all subproblems.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np

from opl.geometry.frames import Array
from opl.search.cell_rows import COLUMNS, bounds_of, rows_of, with_room
from opl.search.forbidden import Forbidden
from opl.search.reach import Reach, around_families
from opl.search.walls import FLIPS, Image, Moves, Piece, Wall

WALL, KEY, SOURCE, FIRST, END = range(5)  # columns of a span
IMAGE, ROWS, N_CELLS, KIND = range(4)  # columns of a source; its kind: family, side and image
ROWS_OF_A_PIECE = FLIPS * FLIPS  # for each flip of its image, and of the wrist of the whole motion
Key = tuple[int, tuple[int, ...], int]  # a family, the key of its image, and the side


class Cells:
    """All cells that some subproblem is about; grows.

    Args:
        images: The images of each family, the family itself first. Only full turns tell those
            with the same flip apart.
        cut: Cuts a cell of a wall into smaller ones.
        forbidden: Tells which parts of cells are forbidden; None to allow all.
        reach: Boxes of this size or more in [rad] are not asked about.

    Attributes:
        walls: The walls.
        pass_index: The pass of each.
        table: The cells, shape (capacity, 26); rows not in use are at its end.
        bounds: What each is within: least and greatest joint positions in [rad], (capacity, 12).
        shifts: What the cells of each source are shifted by in [rad], shape (capacity, 6).
        changes: How often cells in the table became shorter.
        reach: Tells which images are left out.
    """

    def __init__(
        self,
        images: Callable[[int], Sequence[Image]],
        cut: Callable[[Piece, int], Sequence[Piece]],
        forbidden: Forbidden | None,
        reach: float = np.inf,
    ) -> None:
        self.reach = Reach(reach)
        self._images = images
        self._cut = cut
        self._forbidden = forbidden
        self.walls: list[Wall] = []
        self.pass_index = np.empty(0, dtype=np.int64)
        self.table, self.bounds = np.empty((1024, COLUMNS)), np.empty((1024, 12))
        self._used = 0
        self._keys: dict[Key, int] = {}
        # a source is a piece in one image
        self._pieces: list[Piece] = []
        self._sources = np.empty((1024, 4), dtype=np.int64)
        self.shifts = np.empty((1024, 6))
        self._n_sources = 0
        # where rows begin in the table, -1 where they are not entered yet
        self._first_cell = np.empty(0, dtype=np.int64)
        self._moves: dict[int, Moves] = {}
        self._first_kind: dict[tuple[int, int], int] = {}  # of a family and side
        self._key_of_kind = np.empty(0, dtype=np.int64)  # number of its key, -1 where none has it
        # sources, their kinds, and boxes around them
        self._of_wall: list[tuple[np.ndarray, np.ndarray, Array, Array]] = []
        self._finer: dict[tuple[int, int], np.ndarray] = {}
        self._looks: dict[tuple[int, int], np.ndarray] = {}  # at the cells of a flip of a piece
        self.changes = 0

    @property
    def n_keys(self) -> int:
        """Of how many kinds spans are that a pass cannot change between."""
        return len(self._keys)

    def add(self, wall: Wall) -> None:
        """Take in a wall."""
        first, low, high = self._n_sources, [np.empty((0, 6))], [np.empty((0, 6))]
        both = np.arange(1 if self._forbidden is None else self._forbidden.n_flips)
        around = around_families(wall.pieces)
        for family in around:
            pieces = [piece for piece in wall.pieces if piece.family == family]
            moves = self._moves_of(family)
            numbers = self.reach.near(around, family, moves)
            sign, shift = moves.sign[numbers, None], moves.shift[numbers, None]
            ends = np.array([piece.ends for piece in pieces])[:, None]
            moved = (sign * ends + shift).reshape(-1, 2, 6)
            low.append(np.repeat(np.minimum(*moved.swapaxes(0, 1)), len(both), axis=0))
            high.append(np.repeat(np.maximum(*moved.swapaxes(0, 1)), len(both), axis=0))
            self._note(pieces, np.repeat(numbers, len(both)), np.tile(both, len(numbers)))
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
        return bool(self._sources[spans[0, SOURCE], ROWS] % FLIPS)

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
            kept = self._sources[sources, ROWS] % FLIPS == mirrored
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
            (image, rows, _, _), begin = self._sources[source].tolist(), self._n_sources
            smaller = self._cut(self._piece(rows), cell - int(self._first_cell[rows]))
            if smaller:
                self._note(smaller, np.array([image]), np.array([rows % FLIPS]))
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
        touched: dict[tuple[int, int], None] = {}
        before: list[tuple[slice, np.ndarray]] = []  # rows of the table, as they were
        for _, _, source, first, end in spans.tolist():
            rows = int(self._sources[source, ROWS])
            number, flip = rows // ROWS_OF_A_PIECE, _flip_made(rows)
            piece, first_cell = self._piece(rows), int(self._first_cell[rows])
            cells = slice(first - first_cell, end - first_cell)
            looked = self._looks.setdefault((number, flip), np.zeros(len(piece.pad_low), int))
            if (looked[cells] >= looks).all():
                continue
            looked[cells] = looks
            self._forbidden.clear(piece, flip, cells.start, cells.stop, looks)
            touched[number, flip] = None
            before.append((slice(first, end), self.table[first:end].copy()))
        for number, flip in touched:
            same = range(number * ROWS_OF_A_PIECE, (number + 1) * ROWS_OF_A_PIECE)
            entered = [one for one in same if self._first_cell[one] >= 0]
            self._enter([one for one in entered if _flip_made(one) == flip])
        changed = sum(bool((self.table[at] != known).any()) for at, known in before)
        self.changes += changed
        return changed > 0

    def reaching(self, reach: float) -> Cells:
        """Return the cells of the same walls for boxes up to another size in [rad]."""
        return self._anew(self.walls, reach)

    def without(self, wall: int) -> Cells:
        """Return the cells of all walls but one, for boxes up to the same size."""
        if wall == 0:  # it tells which images are left out
            return self._anew(self.walls[1:], self.reach.size)
        other = copy(self)
        for name, value in vars(self).items():  # what grows does so apart
            if isinstance(value, list | dict | np.ndarray):
                setattr(other, name, copy(value))
        del other.walls[wall], other._of_wall[wall]
        other.pass_index = np.delete(self.pass_index, wall)
        other._finer, other._looks = {}, {}  # of walls by their numbers
        return other

    def _anew(self, walls: Sequence[Wall], reach: float) -> Cells:
        others = Cells(self._images, self._cut, self._forbidden, reach)
        for wall in walls:
            others.add(wall)
        return others

    def _moves_of(self, family: int) -> Moves:
        if family not in self._moves:
            self._moves[family] = Moves.of(self._images(family))
        return self._moves[family]

    def _kinds_of(self, family: int, side: int) -> int:
        """Return the kind of the first image of a family on a side; those of others follow."""
        if (family, side) not in self._first_kind:
            self._first_kind[family, side] = len(self._key_of_kind)
            more = np.full(len(self._images(family)), -1, dtype=np.int64)
            self._key_of_kind = np.concatenate([self._key_of_kind, more])
        return self._first_kind[family, side]

    def _note(self, pieces: Sequence[Piece], numbers: np.ndarray, mirrored: np.ndarray) -> None:
        """Note pieces of one family as sources, each in some of its images.

        Args:
            pieces: The pieces.
            numbers: Of the images, shape (n,).
            mirrored: Whether the whole motion has the wrist flipped, likewise.
        """
        moves = self._moves_of(pieces[0].family)
        own = np.arange(len(self._pieces), len(self._pieces) + len(pieces))
        image = np.tile(numbers, len(pieces))
        rows = (ROWS_OF_A_PIECE * own[:, None] + FLIPS * moves.flip[numbers] + mirrored).ravel()
        n_cells = np.repeat([len(piece.pad_low) for piece in pieces], len(numbers))
        first_kind = [self._kinds_of(piece.family, piece.side) for piece in pieces]
        kind = np.repeat(first_kind, len(numbers)) + image
        first, end = self._n_sources, self._n_sources + len(image)
        self._sources, self.shifts = with_room(self._sources, end), with_room(self.shifts, end)
        self._sources[first:end] = np.stack([image, rows, n_cells, kind], axis=1)
        self.shifts[first:end] = moves.shift[image] - moves.shift[moves.first[moves.flip[image]]]
        self._pieces += pieces
        missing = np.full(len(pieces) * ROWS_OF_A_PIECE, -1, dtype=np.int64)
        self._first_cell = np.concatenate([self._first_cell, missing])
        self._n_sources = end

    def _spans(self, wall: int, sources: np.ndarray) -> np.ndarray:
        """Return whole pieces as spans; rows that are not in the table are entered."""
        rows, n_cells, kinds = self._sources[sources, 1:].T
        new = np.unique(rows[self._first_cell[rows] < 0]).tolist()
        for number in new:
            self._first_cell[number] = self._used
            self._used += len(self._piece(number).pad_low)
        self.table, self.bounds = (with_room(one, self._used) for one in (self.table, self.bounds))
        self._enter(new)
        self._name(sources[self._key_of_kind[kinds] < 0])
        walls, first = np.full(len(sources), wall), self._first_cell[rows]
        return np.stack([walls, self._key_of_kind[kinds], sources, first, first + n_cells], axis=1)

    def _name(self, sources: np.ndarray) -> None:
        """Give the keys of sources their numbers."""
        for image, rows, _, kind in self._sources[sources].tolist():
            piece = self._piece(rows)
            key = piece.family, self._images(piece.family)[image].key, piece.side
            self._key_of_kind[kind] = self._keys.setdefault(key, len(self._keys))

    def _enter(self, numbers: Sequence[int]) -> None:
        """Enter rows into the table, as far as they are not forbidden."""
        alike: dict[tuple[int, int], list[int]] = {}
        for number in numbers:
            alike.setdefault((self._piece(number).family, number // FLIPS % FLIPS), []).append(
                number
            )
        for (family, flip), own in alike.items():
            moves, pieces = self._moves_of(family), [self._piece(number) for number in own]
            sign, shift = moves.sign[moves.first[flip]], moves.shift[moves.first[flip]]
            left = []
            if self._forbidden is not None:
                made = zip(pieces, map(_flip_made, own), strict=True)
                left = [self._forbidden.clear(*one, 0, 0, 1) for one in made]
            rows = rows_of(pieces, sign, shift, left)
            counts = [len(piece.pad_low) for piece in pieces]
            before = np.cumsum(counts) - counts
            at = np.repeat(self._first_cell[own] - before, counts) + np.arange(len(rows))
            self.table[at], self.bounds[at] = rows, bounds_of(rows)

    def _piece(self, rows: int) -> Piece:
        return self._pieces[rows // ROWS_OF_A_PIECE]


def _flip_made(rows: int) -> int:
    """Return which flip of a piece the robot makes, given its rows."""
    return (rows // FLIPS ^ rows) % FLIPS
