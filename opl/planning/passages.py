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
from opl.planning.box_columns import ColumnSampler
from opl.planning.families import grown
from opl.planning.placement import Placement
from opl.planning.rows import Bulge, Row
from opl.search.box import JointBox
from opl.search.in_box import missing
from opl.search.passage import Corner, barred, chain, edges_missed, passage
from opl.search.walls import Chain

PARTS = 8  # into which a stretch between two places is cut
SHORTEST = 1.0 / 500.0  # of the stretch between cutter points that is still cut
AROUND = 12  # cutter points on either side of what is cut
LESS = 0.5  # of what all ways miss a box by: what each edge of a wall should miss it by
NEAR = 0.01  # [rad] from a box within which postures are looked at for collisions


@dataclass(frozen=True)
class Passages:
    """What rectangles tell of a box.

    Attributes:
        walls: Chains that a motion in the box cannot pass, the hardest to pass first.
        rows: Contact positions that it passes only where they lie in the box.
        edges: Ends of the edges that its way crosses in [rad], both free, shape (n, 2, 6).
    """

    walls: list[Chain]
    rows: list[Row]
    edges: Array

    def grown(self, box: JointBox) -> JointBox:
        """Return a box grown until it holds a posture of each edge crossed."""
        if not len(self.edges):
            return box
        return grown(self.edges, np.ones(self.edges.shape[:2], dtype=bool), box) or box


@dataclass
class _Nodes:
    """The postures of a rectangle: places (n,), postures (n, m, 6) and which may be used (n, m)."""

    places: Array
    q: Array
    free: np.ndarray
    looked_at: np.ndarray


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
        self._nodes: dict[tuple[float, ...], _Nodes] = {}
        self.places = np.arange(len(points), dtype=float)

    def refine(self, bulges: Sequence[Bulge]) -> bool:
        """Cut rectangles finer where a track leaves its box; return whether anything is new."""
        more = [np.empty(0)]
        known = np.union1d(np.arange(len(self._points), dtype=float), self._between)
        for bulge in bulges:
            more.append(np.linspace(bulge.first, bulge.last, bulge.parts + 1)[1:-1])
            if not bulge.steep and bulge.last - bulge.first == 1.0:
                continue
            first = int(np.searchsorted(known, bulge.first, side="right")) - 1
            last = int(np.searchsorted(known, bulge.last))
            for one, other in zip(known[first:last], known[first + 1 : last + 1], strict=True):
                if other - one > SHORTEST:
                    finer = np.linspace(one, other, PARTS + 1)[1:-1]
                    self._between = np.union1d(self._between, finer)
        places = np.union1d(self.places, np.concatenate(more))
        places = np.union1d(places, self._between)
        new = len(places) > len(self.places)
        self.places = places
        return new

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
        edges = [np.empty((0, 2, 6))]
        for places in self._windows():
            nodes = self._sampled(places, box, placements)
            up, along = edges_missed(nodes.q, nodes.free, box)
            most = barred(up, along)
            if most > allowed:
                missed = max(allowed, LESS * (most if np.isfinite(most) else 1.0))
                found = chain(up, along, missed)
                wall = () if found is None else self._chain(places, found)
                if wall and wall not in self._walls:
                    walls.append((most, wall))
                continue  # a wall that the proof has says less than these nodes: they are too few
            ends = np.array(passage(up, along, allowed))
            ends = ends[nodes.free[ends[..., 0], ends[..., 1]].all(axis=1)]
            edges.append(nodes.q[ends[..., 0], ends[..., 1]])
            rows += self._rows(nodes, box, room)
        walls.sort(key=lambda one: -one[0])
        return Passages([wall for _, wall in walls], rows, np.concatenate(edges))

    def take_in(self, walls: Sequence[Chain]) -> None:
        """Note chains that are walls of the proof now."""
        self._walls.update(walls)

    def _chain(self, places: Array, corners: Sequence[Corner]) -> Chain:
        return tuple((float(places[k]), float(self._t[j])) for k, j in corners)

    def _windows(self) -> list[Array]:
        """Return the places of each rectangle: what is cut finer, and cutter points around it."""
        cut = np.unique(np.floor(self._between))
        if not len(cut):
            return []
        passes = self._points.pass_index[cut.astype(int)]
        apart = (np.diff(cut) > 2 * AROUND) | (np.diff(passes) > 0)
        windows = []
        for group in np.split(cut, np.flatnonzero(apart) + 1):
            own = np.flatnonzero(self._points.pass_index == self._points.pass_index[int(group[0])])
            first, last = max(group[0] - AROUND, own[0]), min(group[-1] + 1.0 + AROUND, own[-1])
            inside = self._between[(self._between > first) & (self._between < last)]
            windows.append(np.union1d(np.arange(first, last + 1.0), inside))
        return windows

    def _sampled(self, places: Array, box: JointBox, placements: Sequence[Placement]) -> _Nodes:
        """Return the postures of a rectangle; near a box only those that do not collide count."""
        index = self._points.pass_index[int(places[0])]
        image = placements[index]
        turned = *image.shift, *(image.center * image.loose)
        which = image.family, image.number, *image.between, *turned
        left_out = self._sampler.collisions, self._sampler.mirrored
        key = places[0], places[-1], len(places), index, *map(float, (*left_out, *which))
        nodes = self._nodes.get(key)
        if nodes is None:
            for old in [old for old in self._nodes if old[3] == index and old[:3] != key[:3]]:
                del self._nodes[old]
            t = np.broadcast_to(self._t, (len(places), len(self._t)))
            columns = self._sampler.at(places, self._sampler.there(places), [image], t)
            nodes = _Nodes(places, np.nan_to_num(columns.q), columns.free, ~columns.free)
            self._nodes[key] = nodes
        if self._sampler.collisions:
            near = ~nodes.looked_at & (missing(nodes.q, box) <= NEAR)
            nodes.looked_at |= near
            nodes.free[near] = ~self._sampler.collides(nodes.q[near])
        return nodes

    def _rows(self, nodes: _Nodes, box: JointBox, room: float) -> list[Row]:
        """Return the contact positions that motions in a box pass between finer places."""
        places, rows = nodes.places, []
        inside = nodes.free & (missing(nodes.q, box) <= room)
        fine = np.diff(places) < 1.0
        ends = np.flatnonzero(np.diff(np.concatenate([[False], fine, [False]]).astype(int)))
        for first, last in ends.reshape(-1, 2).tolist():
            levels = np.flatnonzero(inside[first : last + 1].any(axis=0))
            if not len(levels):
                continue
            for j in range(max(levels[0] - 1, 0), min(levels[-1] + 2, len(self._t))):
                zone = slice(first, last + 1)
                rows.append(Row(places[zone], float(self._t[j]), nodes.q[zone, j]))
        return rows
