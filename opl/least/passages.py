"""Rectangles of places and contact positions, where tracks leave their boxes between cutter points.

A motion runs through the rectangle from its first place to its last, where postures lie in the box.
Where no way through does, a chain of places and contact positions stands in the way: a wall of the
proof. Where one does, tracks are sought at the places where it can be passed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.least.box_columns import ColumnSampler
from opl.least.rectangle import Rectangle
from opl.least.rows import Bulge, Row
from opl.search.box import JointBox
from opl.search.passage import Corner, barred, chain, passage
from opl.search.walls import Chain
from opl.walls.families import grown
from opl.walls.placement import Placement

PARTS = 8  # into which a stretch between two places is cut
SHORTEST = 1.0 / 500.0  # of the stretch between cutter points that is still cut
AROUND = 12  # cutter points on either side of what is cut
MOST_REFINED = 12  # times that rectangles are cut finer for one box
# of what all ways miss a box by: what each edge of a wall misses it by; the next boxes would only
# slip past walls that are nearer
LESS = 0.97


@dataclass(frozen=True)
class Passages:
    """What rectangles tell of a box.

    Attributes:
        walls: Chains that a motion in the box cannot pass, the hardest to pass first.
        rows: Contact positions that it passes only where they lie in the box.
        edges: Ends of the edges that its way crosses in [rad], both free, shape (n, 2, 6).
        crossings: Places, and the contact positions at which its way crosses them, shape (k, 2).
        open: Whether it may be passed by what leaves the box by the room of a motion.
    """

    walls: list[Chain]
    rows: list[Row]
    edges: Array
    crossings: Array
    open: bool

    def grown(self, box: JointBox) -> JointBox:
        """Return a box grown until it holds a posture of each edge crossed."""
        if not len(self.edges):
            return box
        return grown(self.edges, np.ones(self.edges.shape[:2], dtype=bool), box) or box


NO_PASSAGES = Passages([], [], np.empty((0, 2, 6)), np.empty((0, 2)), True)


class Rectangles:
    """The rectangles of a problem; grow finer.

    Args:
        sampler: Samples places.
        points: The cutter points.
        contact_positions: The lines of equal contact position, shape (m,).

    Attributes:
        places: Fractional cutter points at which tracks are sought, shape (n,).
    """

    def __init__(
        self, sampler: ColumnSampler, points: CutterPoints, contact_positions: Array
    ) -> None:
        self._sampler = sampler
        self._points = points
        self._t = contact_positions
        self._between = np.empty(0)  # places of rectangles that are no cutter points
        self._walls: set[Chain] = set()
        self._known: dict[tuple[float, ...], Rectangle] = {}
        self.places = np.arange(len(points), dtype=float)
        self._refined, self._refined_for = 0, 0.0  # how often for a box of that size

    def refine(self, bulges: Sequence[Bulge], box: JointBox) -> bool:
        """Cut rectangles finer where a track leaves its box; return whether anything is new."""
        self._refined = self._refined + 1 if box.size == self._refined_for else 0
        self._refined_for = box.size
        if self._refined >= MOST_REFINED:
            return False
        more = [np.empty(0)]
        for bulge in bulges:
            more.append(np.linspace(bulge.first, bulge.last, bulge.parts + 1)[1:-1])
            whole = bulge.last - bulge.first == 1.0
            if bulge.steep or not whole:
                more.append(self._cut(bulge.first, bulge.last))
            if bulge.steep and whole:
                more += [self._cut(one, one + 1.0) for one in self._cut_beside(bulge.first)]
        places = np.union1d(self.places, np.concatenate(more))
        new = len(places) > len(self.places)
        self.places = places
        return new

    @property
    def _stretches(self) -> np.ndarray:
        """The cutter points from which on stretches up to the next are cut finer, shape (n,)."""
        return np.unique(np.floor(self._between))

    def _cut_beside(self, place: float) -> list[float]:
        """Return from which cutter points on stretches are cut together with that from a place on.

        None at first, then half as many as are cut beside it: a sweep over the wheel that is barred
        where a stretch is cut finer goes on beside it, where nothing is known of that.
        """
        cut = set(self._stretches.tolist())
        begin, end = self._ends_of_pass(place)
        low, high = place, place + 1.0
        while low - 1.0 in cut:
            low -= 1.0
        while high in cut:
            high += 1.0
        more = (high - low - 1.0) // 4.0  # on either side
        first, last = max(low - more, begin), min(high + more, end)
        return [*np.arange(first, low).tolist(), *np.arange(high, last).tolist()]

    def _cut(self, begin: float, end: float) -> Array:
        """Cut rectangles finer between two places; return the new ones."""
        more = [np.empty(0)]
        known = np.union1d(np.arange(len(self._points), dtype=float), self._between)
        first = int(np.searchsorted(known, begin, side="right")) - 1
        last = int(np.searchsorted(known, end))
        for one, other in zip(known[first:last], known[first + 1 : last + 1], strict=True):
            if other - one > SHORTEST:
                more.append(np.linspace(one, other, PARTS + 1)[1:-1])
        finer = np.concatenate(more)
        self._between = np.union1d(self._between, finer)
        return finer

    def _cut_along(
        self, rectangle: Rectangle, corners: Sequence[Corner], box: JointBox, most: float
    ) -> bool:
        """Halve the stretches where a chain misses a box less than its corners tell."""
        nearer = rectangle.nearer_between(corners, box, LESS * most)
        halves = [(one + other) / 2.0 for one, other in nearer if other - one > SHORTEST]
        self._between = np.union1d(self._between, np.array(halves))
        return bool(halves)

    def held(
        self, box: JointBox, placements: Sequence[Placement], allowed: float, room: float
    ) -> Passages:
        """Hold a box against all rectangles.

        Args:
            box: The box.
            placements: The image that each pass uses.
            allowed: What it may miss the way through by, in [rad].
            room: By how much a motion may leave it, in [rad] of its size.
        """
        walls: list[tuple[float, Chain]] = []
        rows: list[Row] = []
        edges, crossings = [np.empty((0, 2, 6))], [np.empty((0, 2))]
        passed = True
        for places in self._windows():
            rectangle = self._rectangle(places, placements)
            rectangle.leave_out_collisions(box)
            up, along = rectangle.missed(box)
            most = barred(up, along)
            corners = None
            while most > allowed:
                missed = max(allowed, LESS * (most if np.isfinite(most) else 1.0))
                corners = chain(up, along, missed)
                if corners is None or not rectangle.doubts(corners):
                    break
                up, along = rectangle.missed(box)
                most = barred(up, along)
            if most > allowed:
                wall = () if corners is None else self._chain(places, corners)
                if wall and wall not in self._walls:
                    walls.append((most, wall))
                # a wall that the proof has says less than these nodes: they are too few, unless it
                # is by a hair
                elif most > room and corners and self._cut_along(rectangle, corners, box, most):
                    return self.held(box, placements, allowed, room)
                if most > room:
                    passed = False
                    continue
            ends = np.array(passage(up, along, max(most, allowed)))
            edges.append(rectangle.ends_of(ends))
            crossings.append(rectangle.crossings(ends, box))
            rows += rectangle.rows(up, room)
        walls.sort(key=lambda one: -one[0])
        hardest = [wall for _, wall in walls]
        of_ways = np.concatenate(edges), np.concatenate(crossings)
        return Passages(hardest, rows, *of_ways, passed)

    def take_in(self, walls: Sequence[Chain]) -> Sequence[Chain]:
        """Note chains that are walls of the proof from now on, and return them."""
        self._walls.update(walls)
        return walls

    def _chain(self, places: Array, corners: Sequence[Corner]) -> Chain:
        return tuple((float(places[k]), float(self._t[j])) for k, j in corners)

    def _windows(self) -> list[Array]:
        """Return the places of each rectangle: what is cut finer, and cutter points around it."""
        cut = self._stretches
        if not len(cut):
            return []
        passes = self._points.pass_index[cut.astype(int)]
        apart = (np.diff(cut) > 2 * AROUND) | (np.diff(passes) > 0)
        windows = []
        for group in np.split(cut, np.flatnonzero(apart) + 1):
            begin, end = self._ends_of_pass(group[0])
            first, last = max(group[0] - AROUND, begin), min(group[-1] + 1.0 + AROUND, end)
            inside = self._between[(self._between > first) & (self._between < last)]
            windows.append(np.union1d(np.arange(first, last + 1.0), inside))
        return windows

    def _ends_of_pass(self, place: float) -> tuple[int, int]:
        """Return the first and the last cutter point of the pass that a place is on."""
        own = np.flatnonzero(self._points.pass_index == self._points.pass_index[int(place)])
        return int(own[0]), int(own[-1])

    def _rectangle(self, places: Array, placements: Sequence[Placement]) -> Rectangle:
        """Return the rectangle of some places of a pass."""
        index = self._points.pass_index[int(places[0])]
        image = placements[index]
        turned = *image.shift, *(image.center * image.loose)
        which = image.family, image.number, image.side.number, *turned
        left_out = self._sampler.collisions, self._sampler.mirrored, self._sampler.learnt
        key = places[0], places[-1], len(places), index, *map(float, (*left_out, *which))
        if key not in self._known:
            for old in [old for old in self._known if old[3] == index and old[:3] != key[:3]]:
                del self._known[old]
            self._known[key] = Rectangle(self._sampler, places, self._t, image)
        return self._known[key]
