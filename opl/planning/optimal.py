"""The least joint range sum, proven for every contact position, and the motion that attains it.

The proof works on boxes of joint space and few walls; a box that it proposes is held against all
cutter points, and one that no posture of some cutter point lies in makes that cutter point a wall.
In a box that misses none the smoothest motion is sought. The proof ends when nothing is left that
could be smaller than the best motion by more than the gap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.planning.box_columns import Columns, ColumnSampler
from opl.planning.box_track import BoxTracks, Bulges
from opl.planning.columns import ColumnWalls, Sweep
from opl.planning.costs import CostWeights
from opl.planning.families import Families, Fit, Placement, grown
from opl.planning.holders import Holder, holders
from opl.planning.images import Images, seams_of
from opl.planning.obstructed import Obstructions
from opl.planning.plan import Plan
from opl.planning.problem import GrindingProblem
from opl.planning.rows import Row
from opl.search.box import JointBox
from opl.search.least_box import BoxProof, Candidate
from opl.search.smooth import Travel

PROOF_SHARE = 0.9  # of the widening: how far the bound may stay below the path
ROOM_SHARE = 0.4  # of the widening: how much larger than its box the path may be
MISSED = 0.05  # of the widening: what a box may miss a cutter point by and still hold it
RAISED = 1.004  # times what was hoped for and does not exist: what is hoped for next
CLEARLY_MISSED = 0.02  # of the best size: what a box that is not settled may miss
SWEEP_MISSED = 0.2  # of the widening: what it may miss a contact position by between them
PLACE_DIGITS = 5  # of places, in cutter points
MOST_GIVEN_UP = 3  # boxes in which no motion is near enough to the bound
MOST_ADDED = 3  # walls at once


@dataclass(frozen=True)
class OptimalSettings:
    """What is wanted of the optimal method.

    Attributes:
        widen: Fraction by which the joint range sum may exceed the lower bound for the sake of a
            smoother track.
        max_contact_change: Largest change of t between neighbouring columns in belt units.
        costs: What a track is charged for inside the box.
        max_subproblems: How many subproblems of the proof are looked at, at the most.
    """

    widen: float
    max_contact_change: float
    costs: CostWeights
    max_subproblems: int


class OptimalSearch:
    """The search, which can be stopped after any step.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: A motion that is known.
    """

    def __init__(self, problem: GrindingProblem, settings: OptimalSettings, fallback: Plan) -> None:
        self._problem = problem
        self._points = problem.points
        self._settings = settings
        seams = seams_of(problem.field.q)
        found = fallback.path.joint_range_sum
        images = Images(problem.cell.robot, seams, found)
        part, points = problem.scene.part, problem.points
        self._walls = ColumnWalls(problem.cell, part, points, images)
        self._families = Families(images, problem.field.q, problem.cuts, points.pass_index)
        self._sampler = ColumnSampler(problem, seams)
        most = Travel(fallback.path.joint_travel, fallback.path.contact_travel)
        self._tracks = BoxTracks(
            problem, self._sampler, settings.costs, settings.max_contact_change, most
        )
        self.plan = fallback
        self._proven = self._least_hope = 0.0
        self._spent = self._given_up = 0
        gap = PROOF_SHARE * settings.widen
        self.proof = BoxProof(self._walls.images.of, self._walls.finer, found, gap)
        self._places: set[float] = set()
        self._rows: list[tuple[Array, float, bool]] = []
        self._passed: set[tuple[float, float, float]] = set()
        self._columns = np.arange(len(problem.points), dtype=float)
        self._hope(self._families.smallest_grown())
        n = len(problem.points)
        first = [0.0, float(n // 2), float(n - 1)]
        self._add(list(dict.fromkeys(first + self._families.unreached())))

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        if self._given_up >= MOST_GIVEN_UP:
            return True
        spent = self._spent + self.proof.subproblems >= self._settings.max_subproblems
        return spent or (self.proof.closed and self.proof.threshold >= self._value)

    @property
    def _value(self) -> float:
        return self.plan.path.joint_range_sum

    @property
    def lower_bound(self) -> float:
        """No motion has a smaller joint range sum, in [rad]."""
        return min(max(self._proven, self.proof.lower_bound), self._value)

    def holders(self) -> tuple[Holder, ...]:
        """Return what holds the least box over the walls up."""
        return holders(self.proof.walls, self._walls.images.of, self._walls.finer, self._value)

    def step(self) -> None:
        """Work on one subproblem."""
        if self.proof.closed:
            self._hope_for_less()
            return
        candidate = self.proof.take_next()
        if candidate is None:
            return
        box = JointBox(candidate.low, candidate.high)
        placements, missed = self._hold(candidate)
        if not candidate.settled:
            if not self._sampler.collisions:
                self._hope(self._families.grown(box, placements))
            if missed:
                self._add(missed)
                self.proof.put_back()
            else:
                self.proof.split()
            return
        columns = None
        if len({(one.family, float(one.flip[0][4])) for one in placements}) == 1:
            columns = self._sampler.columns(box, placements, self._columns)
            rows = self._sampler.rows(self._rows, columns)
            inner = grown(columns.q, columns.free, box)
            for row in rows:
                inner = row.grown(inner) if inner is not None and row.must else inner
            self._hope(inner)
            missed = missed or self._missed(columns, box)
        if missed:
            self._add(missed)
            self.proof.put_back()
            return
        if columns is not None and inner is not None and self._try(columns, rows, inner):
            self.proof.put_back()
        elif candidate.bound < self.proof.closing and not self._sampler.collisions:
            self._mind_collisions()
        elif candidate.bound < self.proof.closing:
            # the bound cannot rise further; the path may still come nearer to it
            self._given_up += 1
            self.proof.give_up()

    def _hope(self, box: JointBox | None) -> None:
        """Look only for what is as good as a motion in a box would be."""
        if box is not None:
            hoped = max(box.size * (1.0 + self._settings.widen), self._least_hope)
            self.proof.threshold = min(self.proof.threshold, hoped)

    def _mind_collisions(self) -> None:
        """Leave out where the robot collides: it does wherever a motion might have been."""
        scene = self._problem.scene
        self._walls.obstructions = Obstructions(scene.collision, self._walls.images)
        self._sampler.collisions = True
        self._places.clear()
        self._begin_again(self._value, 0.0)

    def _hope_for_less(self) -> None:
        """Begin the proof again: no motion is as good as a box had made hope."""
        hope = min(self._value, self.proof.threshold * RAISED)
        self._begin_again(hope, hope)

    def _begin_again(self, threshold: float, least_hope: float) -> None:
        """Begin the proof again: boxes up to a larger size are of interest."""
        self._proven = self.lower_bound
        self._spent += self.proof.subproblems
        self._least_hope = least_hope
        walls = self.proof.walls
        gap = PROOF_SHARE * self._settings.widen
        self.proof = BoxProof(self._walls.images.of, self._walls.finer, threshold, gap)
        for wall in walls:
            self.proof.add(wall)

    def _missed(self, columns: Columns, box: JointBox) -> list[float]:
        """Return the places that a box misses most, looked at closely."""
        missing = columns.missing(box)
        missing[np.isin(columns.places, list(self._places))] = 0.0
        worst = np.argsort(-missing, kind="stable")[:MOST_ADDED]
        allowed = MISSED * self._settings.widen * self.proof.threshold
        return [float(columns.places[k]) for k in worst if missing[k] > allowed]

    def _add(self, places: list[float]) -> None:
        for wall in self._walls.walls(places):
            self.proof.add(wall)
            self._places.add(wall.place)

    def _learn(self, columns: Columns, box: JointBox, room: float, bulges: Bulges) -> bool:
        """Take in where a track leaves a box between places; return whether that is new.

        A contact position that motions in the box must pass, and nowhere can, becomes a wall. One
        that they can pass somewhere is passed there: those places are looked at.
        """
        more, walls = [bulges.places], []
        last = len(self._points) - 1
        known = len(self._rows)
        for place, t, upwards in bulges.sweeps:
            before, after = columns.around(box, place, t, upwards)
            must = before is not None and after is not None
            index = self._points.pass_index
            first = np.floor(place) if before is None else before
            end = min(np.floor(place) + 1.0, last) if after is None else after
            if index[int(first)] != index[int(end)]:
                continue
            key = float(first), float(end), round(t, 1)
            if key in self._passed:
                continue
            self._passed.add(key)
            row = self._sampler.row(key[0], key[1], t, must, columns, box)
            if must and row.missing(box) > SWEEP_MISSED * self._settings.widen * box.size:
                walls.append(Sweep(key[0], key[1], t, upwards))
                continue
            self._rows.append((row.places, t, must))
            stretches = row.inside(box.widened(room / 2.0))
            more.append(np.append(stretches.ravel(), stretches.mean(axis=1)))
        for wall in self._walls.sweeps(walls) if walls else ():
            self.proof.add(wall)
        grown = np.union1d(self._columns, np.round(np.concatenate(more), PLACE_DIGITS))
        new = len(grown) > len(self._columns) or len(self._rows) > known or bool(walls)
        self._columns = grown
        return new

    def _hold(self, candidate: Candidate) -> tuple[list[Placement], list[float]]:
        """Return the image of each pass that fits into the box, and the cutter points it misses."""
        share = MISSED * self._settings.widen if candidate.settled else CLEARLY_MISSED
        allowed = share * self.proof.threshold
        reference = self.proof.walls[0].pass_index
        placements, missed = [], []
        for index in range(self._points.n_passes):
            fits = self._families.fits(index, candidate.low, candidate.high, index == reference)
            first = int(np.argmax(self._points.pass_index == index))
            columns = range(first, first + len(fits[0].missing))
            known = np.array([float(column) in self._places for column in columns])
            # the image that the candidate has in mind: the walls of the pass fit into the box
            best = min(fits, key=lambda fit: self._misfit(fit, known))
            placements.append(best.placement)
            missing = np.where(known, -1.0, best.missing)
            worst = int(np.argmax(missing))
            if missing[worst] > allowed:
                missed.append((float(missing[worst]), float(first + worst)))
        missed.sort(reverse=True)
        places = list(dict.fromkeys(place for _, place in missed))
        return placements, places[:MOST_ADDED]

    @staticmethod
    def _misfit(fit: Fit, known: np.ndarray) -> tuple[float, float]:
        """Return what a box misses of the walls of a pass, and of all its columns."""
        at_walls = float(fit.missing[known].max(initial=0.0))
        return round(at_walls, 2), float(fit.missing.max())

    def _try(self, columns: Columns, rows: list[Row], box: JointBox) -> bool:
        """Look for a motion in a box; return whether something was learnt of the box instead."""
        learnt = False
        room = ROOM_SHARE * self._settings.widen * box.size

        def learn(bulges: Bulges) -> bool:
            nonlocal learnt
            learnt = self._learn(columns, box, room, bulges)
            return learnt

        found = self._tracks.plan(columns, rows, box, room, learn)
        if found is not None and found.path.joint_range_sum < self._value:
            self.plan = found
            self.proof.threshold = min(self.proof.threshold, self._value)
        return learnt


def plan_optimal(problem: GrindingProblem, settings: OptimalSettings, fallback: Plan) -> Plan:
    """Find the collision-free motion with the least joint range sum, the smoothest of these.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: The motion to return if no better one is found. Joints and contact should not
            travel further than along it.

    Returns:
        The plan with its lower bound.
    """
    search = OptimalSearch(problem, settings, fallback)
    while not search.finished:
        search.step()
    return replace(search.plan, lower_bound=search.lower_bound, holders=search.holders())
