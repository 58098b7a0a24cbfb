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
from opl.search.relaxation import Relaxation, least_box_of
from opl.search.spans import Body, Span, fitting, grown
from opl.search.walls import Image, Piece, Wall, relaxed

SETTLED = (
    0.1  # of the gap wanted: what the bend of the spans may lose where no wall is split further
)
PROBE_EVERY = 16  # subproblems: how often a box is shown that is not settled
STILL = 1e-6  # [rad] a core that grows by less in a round has stopped growing
MOST_ROUNDS = 12  # of cutting spans off; more would cut little


@dataclass(order=True)
class Subproblem:
    """Boxes of which it is known through which spans they lead.

    Attributes:
        bound: None of them is smaller, in [rad].
        number: To order those with equal bounds.
        spans: The spans of each wall.
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.
    """

    bound: float
    number: int
    spans: list[list[Span]] = field(compare=False)
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
        self._images = images
        self._cut = cut
        self._gap = gap
        self._bodies: list[Body] = []
        self.threshold = threshold
        self.stuck = np.inf  # least bound of what could not be split
        self.subproblems = 0
        self._count = 0
        self._open: list[Subproblem] = []
        self._push(0.0, [], np.full(6, np.inf), np.full(6, -np.inf))

    @property
    def walls(self) -> list[Wall]:
        """All walls so far."""
        return [body.wall for body in self._bodies]

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
        self._bodies.append(Body(wall, self._images))

    def take_next(self) -> Candidate | None:
        """Work on the subproblem with the least bound.

        Returns:
            Its box, where nothing is gained by splitting it further, and now and then before: the
            caller adds a wall that misses the box, or lowers the threshold, and puts it back; or
            splits it, or gives it up.
        """
        node = heapq.heappop(self._open)
        self.subproblems += 1
        known = len(node.spans)
        if node.found is None or known < len(self._bodies):
            if not self._bound(node, known):
                return None
            if self._open and node.bound > self._open[0].bound + 1e-9:
                heapq.heappush(self._open, node)  # others are more promising now
                return None
        self._kept, self._branch = node, self._where_to_split(node)
        settled = self._branch is None
        if not settled and self.subproblems % PROBE_EVERY:
            self.split()
            return None
        found, alone = node.found, self._alone(node)
        assert found is not None
        held_by = {k: found.prices[i] for i, k in enumerate(alone) if found.prices[i].any()}
        return Candidate(node.bound, found.low, found.high, held_by, settled)

    def split(self) -> None:
        """Split the subproblem of the last candidate."""
        if self._branch is not None:
            self._split(self._kept, *self._branch)

    @staticmethod
    def _alone(node: Subproblem) -> list[int]:
        """Return the walls of which one span is left."""
        return [k for k, spans in enumerate(node.spans) if len(spans) == 1]

    def _bound(self, node: Subproblem, known: int) -> bool:
        """Bound a subproblem; return whether it is still of interest."""
        node.spans = list(node.spans)
        for index in range(known, len(self._bodies)):
            node.spans.append(self._spans_of_new(node, index))
        sizes = self._tighten(node)
        if sizes is None:
            return False
        segments = []
        for k in self._alone(node):
            (span,) = node.spans[k]
            segments.append(relaxed(self._bodies[k].moved(span), span.first, span.end))
        node.found = least_box_of(segments, node.low, node.high)
        node.bound = max(node.bound, node.found.bound, *sizes)
        return node.bound < self.closing

    def put_back(self) -> None:
        """Leave the subproblem of the last candidate open."""
        heapq.heappush(self._open, self._kept)

    def give_up(self) -> None:
        """Let the subproblem of the last candidate stay as it is; its bound counts."""
        self.stuck = min(self.stuck, self._kept.bound)

    def _push(self, bound: float, spans: list[list[Span]], low: Array, high: Array) -> None:
        heapq.heappush(self._open, Subproblem(bound, self._count, spans, low, high))
        self._count += 1

    def _spans_of_new(self, node: Subproblem, index: int) -> list[Span]:
        body = self._bodies[index]
        spans, low, high = body.all_spans
        keep = grown(low, high, node.low, node.high) < self.closing
        if index == 0:
            # the whole motion has images: of these the first is looked at
            keep &= np.array([span.image == 0 for span in spans], dtype=bool)
        elif body.wall.pass_index == self._bodies[0].wall.pass_index:
            first = self._bodies[0]
            keys = {first.key(span) for span in node.spans[0]}
            keep &= np.array([body.key(span) in keys for span in spans], dtype=bool)
        return [span for span, kept in zip(spans, keep, strict=True) if kept]

    def _tighten(self, node: Subproblem) -> list[float] | None:
        """Cut off what no box below the threshold can hold; the least growth for each wall."""
        low, high, closing = node.low.copy(), node.high.copy(), self.closing
        for _ in range(MOST_ROUNDS):
            before = low.copy(), high.copy()
            sizes = []
            for index, body in enumerate(self._bodies):
                kept, least, most = [], np.full(6, np.inf), np.full(6, -np.inf)
                smallest = np.inf
                for span in node.spans[index]:
                    first, end, grown = fitting(
                        *body.whole_box(span), span.first, span.end, low, high, closing, least, most
                    )
                    if first == end:
                        continue
                    kept.append(Span(span.piece, span.image, first, end))
                    smallest = min(smallest, grown)
                if not kept:
                    return None
                node.spans[index] = kept
                high, low = np.maximum(high, least), np.minimum(low, most)
                sizes.append(smallest)
            if not self._link(node):
                return None
            if max(np.abs(before[0] - low).max(), np.abs(before[1] - high).max()) < STILL:
                break
        node.low, node.high = low, high
        return sizes

    def _link(self, node: Subproblem) -> bool:
        """Leave each pass the postures that all of its walls have; whether there are any."""
        keys: dict[int, set[tuple[int, tuple[int, ...]]]] = {}
        for body, spans in zip(self._bodies, node.spans, strict=True):
            own = {body.key(span) for span in spans}
            index = body.wall.pass_index
            keys[index] = keys[index] & own if index in keys else own
        for k, body in enumerate(self._bodies):
            left = keys[body.wall.pass_index]
            node.spans[k] = [span for span in node.spans[k] if body.key(span) in left]
            if not node.spans[k]:
                return False
        return True

    def _where_to_split(self, node: Subproblem) -> tuple[int, float] | None:
        """Return the wall to be split, and where along its span; None if that gains nothing."""
        found, alone = node.found, self._alone(node)
        assert found is not None
        low, high = found.low, found.high
        settled = SETTLED * self._gap * self.threshold
        if len(node.spans[0]) > 1:
            return 0, 0.5
        score, at = np.zeros(len(node.spans)), np.full(len(node.spans), 0.5)
        for index, (body, spans) in enumerate(zip(self._bodies, node.spans, strict=True)):
            score[index] = min(body.distance(span, low, high) for span in spans)
        # where the chords lie, and what their pads cost
        score[alone] = np.maximum(score[alone], np.maximum(found.lost, found.missed))
        at[alone] = found.x
        wall = int(np.argmax(score))
        if score[wall] > settled:
            return wall, float(at[wall])
        return None

    def _split(self, node: Subproblem, index: int, x: float) -> None:
        spans = node.spans[index]
        if len(spans) > 1:
            halves = [[span] for span in spans]
        else:
            (span,) = spans
            body = self._bodies[index]
            if span.end == span.first + 1:
                finer = body.finer(span, self._cut)
                if not finer:
                    return
                (span,) = finer[:1]
                if len(finer) > 1:
                    self._push(
                        node.bound,
                        [*node.spans[:index], finer, *node.spans[index + 1 :]],
                        node.low,
                        node.high,
                    )
                    return
            at = body.pieces[span.piece].at[span.first : span.end + 1]
            n = len(at) - 1
            least = max(n // 8, 1)
            place = int(np.searchsorted(at, at[0] + x * (at[-1] - at[0])))
            middle = span.first + min(max(place, least), n - least)
            halves = [
                [Span(span.piece, span.image, span.first, middle)],
                [Span(span.piece, span.image, middle, span.end)],
            ]
        for half in halves:
            left = list(node.spans)
            left[index] = half
            self._push(node.bound, left, node.low, node.high)
