"""The postures of a pass in a rectangle of places and contact positions, and where it is shut.

At the lines of the rectangle they are sampled; where the part begins to cut into the wheel between
two lines is found by halving. That the part cuts at two neighbouring places does not make it sure
that it does between them: where a wall is to rest on it, that is proven, or doubted.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from opl.geometry.frames import Array
from opl.least.box_columns import ColumnSampler
from opl.least.rows import Row
from opl.search.box import JointBox
from opl.search.in_box import missing, missing_chords, nearest_points
from opl.search.passage import Corner, edges_missed
from opl.walls.placement import Placement

HALVINGS = 10  # of the way between contact positions at which the part begins to cut
NO_RESERVE = 0.0  # [m] of clearance: what walls of the proof leave out leaves none either
NEAR = 0.01  # [rad] from a box within which postures are looked at for collisions


class Rectangle:
    """A rectangle.

    Args:
        sampler: Samples its places.
        places: Fractional cutter points of one pass, shape (n,).
        contact_positions: The lines of equal contact position in belt units, shape (m,).
        image: Which image of a posture the pass uses.
    """

    def __init__(
        self, sampler: ColumnSampler, places: Array, contact_positions: Array, image: Placement
    ) -> None:
        self._sampler, self._image = sampler, image
        self._places, self._t = places, contact_positions
        t = np.broadcast_to(contact_positions, (len(places), len(contact_positions)))
        columns = sampler.at(places, sampler.there(places), [image], t, NO_RESERVE)
        reached = ~np.isnan(columns.q[..., 0])
        where = places[:-1, None], places[1:, None], contact_positions, contact_positions
        self._q, self._free = np.nan_to_num(columns.q), columns.free
        self._cuts = reached & ~columns.free
        self._looked_at = ~columns.free
        # between which places the part surely cuts into the wheel on a line, and where it may not
        self._sure = image.side.excludes(*where)
        self._doubted = np.zeros_like(self._sure)
        begins = (columns.free[:, :-1] != columns.free[:, 1:]) & reached[:, :-1] & reached[:, 1:]
        self._borders = np.stack(np.nonzero(begins), axis=1)
        # from the line beside a border to the border: contact positions, and postures there
        self._t_to, self._q_to = self._up_to_borders()

    def _up_to_borders(self) -> tuple[Array, Array]:
        k, j = self._borders.T
        below = self._free[k, j]
        begin, outside = self._t[j + ~below], self._t[j + below]
        inside, q = begin, np.repeat(self._q[k, j + ~below][:, None], 2, axis=1)
        for _ in range(HALVINGS if len(k) else 0):
            middle = (inside + outside) / 2.0
            places = self._places[k]
            there = self._sampler.there(places)
            found = self._sampler.at(places, there, [self._image], middle[:, None], NO_RESERVE)
            free = found.free[:, 0]
            q[free, 1] = found.q[free, 0]
            inside, outside = np.where(free, middle, inside), np.where(free, outside, middle)
        return np.stack([begin, inside], axis=1), q

    def leave_out_collisions(self, box: JointBox) -> None:
        """Leave out postures near a box that collide, where that matters."""
        if self._sampler.collisions:
            near = ~self._looked_at & (missing(self._q, box) <= NEAR)
            self._looked_at |= near
            self._free[near] = ~self._sampler.collides(self._q[near], NO_RESERVE)

    def missed(self, box: JointBox) -> tuple[Array, Array]:
        """Return by how much a box misses the edges, as `edges_missed` does."""
        up, along = edges_missed(self._q, self._free, box)
        k, j = self._borders.T
        still = np.isfinite(up[k, j])
        up[k[still], j[still]] = _missing(self._q_to[still], box)
        k, j = np.nonzero(self._doubted)
        along[k, j] = _missing(np.stack([self._q[k, j], self._q[k + 1, j]], axis=1), box)
        return up, along

    def doubts(self, corners: Sequence[Corner]) -> bool:
        """Return whether a chain rests on what is not sure after all, which is doubted from now on.

        That is where the part cuts into the wheel at two places, but not surely between them.
        """
        k, j = _steps(corners).T
        new = self._cuts[:-1] & self._cuts[1:] & ~self._sure & ~self._doubted
        asked = new[k, j]
        # all along the lines: the next chain would only go around what is doubted
        lines = np.zeros(len(self._t), dtype=bool)
        lines[j[asked]] = True
        place, line = np.nonzero(new & lines)
        ends = self._places[place], self._places[place + 1]
        shut = self._sampler.shut_along(*ends, self._t[line])
        self._sure[place, line], self._doubted[place, line] = shut, ~shut
        return bool(self._doubted[k, j][asked].any())

    def nearer_between(
        self, corners: Sequence[Corner], box: JointBox, missed: float
    ) -> list[tuple[float, float]]:
        """Return the stretches along a chain that a box misses less between places than so much."""
        k, j = _steps(corners).T
        if not len(k):
            return []
        places = (self._places[k] + self._places[k + 1]) / 2.0
        there = self._sampler.there(places)
        at = self._sampler.at(places, there, [self._image], self._t[j][:, None], NO_RESERVE)
        halves = np.stack([self._q[k, j], at.q[:, 0], self._q[k + 1, j]], axis=1)
        free = np.repeat(at.free, 3, axis=1)
        near = missing_chords(halves, free, box) < missed
        return list(zip(self._places[k[near]], self._places[k[near] + 1], strict=True))

    def ends_of(self, edges: np.ndarray) -> Array:
        """Return the ends in [rad] of those edges of which two are known that may be used.

        Edges are indices of place and contact position of both ends, shape (k, 2, 2). An edge to a
        border ends there. Shape (n, 2, 6).
        """
        both = edges[self._free[edges[..., 0], edges[..., 1]].all(axis=1)]
        _, border = self._at_borders(edges)
        return np.concatenate([self._q[both[..., 0], both[..., 1]], self._q_to[border]])

    def crossings(self, edges: np.ndarray, box: JointBox) -> Array:
        """Return places, and contact positions at which a way is nearest to a box, shape (k, 2)."""
        up = edges[edges[:, 0, 0] == edges[:, 1, 0]]
        k, j = up.min(axis=1).T
        t = np.stack([self._t[j], self._t[j + 1]], axis=1)
        ends = np.stack([self._q[k, j], self._q[k, j + 1]], axis=1)
        edge, border = self._at_borders(up)
        t[edge], ends[edge] = self._t_to[border], self._q_to[border]
        _, share = nearest_points(ends, np.ones(ends.shape[:2], dtype=bool), box)
        share = np.clip(share, 0.0, 1.0)
        return np.stack([self._places[k], t[:, 0] + share * (t[:, 1] - t[:, 0])], axis=1)

    def _at_borders(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return indices of the edges with a border on them, and of their borders."""
        m = len(self._t)
        up = np.where(edges[:, 0, 0] == edges[:, 1, 0], edges.min(axis=1) @ [m, 1], -1)
        _, edge, border = np.intersect1d(up, self._borders @ [m, 1], return_indices=True)
        return edge, border

    def rows(self, up: Array, room: float) -> list[Row]:
        """Return the contact positions that motions in a box pass between finer places.

        They have no postures where these are known not to be free.

        Args:
            up: By how much the box misses the edges from each contact position to the next.
            room: By how much a motion may leave it, in [rad] of its size.
        """
        places, rows = self._places, []
        q = np.where(self._free[..., None], self._q, np.nan)
        fine = np.diff(places) < 1.0
        ends = np.flatnonzero(np.diff(np.concatenate([[False], fine, [False]]).astype(int)))
        for first, last in ends.reshape(-1, 2).tolist():
            levels = np.flatnonzero((up[first : last + 1] <= room).any(axis=0))
            if not len(levels):
                continue
            for j in range(levels[0], levels[-1] + 2):
                zone = slice(first, last + 1)
                rows.append(Row(places[zone], float(self._t[j]), q[zone, j]))
        return rows


def _missing(ends: Array, box: JointBox) -> Array:
    return missing_chords(ends, np.ones(ends.shape[:2], dtype=bool), box)


def _steps(corners: Sequence[Corner]) -> np.ndarray:
    """Return from which place on which line a chain goes along it, shape (n, 2)."""
    steps = [
        (k, j)
        for (one, j), (other, level) in pairwise(corners)
        if j == level
        for k in range(min(one, other), max(one, other))
    ]
    return np.array(steps, dtype=int).reshape(-1, 2)
