"""The least box that holds a point of every wall, by branch and bound over intervals of few walls.

A subproblem allows each wall some spans, runs of cells of a piece. What every box below the
threshold must hold anyway, the core, cuts spans off; a linear program over the walls with one span
left bounds the size of the box. What the bound loses to the bend of a span is told by the prices of
the linear program: there the subproblem is split. Walls are added while the proof goes on.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from opl.geometry.frames import Array
from opl.search.bounding import distance, tighten, trim
from opl.search.cells import END, FIRST, WALL, Cells
from opl.search.relaxation import least_box
from opl.search.walls import Image, Piece, Wall

SETTLED = 0.1  # of the gap wanted: what the bend of the spans may lose where none is split further
MOST_TRIMS = 6  # of spans, before one is split
TRIMMED = 0.9  # of the cells: more left, and trimming goes on no longer
PROBE_EVERY = 16  # subproblems: how often a box is shown that is not settled


@dataclass(frozen=True)
class Relaxation:
    """The least box of the walls that have one span left.

    Attributes:
        alone: Those walls, shape (k,).
        low: Lower faces of the box found, shape (6,).
        high: Upper faces.
        x: Where on each span, 0 to 1, shape (k,).
        cost: How much larger it could be if a span had no pads, or what the box misses of it
            without them, in [rad], shape (k,).
        prices: How hard each span presses on each upper face of the box, and on each lower one,
            from 0 to 1, shape (k, 6, 2).
    """

    alone: np.ndarray
    low: Array
    high: Array
    x: Array
    cost: Array
    prices: Array


@dataclass(order=True)
class Subproblem:
    """Boxes of which it is known through which spans they lead.

    Attributes:
        bound: None of them is smaller, in [rad].
        number: To order those with equal bounds.
        spans: The spans, sorted by their walls, columns as in `cells`, shape (n, 5).
        n_walls: Of how many walls.
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.
    """

    bound: float
    number: int
    spans: np.ndarray = field(compare=False)
    n_walls: int = field(compare=False)
    low: Array = field(compare=False)
    high: Array = field(compare=False)
    found: Relaxation | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Candidate:
    """A box that holds a point of every wall, as far as the proof can tell.

    Attributes:
        bound: Of its subproblem in [rad].
        low: Lower faces in [rad], shape (6,).
        high: Upper faces.
        held_by: For each wall, how hard it presses on the box.
        settled: Whether nothing is gained by splitting its subproblem further.
    """

    bound: float
    low: Array
    high: Array
    held_by: dict[int, Array]
    settled: bool


class BoxProof:
    """Branch and bound for the least box.

    Args:
        images: The images of each family, the family itself first.
        cut: Cuts a cell of a wall into smaller ones.
        threshold: Boxes of this size or more in [rad] are of no interest.
        gap: Fraction by which the bound may stay below the threshold.
    """

    def __init__(
        self,
        images: Callable[[int], Sequence[Image]],
        cut: Callable[[Piece, int], Sequence[Piece]],
        threshold: float,
        gap: float,
    ) -> None:
        self._cells = Cells(images, cut)
        self._gap = gap
        self.threshold = threshold
        self.stuck = np.inf  # least bound of what could not be split
        self.subproblems = 0
        self._count = 0
        self._open: list[Subproblem] = []
        nothing = np.empty((0, 5), dtype=np.int64)
        self._push(0.0, nothing, 0, np.full(6, np.inf), np.full(6, -np.inf))

    @property
    def walls(self) -> list[Wall]:
        """All walls so far."""
        return self._cells.walls

    @property
    def closing(self) -> float:
        """Subproblems with this bound are closed, in [rad]."""
        return self.threshold * (1.0 - self._gap)

    @property
    def lower_bound(self) -> float:
        """No box that holds a point of every wall is smaller, in [rad]."""
        least = self._open[0].bound if self._open else np.inf
        return float(min(least, self.stuck, self.closing))

    @property
    def closed(self) -> bool:
        """Whether nothing is left that could be smaller than the threshold less the gap."""
        return not self._open or self._open[0].bound >= self.closing

    def add(self, wall: Wall) -> None:
        """Take in a wall."""
        self._cells.add(wall)

    def take_next(self) -> Candidate | None:
        """Work on the subproblem with the least bound.

        Returns:
            Its box, where nothing is gained by splitting it further, and now and then before: the
            caller adds a wall that misses the box, or lowers the threshold, and puts it back; or
            splits it, or gives it up.
        """
        node = heapq.heappop(self._open)
        self.subproblems += 1
        if node.found is None or node.n_walls < len(self.walls):
            if not self._bound(node):
                return None
            if self._open and node.bound > self._open[0].bound + 1e-9:
                heapq.heappush(self._open, node)  # others are more promising now
                return None
        self._kept, self._branch = node, self._where_to_split(node)
        settled = self._branch is None
        if not settled and self.subproblems % PROBE_EVERY:
            self.split()
            return None
        found = node.found
        assert found is not None
        alone = found.alone.tolist()
        held_by = {k: found.prices[i] for i, k in enumerate(alone) if found.prices[i].any()}
        return Candidate(node.bound, found.low, found.high, held_by, settled)

    @property
    def kept_spans(self) -> list[tuple[int, Array]]:
        """The wall and the cells of each span of the last candidate, as in the table of `Cells`."""
        spans = self._kept.spans[:, [WALL, FIRST, END]].tolist()
        return [(wall, self._cells.table[first:end]) for wall, first, end in spans]

    def split(self) -> None:
        """Split the subproblem of the last candidate."""
        if self._branch is not None:
            self._split(self._kept, *self._branch)

    def put_back(self) -> None:
        """Leave the subproblem of the last candidate open."""
        heapq.heappush(self._open, self._kept)

    def give_up(self) -> None:
        """Let the subproblem of the last candidate stay as it is; its bound counts."""
        self.stuck = min(self.stuck, self._kept.bound)

    def _push(self, bound: float, spans: np.ndarray, n_walls: int, low: Array, high: Array) -> None:
        heapq.heappush(self._open, Subproblem(bound, self._count, spans, n_walls, low, high))
        self._count += 1

    def _bound(self, node: Subproblem) -> bool:
        """Bound a subproblem; return whether it is still of interest."""
        cells, closing, n_walls = self._cells, self.closing, len(self.walls)
        new = [
            cells.spans_of(wall, node.low, node.high, closing)
            for wall in range(node.n_walls, n_walls)
        ]
        spans = np.concatenate([node.spans, *new])
        low, high, sizes = node.low.copy(), node.high.copy(), np.empty(n_walls)
        box, table = np.empty((2, 6)), cells.table
        for _ in range(MOST_TRIMS):
            arguments = spans, cells.pass_index, cells.n_keys, low, high, closing, sizes
            left = tighten(table, *arguments)
            if left == 0:
                return False
            spans = spans[:left]
            alone = np.flatnonzero(np.bincount(spans[:, WALL], minlength=n_walls) == 1)
            at = np.isin(spans[:, WALL], alone)
            only, k = spans[at], len(alone)
            x, lost, missed, prices = np.empty(k), np.empty(k), np.empty(k), np.empty((k, 6, 2))
            filled = box[0], box[1], x, lost, missed, prices
            bound = least_box(table, only, low, high, *filled)
            before = (only[:, END] - only[:, FIRST]).sum()
            bound = max(bound, trim(table, only, prices, low, high, closing), float(sizes.max()))
            node.bound = max(node.bound, bound)
            if node.bound >= closing:
                return False
            spans[at] = only
            if (only[:, END] - only[:, FIRST]).sum() > TRIMMED * before:
                break
        node.spans, node.n_walls, node.low, node.high = spans, n_walls, low, high
        node.found = Relaxation(alone, box[0], box[1], x, np.maximum(lost, missed), prices)
        return True

    def _where_to_split(self, node: Subproblem) -> tuple[int, float] | None:
        """Return the wall to be split, and where along its span; None if that gains nothing."""
        found, walls = node.found, node.spans[:, WALL]
        assert found is not None
        if np.count_nonzero(walls == 0) > 1:
            return 0, 0.5
        score, at = np.full(node.n_walls, np.inf), np.full(node.n_walls, 0.5)
        for wall, (first, end) in zip(walls.tolist(), node.spans[:, FIRST:].tolist(), strict=True):
            away = distance(self._cells.table, first, end, found.low, found.high)
            score[wall] = min(score[wall], away)
        # where the chords lie, and what their pads cost
        score[found.alone] = np.maximum(score[found.alone], found.cost)
        at[found.alone] = found.x
        wall = int(np.argmax(score))
        if score[wall] > SETTLED * self._gap * self.threshold:
            return wall, float(at[wall])
        return None

    def _split(self, node: Subproblem, wall: int, x: float) -> None:
        before, end = np.searchsorted(node.spans[:, WALL], [wall, wall + 1])
        own = node.spans[before:end]
        halves = [own[k : k + 1] for k in range(len(own))]
        if len(own) == 1:
            if own[0, END] == own[0, FIRST] + 1:
                own = self._cells.finer(own[0])
            halves = [own]
            if len(own) == 0:
                return
        if len(own) == 1:
            at = self._cells.table[own[0, FIRST] : own[0, END], 24]
            stop = self._cells.table[own[0, END] - 1, 25]
            n, least = len(at), max(len(at) // 8, 1)
            place = int(np.searchsorted(at, at[0] + x * (stop - at[0])))
            middle = own[0, FIRST] + min(max(place, least), n - least)
            halves = [own.copy(), own.copy()]
            halves[0][0, END] = halves[1][0, FIRST] = middle
        for half in halves:
            spans = np.concatenate([node.spans[:before], half, node.spans[end:]])
            self._push(node.bound, spans, node.n_walls, node.low, node.high)
