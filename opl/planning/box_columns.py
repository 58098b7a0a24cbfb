"""Places along the passes as columns of postures, sampled where they are near to a box."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.families import GROWN, Placement
from opl.planning.images import Seams
from opl.planning.nodes import inverse_solutions
from opl.planning.problem import GrindingProblem, wheel_distances
from opl.planning.rows import Row
from opl.search.box import JointBox
from opl.search.in_box import missing as missing_of
from opl.search.in_box import missing_chords, nearest_points, sampled

FINE = 33  # contact positions of a place at which a box is held against it
ROW_SAMPLES = 8  # between two cutter points at one contact position
POSTURES_OF_WORK = 400  # that cost a unit of work
BORDER = 1e-2  # belt units to look beyond what lies in the box


@dataclass(frozen=True)
class Columns:
    """The postures of places near to a box.

    Attributes:
        places: Fractional cutter points, shape (n,).
        points: The places as points of their own.
        placements: The image that each pass uses.
        t: Contact positions, shape (n, m).
        q: Placed postures in [rad], NaN where there are none, shape (n, m, 6).
        free: Which are within reach and do not cut into the wheel, as far as the field tells,
            shape (n, m).
    """

    places: Array
    points: CutterPoints
    placements: tuple[Placement, ...]
    t: Array
    q: Array
    free: np.ndarray

    def span(self, box: JointBox) -> tuple[Array, Array]:
        """Return the least and the greatest contact position of each place in a box, shape (n,)."""
        inside = self.free & (missing_of(self.q, box) <= GROWN)
        least = np.where(inside, self.t, np.inf).min(axis=1)
        return least, np.where(inside, self.t, -np.inf).max(axis=1)

    def around(
        self, box: JointBox, place: float, t: float, upwards: bool
    ) -> tuple[float | None, float | None]:
        """Return the nearest cutter points between which motions in a box must pass t.

        Before a place one where nothing in the box lies beyond t, after it one where nothing lies
        on the near side of t; None where there is none.
        """
        least, most = self.span(box)
        below, above = most <= t, least >= t
        index = self.points.pass_index[int(np.searchsorted(self.places, place, side="right")) - 1]
        own = (self.points.pass_index == index) & (self.places % 1.0 == 0.0)
        before = self.places[own & (self.places <= place) & (below if upwards else above)]
        after = self.places[own & (self.places >= place) & (above if upwards else below)]
        return (
            float(before[-1]) if len(before) else None,
            float(after[0]) if len(after) else None,
        )

    def missed(self, box: JointBox, known: Collection[float], allowed: float) -> list[float]:
        """Return the places that a box misses by more than allowed in [rad], the worst first.

        Those in ``known`` are left out.
        """
        missing = missing_chords(self.q, self.free, box)
        missing[np.isin(self.places, list(known))] = 0.0
        worst = np.argsort(-missing, kind="stable")
        return [float(self.places[k]) for k in worst if missing[k] > allowed]


class ColumnSampler:
    """Samples the postures of places.

    Args:
        problem: What is to be planned.
        seams: Where angles are cut open.
    """

    def __init__(self, problem: GrindingProblem, seams: Seams) -> None:
        self._problem = problem
        self._seams = seams
        self.collisions = False  # whether postures that collide are left out
        self.work = 0.0  # what was sampled so far, in units of work

    def columns(self, box: JointBox, placements: Sequence[Placement], places: Array) -> Columns:
        """Sample the postures of places where they are near to a box.

        Args:
            box: The box.
            placements: The image that each pass uses.
            places: Fractional cutter points, the cutter points among them, shape (n,).
        """
        problem = self._problem
        before, points = places.astype(int), problem.points
        there = CutterPoints(
            points.frames_at(places),
            points.pass_index[before],
            np.interp(places, np.arange(len(points)), points.arc_length),
        )
        positions = problem.field.contact_positions
        grid = np.broadcast_to(positions, (len(places), len(positions)))
        field = self._placed(points.pass_index, problem.field.q, placements)
        after = np.ceil(places).astype(int)
        # between cutter points near enough to see where the box may be met
        coarse = field[before] + (places - before)[:, None, None] * (field[after] - field[before])
        free = ~self._cuts(places, there, grid) & ~np.isnan(coarse[..., 0])
        t, _ = sampled(grid, coarse, free, box, FINE, whole=True)
        # where the part begins to cut is known to a hair only
        last = problem.cell.wheel.last_position
        t = np.clip(np.concatenate([t[:, :1] - BORDER, t, t[:, -1:] + BORDER], axis=1), -last, last)
        columns = self.at(places, there, placements, t)
        if self.collisions:
            self._leave_out_collisions(columns, box)
        return columns

    def _leave_out_collisions(self, columns: Columns, box: JointBox) -> None:
        """Leave postures that collide out of columns, until those nearest to a box are free."""
        free, asked = columns.free, np.zeros_like(columns.free)
        every = np.arange(len(free))
        while True:
            _, row = nearest_points(columns.q, free, box)
            near = np.zeros_like(free)
            met = row >= 0.0
            for end in (np.floor(row), np.ceil(row)):
                near[every[met], end[met].astype(int)] = True
            near &= ~asked
            if not near.any():
                return
            asked |= near
            free[near] = ~self._problem.scene.collision.collides(columns.q[near])

    def at(
        self, places: Array, there: CutterPoints, placements: Sequence[Placement], t: Array
    ) -> Columns:
        """Return the postures of places at contact positions, shape (n, m)."""
        problem = self._problem
        self.work += t.size / POSTURES_OF_WORK
        q = inverse_solutions(problem.cell, there.Ts_workpiece_cutter[:, None], t)
        q = self._placed(there.pass_index, q, placements)
        free = ~np.isnan(q[..., 0]) & ~self._cuts(places, there, t)
        return Columns(places, there, tuple(placements), t, q, free)

    def row(
        self, first: float, last: float, t: float, must: bool, columns: Columns, box: JointBox
    ) -> Row:
        """Return the places between two of a pass at one contact position, closer near a box."""
        places = np.linspace(first, last, ROW_SAMPLES * int(np.ceil(last - first)) + 1)
        (row,) = self.rows([(places, t, must)], columns)
        step = places[1] - places[0]
        near = places[int(np.argmin(missing_of(row.q, box)))]
        closer = near + step * np.linspace(-1.0, 1.0, 2 * ROW_SAMPLES + 1)
        (row,) = self.rows([(np.union1d(places, np.clip(closer, first, last)), t, must)], columns)
        return row

    def rows(self, rows: Sequence[tuple[Array, float, bool]], columns: Columns) -> list[Row]:
        """Return places of a pass at one contact position each, placed as columns are."""
        if not rows:
            return []
        counts = [len(row[0]) for row in rows]
        places = np.concatenate([row[0] for row in rows])
        t = np.repeat([row[1] for row in rows], counts)
        points = self._problem.points
        Ts_workpiece_cutter = points.frames_at(places)[:, None]
        q = inverse_solutions(self._problem.cell, Ts_workpiece_cutter, t[:, None])
        index = np.repeat([points.pass_index[int(row[0][0])] for row in rows], counts)
        placed = self._placed(index, q, columns.placements)[:, 0]
        return [
            Row(*row, q)
            for row, q in zip(rows, np.split(placed, np.cumsum(counts)[:-1]), strict=True)
        ]

    def _cuts(self, places: Array, there: CutterPoints, t: Array) -> np.ndarray:
        """Return where the part would sink too deep into the wheel, shape (n, m).

        Where all nodes of the field around a place and contact position agree, so does what lies
        between them: a motion that is not free for all that is refused when it is checked.
        """
        field, cuts = self._problem.field.contact_positions, self._problem.cuts
        after = np.clip(np.searchsorted(field, t), 1, len(field) - 1)
        near = np.zeros(t.shape, dtype=int)
        for column in (np.floor(places).astype(int), np.ceil(places).astype(int)):
            near += cuts[column[:, None], after - 1].astype(int) + cuts[column[:, None], after]
        unsure = (near > 0) & (near < 4)
        distance = wheel_distances(self._problem.scene, there, t, unsure)
        found = distance < -self._problem.cell.planned_penetration
        return np.asarray(np.where(unsure, found, near == 4))

    def _placed(self, pass_index: np.ndarray, q: Array, placements: Sequence[Placement]) -> Array:
        """Return the placed postures of all inverse solutions, shape (n, m, 6)."""
        placed = np.empty((*q.shape[:2], 6))
        for index, placement in enumerate(placements):
            own = pass_index == index
            start = self._seams.start[placement.family]
            unrolled = start + np.remainder(q[own][:, :, placement.family] - start, 2.0 * np.pi)
            placed[own] = placement.of(unrolled)
        return placed
