"""The least box that holds a point of every wall, by branch and bound over intervals of few walls.

A subproblem allows each wall some spans, runs of cells of a piece. What every box below the
threshold must hold anyway, the core, cuts spans off; a linear program over the convex hulls of what
is left of the walls bounds the size of the box. The box found meets some walls in their hulls only:
the one that it misses most is split. Walls are added while the proof goes on: subproblems split
before they were known are many more than they take, so the tree is begun anew now and then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from itertools import takewhile

import numpy as np

from opl.geometry.frames import Array
from opl.search.bounding import tighten
from opl.search.box import JointBox
from opl.search.branching import best_by_distance, parts, where_to_split
from opl.search.cells import END, FIRST, KEY, WALL, Cells
from opl.search.forbidden import Forbidden
from opl.search.joint_limits import UNLIMITED
from opl.search.open_subproblems import OpenSubproblems
from opl.search.relaxation import least_box
from opl.search.subproblems import Candidate, Relaxation, Subproblem, keys_left, worth_a_price
from opl.search.walls import Image, Piece, Wall

SETTLED = 0.04  # of the gap wanted: what the bend of the spans may lose where none is split further
NUMBERS_OF_A_CELL = 30  # worked on to cut off what no box can hold
NUMBERS_OF_A_WALL, NUMBERS_OF_A_SOURCE = 1e5, 6  # that it is worth to ask one
SHARPER = 1e-5  # of the size: so much less of interest, and a box is bounded again
FURTHER = 1.5  # times a size: cells are at hand for boxes up to there
FEWEST_BEFORE_ANEW, RARER = 256, 1.2  # subproblems of a tree that is begun anew; times that, then
MORE_WALLS = 1.15  # times those that a tree was begun with: it is begun anew for them
FEW = 40  # walls over which linear programs take little time
OTHER_PART = 0.2  # of what the larger of two bounds rises by counts
CLOSER = 2, 3  # looks at what is forbidden, each closer than the one before


class BoxProof:
    """Branch and bound for the least box.

    Args:
        images: The images of each family, the family itself first.
        cut: Cuts a cell of a wall into smaller ones.
        threshold: Boxes of this size or more in [rad] are of no interest.
        gap: Fraction by which the bound may stay below the threshold.
        forbidden: Tells which parts of cells are forbidden: asked only of what is left of a
            subproblem when nothing is gained by splitting it further.
        limits: What a box is within after full turns of all that it holds, where the robot makes
            the motion with each flip of the wrist.
    """

    def __init__(
        self,
        images: Callable[[int], Sequence[Image]],
        cut: Callable[[Piece, int], Sequence[Piece]],
        threshold: float,
        gap: float,
        forbidden: Forbidden | None = None,
        limits: Sequence[JointBox] = UNLIMITED,
    ) -> None:
        self._cells = Cells(images, cut, forbidden, FURTHER * threshold)
        self._gap = gap
        self._limits = limits
        self._tells_flips = forbidden is not None and len(limits) > 1
        self._begin(threshold)

    def _begin(self, threshold: float) -> None:
        self.threshold = threshold
        self.stuck = np.inf  # least bound of what could not be split
        self.subproblems = self._count = self.bounded = 0  # what might have become one is bounded
        self.work = 0.0  # how many numbers were worked on, about
        self._anew_after: float = FEWEST_BEFORE_ANEW
        self._plant(0.0)

    def _plant(self, bound: float) -> None:
        """Begin a tree of subproblems: one of which nothing but a bound is known."""
        self._planted, self._walls_then = self.subproblems, len(self.walls)
        low, high = np.full(6, np.inf), np.full(6, -np.inf)
        nothing = np.empty((0, 5), dtype=np.int64)
        self._open = OpenSubproblems(Subproblem(bound, self._count, nothing, 0, low, high))

    def again(self, threshold: float) -> BoxProof:
        """Return the proof begun again for boxes below another size, with the walls of this one."""
        other = copy(self)
        if threshold > self._cells.reach.size:
            other._cells = self._cells.reaching(FURTHER * threshold)
        other._begin(threshold)
        return other

    def without(self, wall: int) -> BoxProof:
        """Return the proof begun again without one of its walls, by its number."""
        other = copy(self)
        other._cells = self._cells.without(wall)
        other._begin(self.threshold)
        return other

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
        return float(min(self._open.least_bound, self.stuck, self.closing))

    @property
    def closed(self) -> bool:
        """Whether nothing is left that could be smaller than the threshold less the gap."""
        return self._open.least_bound >= self.closing

    def add(self, wall: Wall) -> None:
        """Take in a wall."""
        self._cells.add(wall)

    def take_next(self) -> Candidate | None:
        """Work on the subproblem with the least bound, or on one of a dive.

        Returns:
            Its box, where nothing is gained by splitting it further: the caller adds a wall that
            misses the box, or lowers the threshold, and puts it back; or gives it up.
        """
        grown = len(self.walls) >= MORE_WALLS * self._walls_then
        if grown and self.subproblems >= self._planted + self._anew_after and self.stuck == np.inf:
            self._anew_after *= RARER
            self._plant(self._open.least_bound)
        node = self._open.take()
        self.subproblems += 1
        if node.found is None or node.n_walls < len(self.walls) or self._sharper(node.found):
            if not self._bound(node):
                return None
            if not self._open.diving and self._open.before(node):
                self._open.leave([node])
                return None
        may_lose = SETTLED * self._gap * self.threshold
        self._kept = node
        walls = where_to_split(node, self._cells, self._limits_of(node.spans), may_lose)
        if walls:
            split = self._split(node, walls)
            if self._open.dive_is_due:
                self._open.dive([part for part in split if part.found or self._bound(part)])
            else:
                self._open.leave(split)
            return None
        if node.n_walls < len(self.walls) or self._cells.cleared(node.spans, 1):
            self.put_back()
            return None
        self._open.note_box()
        found = node.found
        assert found is not None
        keys, mirrored = self._cells.keys_of(node.spans), self._cells.mirrored(node.spans)
        return Candidate(node.bound, found.low, found.high, keys, mirrored)

    @property
    def outdated(self) -> bool:
        """Whether the last candidate may be bounded better now."""
        return self._kept.found is not None and self._sharper(self._kept.found)

    @property
    def has_smaller(self) -> bool:
        """Whether a smaller box than the last candidate may be left: that came of a dive."""
        return self._open.before(self._kept)

    def pressing(self) -> Array:
        """Return how hard each wall presses on the faces of the last candidate's box.

        On the upper face of each joint less on its lower one, from -1 to 1, shape (n_walls, 6).
        """
        node = self._kept
        assert node.found is not None
        # against a core turned inside out, so that no face is held by it
        n, low, high = node.n_walls, node.found.high, node.found.low
        box, lost, prices = np.empty((2, 6)), np.empty(n), np.empty((n, 12))
        size = float((low - high).sum())
        table, shifts = self._cells.table, self._cells.shifts
        least_box(table, shifts, node.spans, n, low, high, size, box, lost, prices)
        return np.asarray(prices[:, :6] - prices[:, 6:])

    def look_closer(self, goes_on: Callable[[], bool]) -> bool:
        """Look closer at what is forbidden of the last candidate's spans; return whether any is.

        In a large box that takes long: it ends where `goes_on` says no, asked before each span.
        """
        for looks in CLOSER:
            spans = takewhile(lambda _: goes_on(), self._kept.spans)
            if sum(self._cells.cleared(span[None], looks) for span in spans):
                return True
        return False

    def clear(self, places: Sequence[float], chains: bool) -> bool:
        """Look at what is forbidden of the last candidate's spans at some places, in their order.

        Closely, until any is, then at those of walls that are chains, if wanted; last as closely
        as can be, where the box meets one cell of a chain alone. Return whether any is.
        """
        spans, every = self._kept.spans, list(enumerate(self.walls))
        close, closest = CLOSER
        looks = [(close, [n for n, wall in every if wall.place == place]) for place in places]
        if chains:
            own = [n for n, wall in every if wall.is_chain]
            looks.append((close, own))
            met = np.bincount(spans[:, WALL], spans[:, END] - spans[:, FIRST], len(every))
            looks += [(closest, [n]) for n in own if met[n] == 1]
        return any(self._cells.cleared(spans[np.isin(spans[:, WALL], n)], at) for at, n in looks)

    def put_back(self) -> None:
        """Leave the subproblem of the last candidate open."""
        self._open.leave([self._kept])

    def give_up(self) -> None:
        """Let the subproblem of the last candidate stay as it is; its bound counts."""
        self.stuck = min(self.stuck, self._kept.bound)

    def _sharper(self, found: Relaxation) -> bool:
        lower = self.closing < found.closing * (1.0 - SHARPER)
        return lower or self._cells.changes > found.changes

    def _split(self, node: Subproblem, walls: Sequence[int]) -> list[Subproblem]:
        """Return what is left of a subproblem, split at the wall where that bounds it best.

        Strong branching (Achterberg, Koch and Martin, Oper. Res. Lett. 33, 2005): a wall is worth
        what the lesser of the two bounds rises by, and a little of what the other does. But over
        many walls, or where boxes come soon, distances decide.
        """
        if len(walls) > 1 and (not self._open.box_is_late or node.n_walls > FEW):
            walls = [best_by_distance(node, self._cells, walls)]
        best, most = [], -np.inf
        for wall in walls:
            split = [self._part(node, part) for part in parts(node, self._cells, wall)]
            if len(walls) == 1:
                return split
            if not (left := [part for part in split if self._bound(part)]):
                return []
            bounds = [part.bound for part in left] + [self.closing] * (len(split) - len(left))
            worth = min(bounds) + OTHER_PART * max(bounds)
            if worth > most:
                best, most = left, worth
        return best

    def _part(self, node: Subproblem, spans: np.ndarray) -> Subproblem:
        """Return the part of a subproblem that leads through some spans."""
        self._count += 1
        return Subproblem(node.bound, self._count, spans, node.n_walls, node.low, node.high)

    def _bound(self, node: Subproblem) -> bool:
        """Bound a subproblem; return whether it is still of interest."""
        self.bounded += 1
        cells, closing, n_walls = self._cells, self.closing, len(self.walls)
        if len(node.spans) != 1 and node.n_walls <= 1:
            n_walls = 1  # one span of the first wall tells which images of the others matter
        mirrored = len(node.spans) > 0 and cells.mirrored(node.spans)
        keys, new = {}, []
        if n_walls > node.n_walls:
            keys = keys_left(node.spans, cells.pass_index)
        for wall in range(node.n_walls, n_walls):
            index = int(cells.pass_index[wall])
            self.work += NUMBERS_OF_A_WALL + NUMBERS_OF_A_SOURCE * cells.n_sources(wall)
            new.append(
                cells.spans_of(wall, node.low, node.high, closing, mirrored, keys.get(index))
            )
            keys[index] = np.unique(new[-1][:, KEY])
        spans = np.concatenate([node.spans, *new])
        low, high, table = node.low.copy(), node.high.copy(), cells.table
        sizes, lost = np.empty(n_walls), np.empty(n_walls)
        box, prices = np.empty((2, 6)), np.empty((n_walls, 12))
        limits = np.array([(one.lower, one.upper) for one in self._limits_of(spans)])
        self.work += NUMBERS_OF_A_CELL * float((spans[:, END] - spans[:, FIRST]).sum())
        passes = cells.pass_index[:n_walls], cells.n_keys
        spans = spans[
            : tighten(cells.bounds, cells.shifts, spans, *passes, limits, low, high, closing, sizes)
        ]
        if not len(spans):
            return False
        given = table, cells.shifts, spans[worth_a_price(spans)], n_walls, low, high
        bound, numbers = least_box(*given, closing, box, lost, prices)
        self.work += numbers
        node.bound = max(node.bound, bound, float(sizes.max()))
        if node.bound >= closing:
            return False
        node.spans, node.n_walls, node.low, node.high = spans, n_walls, low, high
        pressed = prices.sum(axis=1)
        node.found = Relaxation(box[0], box[1], lost, pressed, closing, cells.changes)
        return True

    def _limits_of(self, spans: np.ndarray) -> Sequence[JointBox]:
        """Return the limits of a subproblem: of each flip, or of that with which it is made."""
        if not self._tells_flips or np.count_nonzero(spans[:, WALL] == 0) != 1:
            return self._limits
        flip = int(self._cells.mirrored(spans))
        return self._limits[flip : flip + 1]
