"""From a box of joint space to the motion inside it.

Each place along the passes gets contact positions of its own, sampled only where its postures lie
in the box, closer and closer around the smoothest track through them. Where the track bulges out of
the box between two places, more places are taken in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.columns import Seams, wrist_flips
from opl.planning.costs import CostWeights, track_cost
from opl.planning.families import GROWN, JUMP, Placement
from opl.planning.filling import BrokenEdgeError, fill_in
from opl.planning.nodes import NodeField, NodeMatrix, inverse_solutions
from opl.planning.open_matrix import Track, open_matrices
from opl.planning.plan import Found, Plan, propose_and_check
from opl.planning.problem import GrindingProblem, wheel_distances
from opl.planning.symmetry import twins
from opl.search.box import JointBox
from opl.search.outside import outside
from opl.search.smooth import Travel, smoothest_within

SAMPLES = 17  # contact positions of a place
ROUNDS = 3  # of sampling closer around a track
SUBDIVIDE = np.array([0.25, 0.5, 0.75])  # where an edge that bulges is given places
SMALLEST_EDGE = 1.0 / 500.0  # of that between cutter points that is still given places
BEND = 2.0  # times the sagitta that second differences tell: how far postures stand off a chord
BORDER = 1e-2  # belt units to look beyond what lies in the box
SWEEP = 2.0  # belt units that the contact moves from cutter point to cutter point in a sweep
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
        t, _ = _sampled(grid, coarse, free, box, 2 * SAMPLES - 1, whole=True)
        # where the part begins to cut is known to a hair only
        last = problem.cell.wheel.last_position
        t = np.clip(np.concatenate([t[:, :1] - BORDER, t, t[:, -1:] + BORDER], axis=1), -last, last)
        return self._at(places, there, placements, t)

    def _at(
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

    def plan(
        self, columns: Columns, box: JointBox, room: float, learn: Callable[[Bulges], bool]
    ) -> Plan | None:
        """Return the motion of the smoothest free track in a box.

        Args:
            columns: Places, all with postures in the box.
            box: The box.
            room: By how much the motion may leave it, in [rad] of its size.
            learn: Given where the track leaves the box on its way between places; returns whether
                that was not known before.

        Returns:
            The motion; None if nothing is free, or if something was learnt instead.
        """
        inner = box.widened(room / 2.0)
        t, spacing = _sampled(columns.t, columns.q, columns.free, inner, SAMPLES)
        sampled = _Sampled(
            self, self._at(columns.places, columns.points, columns.placements, t), inner
        )
        track = sampled.smoothest()
        if track is None:
            return None
        coarse = sampled
        for _ in range(ROUNDS):
            closer = sampled.closer(track, spacing)
            finer = closer.smoothest()
            if finer is None:
                break
            sampled, track, spacing = closer, finer, spacing * 2.0 / (SAMPLES - 1)
        bulges = sampled.bulges(track, box.widened(room))
        if bulges is not None and learn(bulges):
            return None
        plan = sampled.check(track)
        if plan is None:
            coarse.sweep()
            around = coarse.smoothest()
            plan = None if around is None else coarse.check(around)
        return plan


@dataclass(frozen=True)
class Bulges:
    """Where a track leaves its box between two places.

    Attributes:
        places: More places there, shape (n,).
        sweeps: Place and contact position, and whether that rises, where it leaves the box most
            while the contact moves over the wheel.
    """

    places: Array
    sweeps: tuple[tuple[float, float, bool], ...]


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
            inside = _missing(self.q[column], box) <= GROWN
            if not (side & inside & self.free[column]).any():
                return float(self.places[column])
        return None

    def missing(self, box: JointBox) -> Array:
        """Return by how much a box must grow for each place, in [rad], shape (n,)."""
        missing, row = np.empty(len(self.q)), np.empty(len(self.q))
        by_joint = np.ascontiguousarray(np.moveaxis(self.q, 1, 2))
        outside(by_joint, self.free, box.lower, box.upper, JUMP, missing, row)
        return missing


class _Sampled:
    """The nodes of some places at contact positions of their own."""

    def __init__(self, search: BoxTracks, columns: Columns, box: JointBox) -> None:
        self._search = search
        self._columns = columns
        self._box = box
        problem = search._problem
        q = np.where(
            (columns.free & _near(columns.q, columns.free, box))[..., None], columns.q, np.nan
        )
        self.problem = replace(
            problem,
            points=columns.points,
            field=NodeField(columns.t[0], problem.field.q[:0], tuple(self._images(q))),
            wheel_distance=columns.wheel_distance,
        )
        self.matrices = open_matrices(self.problem)

    def sweep(self) -> None:
        """Close every node that collides."""
        for matrix in self.matrices:
            columns, rows = np.nonzero(matrix.free)
            hit = self.problem.scene.collision.collides(matrix.nodes.q[columns, rows])
            matrix.free[columns[hit], rows[hit]] = False

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

    def closer(self, track: Track, spacing: Array) -> _Sampled:
        """Return closer samples around a track, whose own nodes are among them."""
        search, columns = self._search, self._columns
        own = self.matrices[track.matrix].nodes.t_along(track.rows)
        about = np.linspace(-1.0, 1.0, SAMPLES)
        last = search._problem.cell.wheel.last_position
        t = np.clip(own[:, None] + about * spacing[:, None], -last, last)
        around = search._at(columns.places, columns.points, columns.placements, t)
        return _Sampled(search, around, self._box)

    def bulges(self, track: Track, box: JointBox) -> Bulges | None:
        """Return where a track leaves the box on its way from place to place, None if nowhere."""
        problem, nodes = self.problem, self.matrices[track.matrix].nodes
        try:
            path = fill_in(problem.cell, problem.points, nodes, track.rows, problem.interpolation)
        except BrokenEdgeError:
            return None  # the check finds and blocks it
        if path.joint_range_sum <= box.size:
            return None
        spanned = nodes.along(track.rows)
        outer = JointBox(spanned.min(axis=0), spanned.max(axis=0))
        excess = _missing(path.q, outer.widened(max(box.size - outer.size, 0.0)))
        edge = path.cutter_point.astype(int)
        bulging = np.unique(edge[excess > 0.0])
        places = self._columns.places
        sweeps = []
        for column in bulging:
            on_edge = np.flatnonzero(edge == column)
            worst = on_edge[np.argmax(excess[on_edge])]
            t = path.contact_position
            change = t[min(on_edge[-1] + 1, len(t) - 1)] - t[on_edge[0]]
            if abs(change) > SWEEP * (places[column + 1] - places[column]):
                place = np.interp(path.cutter_point[worst], np.arange(len(places)), places)
                sweeps.append((float(place), float(t[worst]), bool(change > 0.0)))
        wide = bulging[np.diff(places)[bulging] > SMALLEST_EDGE]
        ends = places[wide], places[wide + 1]
        more = np.ravel(ends[0][:, None] + (ends[1] - ends[0])[:, None] * SUBDIVIDE)
        return Bulges(more, tuple(sweeps))

    def check(self, track: Track) -> Plan | None:
        """Return the plan of a track, or of the next smoothest, if its whole motion is free."""
        search, places = self._search, self._columns.places
        for _ in range(MOST_CHECKS):
            proposals = twins(self.matrices, track, self.problem.cell.robot)
            outcome = propose_and_check(self.problem, self.matrices, proposals, search.checks)
            if isinstance(outcome, Found):
                plan = outcome.plan
                search.checks = plan.checks
                path, motion = plan.path, plan.motion
                columns = np.arange(len(places))
                original = np.interp(path.cutter_point, columns, places)
                motion = motion.renumbered(np.interp(motion.cutter_point, columns, places))
                return replace(plan, path=replace(path, cutter_point=original), motion=motion)
            search.checks += len(proposals)
            following = self.smoothest()
            if following is None:
                return None
            track = following
        return None

    def _images(self, q: Array) -> list[NodeMatrix]:
        """Return the matrices that make these postures elsewhere in joint space, best first."""
        problem = self._search._problem
        robot = problem.cell.robot
        flips = [(4 * k, *flip) for k, flip in enumerate(wrist_flips(robot.arm))]
        found: list[tuple[float, int, NodeMatrix]] = []
        family = self._columns.placements[0].family
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
                nodes = NodeMatrix(family + slot, np.ascontiguousarray(at), self._columns.t, index)
                found.append((near, len(found), nodes))
        return [nodes for _, _, nodes in sorted(found, key=lambda entry: entry[:2])]


def _sampled(
    t: Array, q: Array, free: np.ndarray, box: JointBox, count: int, whole: bool = False
) -> tuple[Array, Array]:
    """Return contact positions where the chords between postures lie in a box.

    Args:
        t: Contact positions, increasing, shape (n, m).
        q: The postures in [rad], shape (n, m, 6).
        free: Which may be used: a chord with neither end free is left out, shape (n, m).
        box: The box; around the posture nearest to it where a column does not meet it.
        count: How many for each column.
        whole: Whether whole chords are sampled, and those beside them, not what is in the box.

    Returns:
        They, shape (n, count), and how far they are apart, shape (n,).
    """
    enter, leave = _clipped(q, box)
    leave = np.where(free[:, :-1] | free[:, 1:], leave, -1.0)
    nearest = np.argmin(np.where(free, _missing(q, box), np.inf), axis=1)
    found, spacing = np.empty((len(q), count)), np.empty(len(q))
    share = np.linspace(0.0, 1.0, count)
    for column, (start, end) in enumerate(zip(enter, leave, strict=True)):
        own, hit = t[column], np.flatnonzero(end >= start)
        if len(hit):
            if whole:
                hit = np.unique(np.clip(hit[:, None] + np.array([-1, 0, 1]), 0, len(own) - 2))
                start, end = np.zeros_like(start), np.ones_like(end)
            step = own[hit + 1] - own[hit]
            first, last = own[hit] + start[hit] * step, own[hit] + end[hit] * step
        else:  # the curve passes the box by a hair
            first = own[[max(nearest[column] - 1, 0)]]
            last = own[[min(nearest[column] + 1, len(own) - 1)]]
        length = np.concatenate([[0.0], np.cumsum(last - first)])
        along = share * length[-1]
        at = np.clip(np.searchsorted(length, along, side="right") - 1, 0, len(first) - 1)
        found[column] = first[at] + np.minimum(along - length[at], (last - first)[at])
        spacing[column] = length[-1] / (count - 1)
    return found, spacing


def _missing(q: Array, box: JointBox) -> Array:
    """Return by how much a box must grow to hold postures, infinite for none, shape (...)."""
    away = np.maximum(q - box.upper, 0.0) + np.maximum(box.lower - q, 0.0)
    return np.asarray(np.nan_to_num(away.sum(axis=-1), nan=np.inf))


def _near(q: Array, free: np.ndarray, box: JointBox) -> np.ndarray:
    """Return which free postures are in a box, or the nearest of a column, shape (n, m)."""
    missing = np.where(free, _missing(q, box), np.inf)
    least = missing.min(axis=1, keepdims=True)
    return np.asarray((missing <= least + 1e-12) & np.isfinite(missing))


def _clipped(q: Array, box: JointBox) -> tuple[Array, Array]:
    """Return where the chords between neighbouring rows enter and leave a box, 0 to 1.

    Shape (n, m - 1) each; one that does not meet the box leaves before it enters.
    """
    start, along = q[:, :-1], np.diff(q, axis=1)
    bend = np.nan_to_num(np.abs(np.diff(q, n=2, axis=1)))
    bend = np.where(bend < JUMP, bend, 0.0)
    nothing = np.zeros_like(bend[:, :1])
    bend = np.maximum(
        np.concatenate([nothing, bend], axis=1), np.concatenate([bend, nothing], axis=1)
    )
    low, high = box.lower - BEND * bend / 8.0, box.upper + BEND * bend / 8.0
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - start) / along, (high - start) / along
    inside = (start >= low) & (start <= high)
    still = np.abs(along) < 1e-12
    enter = np.where(still, np.where(inside, 0.0, 2.0), np.minimum(one, other)).max(axis=2)
    leave = np.where(still, np.where(inside, 1.0, -1.0), np.maximum(one, other)).min(axis=2)
    enter, leave = np.maximum(enter, 0.0), np.minimum(leave, 1.0)
    jump = ~(np.abs(along).max(axis=2) <= JUMP)
    return np.where(jump, 2.0, enter), np.where(jump, -1.0, leave)
