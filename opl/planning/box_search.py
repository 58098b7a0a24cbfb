"""The least joint box of a problem that holds a free track, and the smoothest track inside it.

The certificate says how small a box of joint space that holds a connected track can be, and names
such a box. Inside it, widened a little, the smoothest track is sought. Between two of its nodes a
track may still bulge out of the box; where it does, places between the cutter points are taken in
as columns, and certificate and track are found anew. The lower bound reported is that of the
field: it holds for every path through the cutter points at its contact positions.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from opl.planning.bound import raise_bound
from opl.planning.costs import CostWeights, track_cost
from opl.planning.filling import BrokenEdgeError, fill_in
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.plan import Exhausted, Found, OutOfBudget, SearchOutcome, propose_and_check
from opl.planning.refine import RefinedProblem, carried, refine
from opl.planning.symmetry import twins, undominated
from opl.search.box import JointBox
from opl.search.certificate import least_box
from opl.search.low_travel import ROUND_OFF, low_travel_box
from opl.search.smooth import Travel, smoothest_within

SUBDIVIDE = np.array([0.25, 0.5, 0.75])  # where a step that bulges is given columns
MOST_REFINEMENTS = 8
SMALLEST_STEP = 1.0 / 16.0  # of a step between cutter points that is still given columns
# fractions to which boxes are solved: what remains of the gap of a path is then that of its track
PROOF_GAP = 1e-6
REFINED_GAP = 1e-5
CONTENT = 1.8  # times the requested widening: a gap that calls for no further proof
WIDENINGS = 2.0 ** np.arange(12)  # times the requested widening, until a track fits
LEAST_WIDENING = 1e-4  # fraction of the size of a box


@dataclass(frozen=True)
class OptimalSettings:
    """What is wanted of the optimal method.

    Attributes:
        widen: Fraction by which the joint range sum may exceed the lower bound for the sake of a
            smoother track. It becomes larger only where no track fits.
        max_contact_change: Largest change of t between neighbouring columns in belt units.
        costs: What a track is charged for inside the box.
        seconds: After this time no further improvement is begun.
        tolerance: Contact positions are halved around the path until that makes its joint range sum
            smaller by less than this fraction.
    """

    widen: float
    max_contact_change: float
    costs: CostWeights
    seconds: float
    tolerance: float


class BoxSearch:
    """The certified search, and what it has learnt of collisions.

    Args:
        whole: What is to be planned.
        settings: What is wanted.
        most: How far joints and contact should move at the most.
        ceiling: Only boxes smaller than this are of use, in [rad].
        deadline: When to stop, by `time.monotonic`.
        room: How large the box may become for the sake of less travel, in [rad]; None to keep it
            as small as can be.
    """

    def __init__(
        self,
        whole: RefinedProblem,
        settings: OptimalSettings,
        most: Travel,
        ceiling: float,
        deadline: float,
        room: float | None = None,
    ) -> None:
        self._settings = settings
        self._most = most
        self._ceiling = ceiling
        self._deadline = deadline
        self._room = room
        self._whole = self.refined = whole
        self._original = open_matrices(whole.problem)
        self._matrices = open_matrices(whole.problem)
        self._refinements = 0
        self._checks = 0
        self._blocked_something = False
        self._bound = 0.0
        self._searched = undominated(self._original)

    def run(self, gap: float) -> SearchOutcome:
        """Return the best plan, if there is one within time and widenings.

        Args:
            gap: The fraction to which the least box of the columns given is proven.
        """
        self._bound, best = self._certify(self._original, gap)
        while best is not None and not self._late():
            refinements = self._refinements
            self._blocked_something = False
            found = self._smooth_plan(*best)
            if found is not None:
                return found
            if self._blocked_something:
                self._searched = undominated(self._matrices)
            elif refinements == self._refinements:
                break
            _, best = self._certify(self._matrices, REFINED_GAP)
        return OutOfBudget() if self._late() else Exhausted()

    def prove(self, found: float) -> float:
        """Return the lower bound without a search, as `lower_bound` does after one."""
        self._bound, _ = self._certify(self._original, PROOF_GAP)
        return self.lower_bound(found)

    def lower_bound(self, found: float) -> float:
        """Return the least joint range sum of any track through the cutter points, in [rad].

        Nodes at cutter points that were found to collide are left out. Where the bound of the nodes
        stays below what was found, what happens between the cutter points is looked at too.

        Args:
            found: The joint range sum of the best path, in [rad].
        """
        columns = np.searchsorted(self.refined.places, self._whole.places)
        lost = False
        for original, matrix in zip(self._original, self._matrices, strict=True):
            lost |= bool((original.free & ~matrix.free[columns]).any())
            original.free &= matrix.free[columns]
        if lost:
            self._searched = undominated(self._original)
            self._bound = max(self._bound, self._certify(self._original, PROOF_GAP)[0])
        problem = self._whole.problem
        wanted = found * (1.0 - CONTENT * self._settings.widen)
        if self._bound < wanted:
            self._bound = min(
                raise_bound(problem, self._original[k], self._bound, wanted, self._deadline)
                for k in self._searched
            )
        return min(self._bound, found)

    def _late(self) -> bool:
        return time.monotonic() > self._deadline

    def _certify(
        self, matrices: list[OpenMatrix], gap: float
    ) -> tuple[float, tuple[int, JointBox] | None]:
        """Return the least lower bound of all matrices, and the matrix with the smallest box.

        Boxes as large as what the fallback spans are of no use; None if there is no smaller one.
        """
        lower_bound, size = np.inf, self._ceiling
        best = None
        for index in self._searched:
            matrix = matrices[index]
            certificate = least_box(
                matrix.ladder,
                matrix.blocked_edges,
                bound=size,
                gap=gap,
                seconds=self._deadline - time.monotonic(),
            )
            lower_bound = min(lower_bound, certificate.lower_bound)
            if certificate.box is not None:
                size, best = certificate.box.size, (index, certificate.box)
        return min(lower_bound, size), best

    def _smooth_plan(self, index: int, box: JointBox) -> Found | None:
        """Return the plan of the smoothest free track in the box, widened as little as possible.

        None if more was learnt of the problem first: bulges became columns, or nothing in the box
        is free.
        """
        matrix, problem = self._matrices[index], self.refined.problem
        settings = self._settings
        ladder = matrix.ladder_within(settings.max_contact_change)
        allowance = max(self._bound * (1.0 + settings.widen) - box.size, LEAST_WIDENING * box.size)
        if self._room is not None:
            nowhere = np.zeros_like(matrix.free)
            cost = track_cost(problem, matrix.nodes, settings.costs, nowhere)
            edges = matrix.blocked_edges
            wider = low_travel_box(ladder, edges, cost, box, self._room, self._most)
            if wider is None:
                return None
            box, allowance = wider, ROUND_OFF
        for widening in WIDENINGS:
            wide = box.widened(float(widening) * allowance)
            inside = matrix.free_inside(wide)
            cost = track_cost(problem, matrix.nodes, settings.costs, inside)
            while not self._late():
                smooth = smoothest_within(ladder, matrix.blocked_edges, inside, cost, self._most)
                if smooth is None:
                    break
                bulges = self._bulges(matrix, smooth.rows, wide)
                if len(bulges) and self._refinements < MOST_REFINEMENTS:
                    self._refine(bulges)
                    return None
                found = self._check(Track(index, smooth.rows))
                if found is not None:
                    return found
                self._blocked_something = True
                inside &= matrix.free
        return None

    def _bulges(self, matrix: OpenMatrix, rows: np.ndarray, box: JointBox) -> np.ndarray:
        """Return the columns from which a track steps through configurations outside of a box."""
        problem = self.refined.problem
        try:
            path = fill_in(problem.cell, problem.points, matrix.nodes, rows, problem.interpolation)
        except BrokenEdgeError:
            return np.empty(0, dtype=int)  # the check will find and block it
        bulging = np.unique(path.cutter_point[~box.holds(path.q)].astype(int))
        # where t jumps within a smaller step the robot pivots in place: columns do not change that
        return np.asarray(bulging[np.diff(self.refined.places)[bulging] > SMALLEST_STEP])

    def _refine(self, columns: np.ndarray) -> None:
        """Take in places on the steps that start at these columns."""
        before = self.refined.places
        ends = before[columns], before[columns + 1]
        places = ends[0][:, None] + (ends[1] - ends[0])[:, None] * SUBDIVIDE
        self.refined = refine(self.refined, places.ravel())
        self._matrices = carried(self._matrices, before, self.refined)
        self._refinements += 1

    def _check(self, track: Track) -> Found | None:
        """Return the plan of a track or of a twin of it, if one of them is free."""
        problem, refined = self.refined.problem, self.refined
        proposals = twins(self._matrices, track, problem.cell.robot)
        outcome = propose_and_check(problem, self._matrices, proposals, self._checks)
        if isinstance(outcome, Found):
            plan = outcome.plan
            path, motion = refined.original_path(plan.path), refined.original_motion(plan.motion)
            return Found(replace(plan, path=path, motion=motion))
        self._checks += len(proposals)
        return None
