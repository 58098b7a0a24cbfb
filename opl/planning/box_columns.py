"""Places along the passes as columns of postures, sampled where they are near to a box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.families import GROWN, Placement
from opl.planning.images import Seams
from opl.planning.nodes import inverse_solutions
from opl.planning.problem import GrindingProblem, wheel_distances
from opl.search.box import JointBox
from opl.search.in_box import JUMP, sampled
from opl.search.in_box import missing as missing_of
from opl.search.outside import outside

FINE = 33  # contact positions of a place at which a box is held against it
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
        free: Which are within reach and do not cut into the wheel, shape (n, m).
        wheel_distance: Signed distance of the part to the wheel in [m], shape (n, m).
    """

    places: Array
    points: CutterPoints
    placements: tuple[Placement, ...]
    t: Array
    q: Array
    free: np.ndarray
    wheel_distance: Array

    def without(
        self, box: JointBox, place: float, t: float, back: bool, above: bool
    ) -> float | None:
        """Return the cutter point nearest to a place that has nothing in a box on one side of t.

        Args:
            box: The box.
            place: The place.
            t: The contact position.
            back: Whether to look before the place, not after it.
            above: Whether nothing is to lie in the box above t, not below it.
        """
        index = self.points.pass_index[int(np.searchsorted(self.places, place, side="right")) - 1]
        own = np.flatnonzero(
            (self.points.pass_index == index)
            & (self.places % 1.0 == 0.0)
            & ((self.places <= place) if back else (self.places >= place))
        )
        for column in own[::-1] if back else own:
            side = self.t[column] > t if above else self.t[column] < t
            inside = missing_of(self.q[column], box) <= GROWN
            if not (side & inside & self.free[column]).any():
                return float(self.places[column])
        return None

    def missing(self, box: JointBox) -> Array:
        """Return by how much a box must grow for each place, in [rad], shape (n,)."""
        missing, row = np.empty(len(self.q)), np.empty(len(self.q))
        by_joint = np.ascontiguousarray(np.moveaxis(self.q, 1, 2))
        outside(by_joint, self.free, box.lower, box.upper, JUMP, missing, row)
        return missing


class ColumnSampler:
    """Samples the postures of places.

    Args:
        problem: What is to be planned.
        seams: Where angles are cut open.
    """

    def __init__(self, problem: GrindingProblem, seams: Seams) -> None:
        self._problem = problem
        self._seams = seams

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
        whole = places % 1.0 == 0.0
        q = np.empty((len(places), len(positions), *problem.field.q.shape[2:]))
        q[whole] = problem.field.q[before[whole]]
        q[~whole] = inverse_solutions(
            problem.cell, there.Ts_workpiece_cutter[~whole][:, None], positions
        )
        cuts = np.empty(q.shape[:2], dtype=bool)
        cuts[whole] = problem.cuts[before[whole]]
        if not whole.all():
            between = CutterPoints(
                there.Ts_workpiece_cutter[~whole],
                np.zeros(np.sum(~whole), dtype=int),
                places[~whole],
            )
            layer = wheel_distances(problem.scene, between, positions)
            cuts[~whole] = layer < -problem.cell.planned_penetration
        grid = np.broadcast_to(positions, q.shape[:2])
        coarse = self._placed(there, q, placements)
        free = ~cuts & ~np.isnan(coarse[..., 0])
        t, _ = sampled(grid, coarse, free, box, FINE, whole=True)
        # where the part begins to cut is known to a hair only
        last = problem.cell.wheel.last_position
        t = np.clip(np.concatenate([t[:, :1] - BORDER, t, t[:, -1:] + BORDER], axis=1), -last, last)
        return self.at(places, there, placements, t)

    def at(
        self, places: Array, there: CutterPoints, placements: Sequence[Placement], t: Array
    ) -> Columns:
        """Return the postures of places at contact positions, shape (n, m)."""
        problem = self._problem
        q = inverse_solutions(problem.cell, there.Ts_workpiece_cutter[:, None], t)
        layer = wheel_distances(problem.scene, there, t)
        q = self._placed(there, q, placements)
        free = ~np.isnan(q[..., 0]) & ~(layer < -problem.cell.planned_penetration)
        return Columns(places, there, tuple(placements), t, q, free, layer)

    def _placed(self, there: CutterPoints, q: Array, placements: Sequence[Placement]) -> Array:
        """Return the placed postures of all inverse solutions, shape (n, m, 6)."""
        placed = np.empty((*q.shape[:2], 6))
        for index, placement in enumerate(placements):
            own = there.pass_index == index
            start = self._seams.start[placement.family]
            unrolled = start + np.remainder(q[own][:, :, placement.family] - start, 2.0 * np.pi)
            placed[own] = placement.of(unrolled)
        return placed
