"""The least weighted sum of joint range sum, joint travel and time.

Travel and time add up along a track, the joint range sum does not. But no track in a box has a
larger one than the box, and dynamic programming finds the least of the rest in it: so the least box
is widened step by step up to the whole field, and the best trade between the two is kept. It is the
best of these, not proven to be the best of all; the lower bound is that of the joint range sum and
that of travel and time, added up.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from opl.least.least_cost import least_cost
from opl.least.least_range import plan_optimal
from opl.motion.figures import figures_of_path
from opl.planning.costs import track_cost
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.plan import Found, ObjectiveValue, Plan, propose_and_check
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights, ObjectiveWeights, OptimalSettings
from opl.planning.symmetry import twins
from opl.search.box import JointBox
from opl.search.smooth import TrackCost, smoothest

# by which fraction of its size the least box is widened; at last not bounded at all
WIDENINGS = (1e-6, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0, np.inf)
MOST_CHECKS = 40  # of motions: what is still blocked then leaves the fallback

Entry = tuple[float, int, int, tuple[int, ...]]  # weighted sum, matrix, widening, rows of a track


def plan_weighted(
    problem: GrindingProblem,
    weights: ObjectiveWeights,
    settings: OptimalSettings,
    fallback: Plan,
    report: Callable[[float], None] = lambda _: None,
) -> Plan:
    """Find a collision-free motion with a small weighted sum, and a bound on the least one.

    Args:
        problem: What is to be planned.
        weights: What is charged for.
        settings: What is wanted of the least joint range sum.
        fallback: A motion that is known; returned if none better is found.
        report: As of `plan_optimal`.

    Returns:
        The plan with its weighted sum and what that can be at the least.
    """
    prices = CostWeights(np.full(6, weights.travel), 0.0, weights.time, 0.0, 0.0, 0.0, 0.0)
    matrices = open_matrices(problem)
    smallest = fallback
    if weights.joint_range > 0.0:
        smallest = plan_optimal(problem, settings, fallback, report)
    least_range = smallest.lower_bound or 0.0
    box = JointBox(smallest.path.q.min(axis=0), smallest.path.q.max(axis=0))
    lower_bound = weights.joint_range * least_range
    if weights.travel > 0.0 or weights.time > 0.0:
        lower_bound += least_cost(problem, weights.travel, weights.time)
    queue: list[Entry] = []
    sweeps = {}
    for index, matrix in enumerate(matrices):
        cost = track_cost(problem, matrix.nodes, prices, np.zeros_like(matrix.free))
        sweeps[index] = sweep = _Sweep(index, matrix, box, cost, weights)
        queue += sweep.entries(range(len(WIDENINGS)))
    heapq.heapify(queue)
    best, value = fallback, _value(problem, fallback, weights)
    checks = 0
    # what a track costs at its nodes bounds from below what its path does
    while queue and queue[0][0] < value and checks < MOST_CHECKS:
        _, index, widening, rows = heapq.heappop(queue)
        proposals = twins(matrices, Track(index, np.array(rows)), problem.cell.robot)
        outcome = propose_and_check(problem, matrices, proposals, checks)
        if isinstance(outcome, Found):
            checks = outcome.plan.checks
            found = _value(problem, outcome.plan, weights)
            if found < value:
                best, value = outcome.plan, found
        else:
            checks = outcome.checks
            for entry in sweeps[index].entries([widening]):
                heapq.heappush(queue, entry)
    known = ObjectiveValue(value, min(lower_bound, value))
    return replace(best, lower_bound=None, objective=known, holders=())


@dataclass(frozen=True)
class _Sweep:
    """The boxes of one matrix."""

    index: int
    matrix: OpenMatrix
    box: JointBox
    cost: TrackCost
    weights: ObjectiveWeights

    def entries(self, widenings: Iterable[int]) -> Iterator[Entry]:
        """Yield the best track in each box."""
        matrix = self.matrix
        for widening in widenings:
            amount, inside = WIDENINGS[widening], matrix.free
            if np.isfinite(amount):
                inside = matrix.free_inside(self.box.widened(amount * self.box.size))
            track = smoothest(matrix.ladder, matrix.blocked_edges, inside, self.cost)
            if track is not None:
                range_sum = matrix.nodes.range_sum(track.rows)
                total = self.weights.joint_range * range_sum + track.cost
                yield total, self.index, widening, tuple(track.rows.tolist())


def _value(problem: GrindingProblem, plan: Plan, weights: ObjectiveWeights) -> float:
    robot = problem.cell.robot
    figures = figures_of_path(plan.path, plan.motion, problem.points, problem.process, robot)
    return weights.value(figures)
