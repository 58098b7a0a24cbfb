"""The least joint range sum, proven for every contact position, and the motion that attains it.

The proof works on boxes of joint space and few walls; a box that it proposes is held against all
cutter points, and a cutter point that it misses becomes a wall. In a box that misses none the
smoothest motion is sought, until nothing can be smaller than the best by more than the gap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.planning.box_columns import Columns, ColumnSampler
from opl.planning.box_track import BoxTracks
from opl.planning.columns import ColumnWalls, Sweep
from opl.planning.costs import CostWeights
from opl.planning.families import Families, Placement, few_columns, grown
from opl.planning.holders import Holder, holders
from opl.planning.images import Images, seams_of
from opl.planning.obstructed import Obstructions
from opl.planning.plan import Plan
from opl.planning.problem import GrindingProblem
from opl.planning.rows import Bulges, Row
from opl.search.box import JointBox
from opl.search.least_box import BoxProof
from opl.search.smooth import Travel

PROOF_SHARE = 0.9  # of the widening: how far the bound may stay below the path
ROOM_SHARE = 0.4  # of the widening: how much larger than its box the path may be
MISSED = 0.05  # of the widening: what a box may miss a cutter point by and still hold it
RAISED = 1.004  # times what was hoped for and does not exist: what is hoped for next
CLEARLY_MISSED = 0.02  # of the best size: what a box that is not settled may miss
SWEEP_MISSED = 0.2  # of the widening: what it may miss a contact position by between them
PLACE_DIGITS = 5  # of places, in cutter points
# a unit of work is what takes about a millisecond; that many make one
QUERIES_OF_WORK = 50  # configurations asked about for collisions
NUMBERS_OF_WORK = 1e6  # numbers worked on in linear programs
SUBPROBLEMS_OF_WORK = 4
WORK_OF_A_WALL = 50
WORK_OF_A_CHECK = 1  # for each of the places of a motion
CLEARLY_LESS = 0.005  # of the best: what a motion in such a box should be better by
EARLY_SHARE = 0.3  # of the work: motions in boxes that are not proven to be the least
FIRST_WORK = 300  # that may be spent on those at once
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
        max_subproblems: How much is tried, in units of work.
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

    def __init__(
        self, problem: GrindingProblem, settings: OptimalSettings, fallback: Plan | None
    ) -> None:
        self._problem = problem
        self._points = problem.points
        self._settings = settings
        seams = seams_of(problem.field.q[few_columns(problem.points.pass_index)])
        robot = problem.cell.robot
        largest, most = float((robot.upper - robot.lower).sum()), Travel(np.inf, np.inf)
        if fallback is not None:
            largest = fallback.path.joint_range_sum
            most = Travel(fallback.path.joint_travel, fallback.path.contact_travel)
        images = Images(robot, seams, largest)
        part, points = problem.scene.part, problem.points
        self._walls = ColumnWalls(problem.cell, part, points, images)
        self._families = Families(images, problem.field.q, problem.cuts, points.pass_index)
        self._sampler = ColumnSampler(problem, seams)
        self._tracks = BoxTracks(
            problem, self._sampler, settings.costs, settings.max_contact_change, most
        )
        self.plan = fallback
        self._largest = largest
        self._proven = self._least_hope = 0.0
        self._given_up = 0
        self._before = self._early = 0.0  # work on proofs that were begun again; on early motions
        self._queries = self._asked
        gap = PROOF_SHARE * settings.widen
        self.proof = BoxProof(self._walls.images.of, self._walls.finer, largest, gap)
        self._places: set[float] = set()
        self._rows: list[tuple[Array, float, bool]] = []
        self._passed: set[tuple[float, float, float]] = set()
        self._columns = np.arange(len(problem.points), dtype=float)
        self._hope(self._families.smallest_grown())
        first = [0.0, float(len(points) // 2), float(len(points) - 1)]
        self._add(list(dict.fromkeys(first + self._families.unreached())))

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        done = self.proof.closed and self.proof.threshold >= self._value
        return done or self._given_up >= MOST_GIVEN_UP or self.work_share >= 1.0

    @property
    def work_share(self) -> float:
        """How much of the work allowed is done."""
        return self._work / self._settings.max_subproblems

    @property
    def _work(self) -> float:
        """What was done so far, in units of work: counted, not measured."""
        made = self._walls.made * WORK_OF_A_WALL
        asked = (self._asked - self._queries) / QUERIES_OF_WORK
        seen = self._families.work + self._sampler.work
        checked = self._tracks.places_checked * WORK_OF_A_CHECK
        return self._before + self._work_of_proof + made + asked + seen + checked

    @property
    def _work_of_proof(self) -> float:
        proof = self.proof
        return proof.subproblems / SUBPROBLEMS_OF_WORK + proof.work / NUMBERS_OF_WORK

    @property
    def _asked(self) -> int:
        return self._problem.scene.collision.queries + self._tracks.queries

    @property
    def open_because(self) -> str | None:
        """Why the bound is further off than wanted, None if it is not."""
        if self.lower_bound >= self._value * (1.0 - self._settings.widen):
            return None
        if self._given_up >= MOST_GIVEN_UP:
            return "no motion was found nearer to the bound"
        return "the work allowed for the proof was done before it was complete"

    @property
    def _value(self) -> float:
        return self._largest if self.plan is None else self.plan.path.joint_range_sum

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
        share = MISSED * self._settings.widen if candidate.settled else CLEARLY_MISSED
        allowed = share * self.proof.threshold
        placements, missed = self._families.hold(box, candidate.keys, self._places, allowed)
        missed = missed[:MOST_ADDED]
        if not candidate.settled:
            if not self._sampler.collisions and placements:
                self._look_for_more(box, placements)
            if missed:
                self.proof.show_soon()
                self._add(missed)
                self.proof.put_back()
            else:
                self.proof.split()
            return
        looked_at = None
        if _alike(placements):
            looked_at = self._look(box, placements)
            columns, _, inner = looked_at
            self._hope(inner)
            missed = missed or self._missed(columns, box)
        if missed:
            self._add(missed)
            self.proof.put_back()
            return
        if looked_at is not None and self._try(*looked_at):
            self.proof.put_back()
        elif candidate.bound < self.proof.closing and not self._sampler.collisions:
            self._mind_collisions()
        elif candidate.bound < self.proof.closing:
            self._given_up += 1
            self.proof.give_up()

    def _look(
        self, box: JointBox, placements: Sequence[Placement]
    ) -> tuple[Columns, list[Row], JointBox | None]:
        """Return places and rows sampled near a box, and the box grown for them."""
        columns = self._sampler.columns(box, placements, self._columns)
        rows = self._sampler.rows(self._rows, columns)
        inner = grown(columns.q, columns.free, box)
        for row in rows:
            inner = row.grown(inner) if inner is not None and row.must else inner
        return columns, rows, inner

    def _look_for_more(self, box: JointBox, placements: Sequence[Placement]) -> None:
        """Grow a box that is not settled until it holds all; look for a motion in it, if small."""
        larger, threshold = self._families.grown(box, placements), self.proof.threshold
        self._hope(larger)
        if self.proof.threshold < threshold:
            self.proof.show_soon()
        before = self._work
        least = self._value * (1.0 - CLEARLY_LESS)
        if larger is None or larger.size > least or not _alike(placements):
            return
        if self._early < FIRST_WORK + EARLY_SHARE * before:
            columns, _, inner = self._look(larger, placements)
            if inner is not None:
                self._keep(self._tracks.plan(columns, (), inner, self._room(inner), _nothing))
            self._early += self._work - before

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
        self._before += self._work_of_proof
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
            for begin, stop in row.inside(box.widened(room / 2.0)):
                if not ((self._columns >= begin) & (self._columns <= stop)).any():
                    more.append(np.array([(begin + stop) / 2.0]))
        for wall in self._walls.sweeps(walls) if walls else ():
            self.proof.add(wall)
        before = len(self._columns)
        self._columns = np.union1d(self._columns, np.round(np.concatenate(more), PLACE_DIGITS))
        return len(self._columns) > before or len(self._rows) > known or bool(walls)

    def _try(self, columns: Columns, rows: list[Row], box: JointBox | None) -> bool:
        """Look for a motion in a box; return whether something was learnt of the box instead."""
        if box is None:
            return False
        learnt, room = False, self._room(box)

        def learn(bulges: Bulges) -> bool:
            nonlocal learnt
            learnt = self._learn(columns, box, room, bulges)
            return learnt

        self._keep(self._tracks.plan(columns, rows, box, room, learn))
        return learnt

    def _room(self, box: JointBox) -> float:
        return ROOM_SHARE * self._settings.widen * box.size

    def _keep(self, found: Plan | None) -> None:
        """Keep a motion that is better than the best."""
        if found is not None and found.path.joint_range_sum < self._value:
            self.plan = found
            self.proof.threshold = min(self.proof.threshold, self._value)


def _nothing(_: Bulges) -> bool:
    """Learn nothing of where a track leaves its box."""
    return False


def _alike(placements: Sequence[Placement]) -> bool:
    """Return whether all passes are ground in one family with the wrist to one side."""
    return len({(one.family, one.number) for one in placements}) == 1


def plan_optimal(
    problem: GrindingProblem,
    settings: OptimalSettings,
    fallback: Plan | None,
    report: Callable[[float], None] = lambda _: None,
) -> Plan | None:
    """Find the collision-free motion with the least joint range sum, the smoothest of these.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: A motion that is known, if one is: joints and contact should travel no further.
        report: Given how much of the work allowed is done, after every step; may raise.

    Returns:
        The plan with its lower bound; None only if no motion was known and none was found.
    """
    search = OptimalSearch(problem, settings, fallback)
    while not search.finished:
        search.step()
        report(min(search.work_share, 1.0))
    if search.plan is None:
        return None
    bound, why, held = search.lower_bound, search.open_because, search.holders()
    return replace(search.plan, lower_bound=bound, open_because=why, holders=held)
