"""From a box of joint space to the motion inside it.

Each place along the passes gets contact positions of its own, sampled only where its postures lie
in the box, closer and closer around the smoothest track through them. Where the track bulges out of
the box between two places, more places are taken in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.columns import Seams, wrist_flips
from opl.planning.costs import CostWeights, track_cost
from opl.planning.families import JUMP, Placement
from opl.planning.filling import BrokenEdgeError, cutter_frames, fill_in
from opl.planning.nodes import NodeField, NodeMatrix, inverse_solutions
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.plan import Found, Plan, propose_and_check
from opl.planning.problem import GrindingProblem, wheel_layer
from opl.planning.refine import RefinedProblem
from opl.planning.symmetry import twins
from opl.search.box import JointBox
from opl.search.smooth import Travel, smoothest_within

SAMPLES = 17  # contact positions of a place
ROUNDS = 3  # of sampling closer around a track
SUBDIVIDE = np.array([0.25, 0.5, 0.75])  # where an edge that bulges is given places
SMALLEST_EDGE = 1.0 / 16.0  # of that between cutter points that is still given places
MOST_BULGES = 4  # rounds of taking in places
MOST_CHECKS = 12  # of motions in one box


class BoxTracks:
    """Finds motions in boxes.

    Args:
        problem: What is to be planned.
        seams: Where angles are cut open.
        costs: What a track is charged for.
        max_contact_change: Largest change of t between neighbouring places in belt units.
        most: How far joints and contact should move at the most.
    """

    def __init__(
        self,
        problem: GrindingProblem,
        seams: Seams,
        costs: CostWeights,
        max_contact_change: float,
        most: Travel,
    ) -> None:
        self._problem = problem
        self._seams = seams
        self._costs = costs
        self._max_contact_change = max_contact_change
        self._most = most
        self.checks = 0

    def plan(self, box: JointBox, room: float, placements: Sequence[Placement]) -> Plan | None:
        """Return the motion of the smoothest free track in a box, or None.

        Args:
            box: The box.
            room: By how much the motion may leave it, in [rad] of its size.
            placements: The image that each pass uses, all of one family.
        """
        places = np.arange(len(self._problem.points), dtype=float)
        inner = box.widened(room / 2.0)
        swept = False
        for _ in range(MOST_BULGES):
            sampled = _Sampled(self, places, placements, inner, swept)
            if not sampled.matrices:
                return None
            track = sampled.smoothest()
            if track is None:
                return None
            for _ in range(ROUNDS):
                closer = sampled.closer(track)
                finer = closer.smoothest()
                if finer is None:
                    break
                sampled, track = closer, finer
            bulges = sampled.bulges(track, box.widened(room))
            if len(bulges):
                ends = places[bulges], places[bulges + 1]
                added = ends[0][:, None] + (ends[1] - ends[0])[:, None] * SUBDIVIDE
                places = np.union1d(places, added)
                continue
            plan = sampled.check(track)
            if plan is not None or swept:
                return plan
            swept = True
        return sampled.check(track)


class _Sampled:
    """The nodes of some places at contact positions of their own."""

    def __init__(
        self,
        search: BoxTracks,
        places: Array,
        placements: Sequence[Placement],
        box: JointBox,
        swept: bool,
        t: Array | None = None,
        spacing: Array | None = None,
    ) -> None:
        self._search = search
        self._places = places
        self._placements = placements
        self._box = box
        self._swept = swept
        problem = search._problem
        columns = places.astype(int)
        points = problem.points
        self._points = CutterPoints(
            cutter_frames(points, places),
            points.pass_index[columns],
            np.interp(places, np.arange(len(points)), points.arc_length),
        )
        if t is None or spacing is None:
            t, spacing = self._windows()
        self._t, self._spacing = t, spacing
        q = self._placed(inverse_solutions(problem.cell, self._points.Ts_workpiece_cutter[:, None], t))
        q[~_near(q, box)] = np.nan
        matrices = list(self._images(q))
        layer = wheel_layer(problem.scene, self._points, t, ~np.isnan(q[..., 0]))
        self.problem = replace(
            problem,
            points=self._points,
            field=NodeField(t[0], problem.field.q[:0], tuple(matrices)),
            wheel_clearance=layer,
        )
        self.matrices = open_matrices(self.problem)
        if swept:
            for matrix in self.matrices:
                _sweep(matrix, self.problem)

    def smoothest(self) -> Track | None:
        """Return the smoothest track in the matrix that is farthest from the limits."""
        search = self._search
        for index, matrix in enumerate(self.matrices):
            cost = track_cost(self.problem, matrix.nodes, search._costs, matrix.free)
            found = smoothest_within(
                matrix.ladder_within(search._max_contact_change),
                matrix.blocked_edges,
                matrix.free,
                cost,
                search._most,
            )
            if found is not None:
                return Track(index, found.rows)
        return None

    def closer(self, track: Track) -> _Sampled:
        """Return closer samples around a track, whose own nodes are among them."""
        own = self.matrices[track.matrix].nodes.t_along(track.rows)
        about = np.linspace(-1.0, 1.0, SAMPLES)
        last = self._search._problem.cell.wheel.last_position
        t = np.clip(own[:, None] + about * self._spacing[:, None], -last, last)
        return _Sampled(
            self._search, self._places, self._placements, self._box, self._swept,
            t, self._spacing * 2.0 / (SAMPLES - 1),
        )  # fmt: skip

    def bulges(self, track: Track, box: JointBox) -> np.ndarray:
        """Return the places from which a track leaves the box on its way to the next."""
        problem, nodes = self.problem, self.matrices[track.matrix].nodes
        try:
            path = fill_in(problem.cell, problem.points, nodes, track.rows, problem.interpolation)
        except BrokenEdgeError:
            return np.empty(0, dtype=int)  # the check finds and blocks it
        spanned = nodes.along(track.rows)
        outer = JointBox(spanned.min(axis=0), spanned.max(axis=0))
        room = max(box.size - outer.size, 0.0)
        bulging = np.unique(path.cutter_point[~outer.widened(room).holds(path.q)].astype(int))
        if not len(bulging) or np.ptp(path.q, axis=0).sum() <= box.size:
            return np.empty(0, dtype=int)
        return np.asarray(bulging[np.diff(self._places)[bulging] > SMALLEST_EDGE])

    def check(self, track: Track) -> Plan | None:
        """Return the plan of a track, or of the next smoothest, if its whole motion is free."""
        search, found = self._search, RefinedProblem(self.problem, self._places)
        for _ in range(MOST_CHECKS):
            proposals = twins(self.matrices, track, self.problem.cell.robot)
            outcome = propose_and_check(self.problem, self.matrices, proposals, search.checks)
            if isinstance(outcome, Found):
                plan = outcome.plan
                search.checks = plan.checks
                return replace(
                    plan,
                    path=found.original_path(plan.path),
                    motion=found.original_motion(plan.motion),
                )
            search.checks += len(proposals)
            following = self.smoothest()
            if following is None:
                return None
            track = following
        return None

    def _windows(self) -> tuple[Array, Array]:
        """Return contact positions where the postures lie in the box, and how far apart."""
        problem = self._search._problem
        positions = problem.field.contact_positions
        whole = self._places % 1.0 == 0.0
        q = np.empty((len(self._places), len(positions), *problem.field.q.shape[2:]))
        q[whole] = problem.field.q
        between = self._points.Ts_workpiece_cutter[~whole]
        q[~whole] = inverse_solutions(problem.cell, between[:, None], positions)
        placed = self._placed(q)
        enter, leave = _clipped(placed, self._box)
        t, spacing = np.empty((len(q), SAMPLES)), np.empty(len(q))
        share = np.linspace(0.0, 1.0, SAMPLES)
        for column, (start, end) in enumerate(zip(enter, leave, strict=True)):
            hit = np.flatnonzero(end >= start)
            if not len(hit):
                # the curve passes the box by a hair
                nearest = positions[int(np.argmin(_missing(placed[column], self._box)))]
                step = positions[1] - positions[0]
                t[column] = np.clip(nearest + (2.0 * share - 1.0) * step, positions[0], positions[-1])
                spacing[column] = 2.0 * step / (SAMPLES - 1)
                continue
            step = positions[hit + 1] - positions[hit]
            first, last = positions[hit] + start[hit] * step, positions[hit] + end[hit] * step
            length = np.concatenate([[0.0], np.cumsum(last - first)])
            along = share * length[-1]
            at = np.clip(np.searchsorted(length, along, side="right") - 1, 0, len(hit) - 1)
            t[column] = first[at] + np.minimum(along - length[at], (last - first)[at])
            spacing[column] = max(length[-1] / (SAMPLES - 1), 1e-3)
        return t, spacing

    def _placed(self, q: Array) -> Array:
        """Return the placed postures of all inverse solutions, shape (n, m, 6)."""
        placed = np.empty((*q.shape[:2], 6))
        for index, placement in enumerate(self._placements):
            columns = self._points.pass_index == index
            start = self._search._seams.start[placement.family]
            unrolled = start + np.remainder(q[columns][:, :, placement.family] - start, 2.0 * np.pi)
            placed[columns] = placement.of(unrolled)
        return placed

    def _images(self, q: Array) -> list[NodeMatrix]:
        """Return the matrices that make these postures elsewhere in joint space, best first."""
        problem = self._search._problem
        robot = problem.cell.robot
        flips = [(4 * k, *flip) for k, flip in enumerate(wrist_flips(robot.arm))]
        found = []
        family = self._placements[0].family
        index = np.arange(q.shape[1])
        for slot, sign, shift in flips:
            moved = q * sign + shift
            low, high = np.nanmin(moved, axis=(0, 1)), np.nanmax(moved, axis=(0, 1))
            first = np.ceil((robot.lower - high) / (2.0 * np.pi))
            last = np.floor((robot.upper - low) / (2.0 * np.pi))
            counts = [np.arange(a, b + 1) for a, b in zip(first, last, strict=True)]
            for count in np.stack(np.meshgrid(*counts, indexing="ij"), axis=-1).reshape(-1, 6):
                turned = moved + 2.0 * np.pi * count
                within = problem.cell.within_limits(turned)
                if not within.any(axis=1).all():
                    continue
                at = np.where(within[..., None], turned, np.nan)
                margin = np.minimum(turned - robot.lower, robot.upper - turned)
                near = float((1.0 / np.maximum(np.nanmin(margin, axis=(0, 1)), 1e-3)).sum())
                nodes = NodeMatrix(family + slot, np.ascontiguousarray(at), self._t, index)
                found.append((near, len(found), nodes))
        return [nodes for _, _, nodes in sorted(found, key=lambda entry: entry[:2])]


def _sweep(matrix: OpenMatrix, problem: GrindingProblem) -> None:
    """Close every node that collides."""
    columns, rows = np.nonzero(matrix.free)
    hit = problem.scene.collision.collides(matrix.nodes.q[columns, rows])
    matrix.free[columns[hit], rows[hit]] = False


def _missing(q: Array, box: JointBox) -> Array:
    """Return by how much a box must grow to hold postures, infinite for none, shape (...)."""
    away = np.maximum(q - box.upper, 0.0) + np.maximum(box.lower - q, 0.0)
    return np.asarray(np.nan_to_num(away.sum(axis=-1), nan=np.inf))


def _near(q: Array, box: JointBox) -> np.ndarray:
    """Return which postures are in a box, the nearest where a column has none, shape (n, m)."""
    missing = _missing(q, box)
    least = missing.min(axis=1, keepdims=True)
    return np.asarray((missing <= np.maximum(least, 0.0) + 1e-12) & np.isfinite(missing))


def _clipped(q: Array, box: JointBox) -> tuple[Array, Array]:
    """Return where the chords between neighbouring rows enter and leave a box, 0 to 1.

    Shape (n, m - 1) each; one that does not meet the box leaves before it enters.
    """
    start, along = q[:, :-1], np.diff(q, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (box.lower - start) / along, (box.upper - start) / along
    inside = (start >= box.lower) & (start <= box.upper)
    still = np.abs(along) < 1e-12
    enter = np.where(still, np.where(inside, 0.0, 2.0), np.minimum(one, other)).max(axis=2)
    leave = np.where(still, np.where(inside, 1.0, -1.0), np.maximum(one, other)).min(axis=2)
    enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
    jump = ~(np.abs(along).max(axis=2) <= JUMP)
    return np.where(jump, 2.0, enter), np.where(jump, -1.0, leave)
