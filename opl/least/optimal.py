"""The least joint range sum, proven for every contact position, and the motion that attains it.

The proof works on boxes of joint space and few walls; a box that it proposes is held against all
cutter points, and a cutter point that it misses becomes a wall. In a box that misses none the
smoothest motion is sought, until nothing can be smaller than the best by more than the gap.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.files.beside import Beside
from opl.least.box_nodes import TrackSearch
from opl.least.holders import holders
from opl.least.hope import Hope
from opl.least.motions import Motions
from opl.least.passages import Passages
from opl.least.postures import Columns
from opl.least.search_space import SearchSpace, seams_in
from opl.least.work import Work
from opl.planning.costs import PushAway
from opl.planning.plan import AT_REST, Holder, Plan
from opl.planning.problem import GrindingProblem
from opl.planning.settings import OptimalSettings
from opl.search.box import JointBox
from opl.search.forbidden import Forbidden, crossed_by_any
from opl.search.least_box import BoxProof
from opl.search.smooth import Travel
from opl.search.walls import Chain
from opl.walls.images import Seams
from opl.walls.obstructed import Obstructions
from opl.walls.placement import Placement

MOST_GIVEN_UP = 3  # boxes in which no motion is near enough to the bound
MOST_ADDED = 3  # walls at once
NEARLY_DONE = 0.8  # of the work allowed: from then on motions are sought in larger boxes, too
LAST_CHANCE = 0.85  # of it: from then on one of whatever size is sought, where none is known
# in shares of the work allowed, and beyond it: what may be done for that, and to make it smaller
ANYWHERE_SHARE, SMALLER_SHARE = 0.25, 0.1


class OptimalSearch:
    """The search, which can be stopped after any step.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: A motion that is known.
        seams: Where full turns are counted from, where that is known.
        untried: Whether no motion was tried, so that none collided.
        without_nodes: Cutter points at which no node is free: walls to begin with.
    """

    def __init__(
        self,
        problem: GrindingProblem,
        settings: OptimalSettings,
        fallback: Plan | None,
        seams: Seams | None = None,
        untried: bool = False,
        without_nodes: Sequence[int] = (),
    ) -> None:
        self._problem, self._settings = problem, settings
        robot, points, most = problem.cell.robot, problem.points, Travel(np.inf, np.inf)
        # the proof, closed below that, leaves no motion
        largest = float((robot.upper - robot.lower).sum()) / (1.0 - settings.widen)
        if fallback is not None:
            largest = fallback.path.joint_range_sum
            most = Travel(fallback.path.joint_travel, fallback.path.contact_travel)
        self._space = space = SearchSpace.of(problem, seams or seams_in(problem), largest)
        self._walls, self._families, self._sampler = space.walls, space.families, space.sampler
        push_away = PushAway(problem.cell, settings.costs)
        tracks = TrackSearch(problem, self._sampler, settings.costs, most, push_away)
        self.motions = Motions(space, tracks, settings, fallback, largest)
        self._proven = 0.0
        self._looked_anywhere = fallback is not None
        self._looks_far = True  # as long as a better motion comes of it
        self._given_up = 0  # boxes without a motion near the bound
        self._hoped = Hope(fallback is not None)
        self.forbidden: Forbidden | None = None  # of collisions, once they are known to matter
        if not untried and (fallback is None or fallback.checks > 1):  # the first is not free
            self._leave_out_collisions()
        self.proof = self._new_proof(largest)
        self._places: set[float] = set()  # of the walls
        self._work = Work(problem.scene, self._walls, self._families, tracks)
        # boxes grown know nothing of collisions
        self._hope(None if self._sampler.collisions else self._families.smallest_grown())
        hoped = min(self.proof.threshold, self._hoped.guess(0.0, largest))
        self._begin_again(self._new_proof(hoped), hoped)
        first = [0.0, float(len(points) // 2), float(len(points) - 1)]
        self._add(list(dict.fromkeys([*first, *map(float, without_nodes)])))
        self._end_if_shut()

    @property
    def finished(self) -> bool:
        """Whether there is nothing left to do."""
        closed = self.proof.closed and self.proof.threshold >= self.motions.value
        done = closed or self._proven >= self.motions.value
        ended = self._ends and self._looked_anywhere and not self.motions.may_be_smaller
        return done or ended or self.motions.value <= AT_REST

    @property
    def _ends(self) -> bool:
        """Whether the proof is given up, or its work done."""
        return self._given_up >= MOST_GIVEN_UP or self.work_share >= 1.0

    @property
    def work_share(self) -> float:
        """How much of the work allowed is done."""
        return self._work.done / self._settings.max_subproblems

    @property
    def plan(self) -> Plan | None:
        """The best motion so far."""
        return self.motions.best

    @property
    def lower_bound(self) -> float:
        """No motion has a smaller joint range sum, in [rad]."""
        return min(max(self._proven, self.proof.lower_bound), self.motions.value)

    def holders(self, beside: Beside | None = None) -> tuple[Holder, ...]:
        """Return what holds the least box over the walls up."""
        walls, images, cut = self.proof.walls, self._walls.images, self._walls.finer
        given = walls, images.of, cut, self.motions.value, self.forbidden, images.limits
        return holders(*given, beside)

    def step(self) -> None:
        """Work on one subproblem; what was proven stays so, though the proof may tell less then."""
        self._work_on_one()
        self._proven = self.lower_bound

    def _work_on_one(self) -> None:
        if not self._looked_anywhere and (self._ends or self.work_share >= LAST_CHANCE):
            self._look_anywhere()
            return
        if self._ends:  # and the best is the one that was sought anywhere: nothing else is left
            most = self.work_share + SMALLER_SHARE
            self.motions.make_smaller(lambda: self.work_share < most, self.lower_bound)
            return
        if self.proof.closed:
            self._hope_for_less()
            return
        if (candidate := self.proof.take_next()) is None:
            return
        box = JointBox(candidate.low, candidate.high)
        self._sampler.mirrored = candidate.mirrored
        allowed = self._settings.missed(self.proof.threshold)
        placements, missed = self._families.hold(box, candidate.keys, self._places, allowed)
        if placements and self._looks_far and self.work_share >= NEARLY_DONE:
            self._looks_far = self.motions.look_far_about(box, placements, self._goes_on)
            self._lower()
        best, collided = self.plan, self.motions.collided
        learnt = self._learn(box, placements, missed[:MOST_ADDED])
        if self.plan is best and self.motions.collided > collided and not self._sampler.collisions:
            self._mind_collisions()
        elif learnt or self.proof.outdated or self.proof.has_smaller:
            self.proof.put_back()
        elif candidate.bound >= self.proof.closing:
            return
        elif not self._sampler.collisions:
            self._mind_collisions()
        # costly: only where the search would end, as walls of other boxes may tell more before
        elif self.proof.look_closer(self._goes_on) or (
            self._given_up + 1 == MOST_GIVEN_UP
            and self.motions.look_about(box, placements, self._goes_on)
        ):
            self._lower()
            self.proof.put_back()
        else:
            self._given_up += 1
            self.proof.give_up()

    def _look_anywhere(self) -> None:
        """Look for a motion of whatever size, if none is known."""
        self._looked_anywhere = True
        if self.plan is not None:
            return
        if not self._sampler.collisions:
            self._begin_without_collisions()
        most = self.work_share + ANYWHERE_SHARE
        self.motions.look_anywhere(lambda: self.work_share < most)
        self._lower()

    def _goes_on(self) -> bool:
        return self.work_share < 1.0

    def _learn(self, box: JointBox, placements: Sequence[Placement], missed: list[float]) -> bool:
        """Add walls that a box misses, or look for a motion in it; return whether it can tell more.

        Otherwise nothing was learnt of the box: there is a motion, or nothing more to be found.
        """
        most = box.size + self._settings.room(box.size)  # hardly larger it may hold all
        larger = self._grown(box, placements) if placements and missed else box
        if not placements or larger is None or larger.size >= most:
            self._add(missed)
            return bool(missed)
        columns, passages, inner = self._space.look(box, placements, self._settings)
        self._hope(inner)
        allowed = self._settings.missed(self.proof.threshold)
        known, new = columns.missed(box, self._places, allowed)
        if not missed and self.proof.clear(known, chains=not passages.open):
            return True
        missed = missed or new[:MOST_ADDED]
        if not missed and not passages.walls:
            return self._learn_in(columns, passages, inner)
        fits = not missed or (inner is not None and inner.size < most)
        if passages.open and fits and self._work.left_for_early:
            best = self.plan
            with self._work.early():
                if self._learn_in(columns, passages, inner) or self.plan is not best:
                    return True
        self._add(missed, [] if missed else passages.walls)
        return True

    def _grown(self, box: JointBox, placements: Sequence[Placement]) -> JointBox | None:
        """Return a box grown to hold all cutter points, so good a motion is hoped for."""
        larger = self._families.grown(box, placements)
        if not self._sampler.collisions:
            self._hope(larger)
        return larger

    def _hope(self, box: JointBox | None) -> None:
        """Look only for what is as good as a motion in a box would be."""
        if box is not None:
            size = box.size * (1.0 + self._settings.widen)
            self.proof.threshold = self._hoped.told(size, self.proof.threshold)

    def _mind_collisions(self) -> None:
        """Leave open what was worked on: the robot collides wherever a motion might have been."""
        self.proof.put_back()  # before what is proven is noted
        self._begin_without_collisions()

    def _begin_without_collisions(self) -> None:
        """Begin the proof again without what collides, from the walls that there are."""
        self._leave_out_collisions()
        self._hoped = Hope(self.plan is not None)
        minding = self._new_proof(hoped := self._hoped.guess(self.lower_bound, self.motions.value))
        for wall in self.proof.walls:
            minding.add(wall)
        self._begin_again(minding, hoped)

    def _leave_out_collisions(self) -> None:
        """Leave out where the robot collides from now on: of walls, and of what is sampled."""
        self.forbidden = Obstructions(self._problem, self._sampler.leads, self._walls)
        self._sampler.collisions = True

    def _new_proof(self, threshold: float) -> BoxProof:
        """Return a proof without walls, for boxes below a size."""
        images, gap = self._walls.images, self._settings.gap
        return BoxProof(images.of, self._walls.finer, threshold, gap, self.forbidden, images.limits)

    def _hope_for_less(self) -> None:
        """Begin the proof again: no motion is as good as was hoped; or end it if there is none."""
        if self._end_if_shut():
            return
        known = self.motions.value, self.plan is not None, self._work.share_of_proof
        self._begin_again(self.proof, self._hoped.more(self.proof.threshold, *known))

    def _end_if_shut(self) -> bool:
        """End the proof if a pass cannot cross all of its walls; return whether that is so."""
        shut = self.plan is None and not crossed_by_any(self.proof.walls, self.forbidden)
        if shut:
            self._proven = self.motions.value
        return shut

    def _begin_again(self, proof: BoxProof, threshold: float) -> None:
        """Begin a proof again: boxes up to another size are of interest."""
        self.proof = proof.again(threshold)
        self._work.begin_again(self.proof)

    def _add(self, places: list[float], chains: Sequence[Chain] = ()) -> None:
        for wall in self._walls.walls(self._space.rectangles.take_in(chains[:MOST_ADDED])):
            self.proof.add(wall)
        for wall in self._walls.columns(places):
            self.proof.add(wall)
            self._places.add(wall.place)

    def _learn_in(self, columns: Columns, passages: Passages, box: JointBox | None) -> bool:
        """Look for a motion in a box; return whether something was learnt of the box instead."""
        learnt = self.motions.learn_in(columns, passages, box)
        self._lower()
        return learnt

    def _lower(self) -> None:
        """Look only for what is better than the best motion."""
        self.proof.threshold = min(self.proof.threshold, self.motions.value)
