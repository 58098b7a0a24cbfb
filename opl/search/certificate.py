"""The least joint range sum there is, with proof.

The joint range sum of a track is the size of the box that its nodes span, so the question is which
smallest box holds a connected track. This is answered by branch and bound. A subproblem gives each
column an interval of rows; its core is what every box must contain that holds a node of each column
from its interval. The size of the core is a lower bound. The subproblem with the least bound is
taken next; the interval of the column that costs most to take in is halved.

Two things make it fast. A box is held up by few columns, so only those are looked at; one more is
added whenever it does not fit in an otherwise finished box. And a node that cannot lie in any box
smaller than the best known is out, which enlarges the core, which puts more nodes out.
"""

from __future__ import annotations

import heapq
import time
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.search.bottleneck import bottleneck
from opl.search.box import JointBox, grow, size_of, tighten
from opl.search.ladder import Ladder
from opl.search.strips import no_strips

GROW_EVERY = 256  # subproblems between two attempts at a better track


@dataclass(frozen=True)
class Certificate:
    """What is proven about the smallest box of a ladder.

    Attributes:
        lower_bound: No connected track has a smaller joint range sum, in [rad]; the bound that was
            given, less the gap, if there is none smaller than that, infinite if there is none.
        rows: The best track found, shape (n_columns,), or None.
        box: The box that it spans, or None.
        subproblems: How many were looked at.
        finished: Whether the proof came to its end, within the requested gap.
    """

    lower_bound: float
    rows: np.ndarray | None
    box: JointBox | None
    subproblems: int
    finished: bool


def least_box(
    ladder: Ladder,
    blocked: np.ndarray,
    *,
    bound: float = np.inf,
    gap: float = 0.0,
    seconds: float = np.inf,
) -> Certificate:
    """Find the smallest box that holds a connected track, or prove how small it can be at most.

    Args:
        ladder: The nodes and what steps are small enough.
        blocked: Sorted keys of steps that are not free, int64.
        bound: Only boxes smaller than this matter, in [rad].
        gap: Stop when the best box is proven to be within this fraction of the least.
        seconds: Stop after this time with what is known.
    """
    run = BoxProof(ladder, blocked, bound, gap)
    deadline = time.monotonic() + seconds
    finished = True
    while run.open_bound() < run.threshold():
        if time.monotonic() > deadline:
            finished = False
            break
        run.take_next()
    # what was left out was at least as large as the best was at the time, less the gap
    lower_bound = min(run.open_bound(), run.best * (1.0 - gap))
    box = None if run.rows is None else run.box_of(run.rows)
    return Certificate(lower_bound, run.rows, box, run.subproblems, finished)


class BoxProof:
    """One run of branch and bound.

    Args:
        ladder: The nodes and what steps are small enough.
        blocked: Sorted keys of steps that are not free, int64.
        bound: Only boxes smaller than this matter, in [rad].
        gap: Fraction within which the best box is to be proven.
    """

    def __init__(self, ladder: Ladder, blocked: np.ndarray, bound: float, gap: float) -> None:
        self.best = bound
        self.rows: np.ndarray | None = None
        self.subproblems = 0
        self._ladder = ladder
        self._q = ladder.q_by_joint
        self._steps = (*ladder.edge_rule, np.asarray(blocked, dtype=np.int64))
        self._gap = gap
        n_columns, n_rows = ladder.free.shape
        self._strips = no_strips(n_columns, n_rows)
        self._columns = sorted(
            {0, n_columns // 4, n_columns // 2, 3 * n_columns // 4, n_columns - 1}
        )
        self._queue: list[tuple[float, int, np.ndarray, np.ndarray, Array, Array]] = []
        self._count = 0
        first = np.zeros(n_columns, dtype=np.int64)
        last = np.full(n_columns, n_rows - 1, dtype=np.int64)
        if ladder.free.any(axis=1).all():
            self._push(0.0, first, last, np.full(6, np.inf), np.full(6, -np.inf))

    def open_bound(self) -> float:
        """Return the least bound of all that is still open, infinite if nothing is."""
        return self._queue[0][0] if self._queue else np.inf

    def threshold(self) -> float:
        """Return the size from which a box is of no interest."""
        return self.best * (1.0 - self._gap) - 1e-9 if np.isfinite(self.best) else np.inf

    def box_of(self, rows: np.ndarray) -> JointBox:
        """Return the box that the nodes of a track span."""
        q = self._ladder.q[np.arange(len(rows)), rows]
        return JointBox(q.min(axis=0), q.max(axis=0))

    def take_next(self) -> None:
        """Finish the subproblem with the least bound, or put its halves in the queue."""
        bound, _, first, last, low, high = heapq.heappop(self._queue)
        tightened, column = self._tighten(first, last, low, high)
        if not np.isfinite(tightened):
            return
        self.subproblems += 1
        bound = max(bound, tightened)
        if self.subproblems % GROW_EVERY == 1:
            self._improve(first, last, low, high)
        if tightened > size_of(low, high) + 1e-9:
            self._halve(bound, column, first, last, low, high)
        else:
            self._settle(bound, first, last, low, high)

    def _settle(
        self, bound: float, first: np.ndarray, last: np.ndarray, low: Array, high: Array
    ) -> None:
        """Ask whether there is a track, now that the core holds every column looked at."""
        least, column, rows = self._bottleneck(first, last, low, high)
        if not np.isfinite(least):
            return
        self._keep(rows)
        if self.box_of(rows).size <= size_of(low, high) + 1e-9:
            return  # the core itself holds a track: nothing smaller is left here
        if least <= size_of(low, high) + 1e-9:
            # each node alone is free, but not all together: some faces of the core are still open
            column = int(np.argmax(last - first))
        if column not in self._columns:
            self._columns.append(column)
            self._improve(first, last, low, high)
            self._push(max(bound, least), first, last, low, high)
        else:
            self._halve(max(bound, least), column, first, last, low, high)

    def _push(
        self, bound: float, first: np.ndarray, last: np.ndarray, low: Array, high: Array
    ) -> None:
        # among equal bounds the latest is taken: deep ones soon end in a track
        self._count += 1
        heapq.heappush(self._queue, (bound, -self._count, first, last, low, high))

    def _halve(
        self,
        bound: float,
        column: int,
        first: np.ndarray,
        last: np.ndarray,
        low: Array,
        high: Array,
    ) -> None:
        middle = (first[column] + last[column]) // 2
        for from_row, to_row in ((first[column], middle), (middle + 1, last[column])):
            half_first, half_last = first.copy(), last.copy()
            half_first[column], half_last[column] = from_row, to_row
            self._push(bound, half_first, half_last, low.copy(), high.copy())

    def _improve(self, first: np.ndarray, last: np.ndarray, low: Array, high: Array) -> None:
        """Try for a better track: the cheapest to reach from a core grown over all columns."""
        low, high = low.copy(), high.copy()
        grow(self._q, self._ladder.free, first, last, low, high)
        size, _, rows = self._bottleneck(first, last, low, high)
        if np.isfinite(size):
            self._keep(rows)

    def _tighten(
        self, first: np.ndarray, last: np.ndarray, low: Array, high: Array
    ) -> tuple[float, int]:
        columns = np.array(self._columns, dtype=np.int64)
        bound, column = tighten(
            self._q, self._ladder.free, columns, first, last, self.threshold(), low, high
        )
        return float(bound), int(column)

    def _bottleneck(
        self, first: np.ndarray, last: np.ndarray, low: Array, high: Array
    ) -> tuple[float, int, np.ndarray]:
        """Return the size of the core with the cheapest track, its dearest column and its rows."""
        rows = np.empty(len(self._q), dtype=np.int64)
        size, column = bottleneck(
            self._q,
            self._ladder.free,
            *self._steps,
            first,
            last,
            low,
            high,
            self.threshold(),
            rows,
            *self._strips.arrays,
        )
        return float(size), int(column), rows

    def _keep(self, rows: np.ndarray) -> None:
        size = self.box_of(rows).size
        if size < self.best:
            self.best, self.rows = size, rows.copy()
