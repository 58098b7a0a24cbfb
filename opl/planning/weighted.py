"""The least weighted sum of joint range sum, joint travel and time.

Travel and time add up along a track, the joint range sum does not. But no track in a box has a
larger one than the box, and dynamic programming finds the least of the rest in it: so the least box
is widened step by step up to the whole field, and the best trade between the two is kept. It is the
best of these, not proven to be the best of all; how far it may be from it, the lower bound tells:
the least of each part alone, added up.
"""

from __future__ import annotations

import heapq
import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from opl.motion.figures import Figures, figures_of_path
from opl.planning.branch import Branch, Track, branches_of
from opl.planning.costs import Costs, roughness
from opl.planning.objective import ObjectiveWeights, WeightedValue
from opl.planning.plan import Plan, check_track
from opl.planning.problem import GrindingProblem
from opl.planning.symmetry import twins, undominated
from opl.search.box import JointBox
from opl.search.certificate import least_box
from opl.search.smooth import Roughness, smoothest

# by which fraction of its size the least box is widened; at last not bounded at all
WIDENINGS = (1e-6, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0, np.inf)
BOX_GAP = 1e-4  # fraction to which the least box is proven
MOST_CHECKS = 40  # of motions: what is still blocked then leaves the fallback


Entry = tuple[float, int, int, tuple[int, ...]]


def plan_weighted(
    problem: GrindingProblem,
    weights: ObjectiveWeights,
    max_contact_change: float,
    seconds: float,
    fallback: Plan,
) -> Plan:
    """Find a collision-free motion with a small weighted sum, and a bound on the least one.

    Args:
        problem: What is to be planned.
        weights: What is charged for.
        max_contact_change: Largest change of t between neighbouring cutter points in belt units.
        seconds: After this time no further box is proven.
        fallback: A motion that is known; returned if none better is found.

    Returns:
        The plan with its weighted sum and what that can be at the least.
    """
    deadline = time.monotonic() + seconds
    costs = Costs(np.full(6, weights.travel), 0.0, weights.time, 0.0, 0.0, 0.0, 0.0)
    branches = branches_of(problem)
    lower_bound = np.inf
    queue: list[Entry] = []
    searches = {}
    for index in undominated(branches):
        branch = branches[index]
        price = roughness(problem, branch.nodes, costs, np.zeros_like(branch.free))
        certificate = least_box(
            branch.ladder,
            branch.blocked_steps,
            gap=BOX_GAP,
            seconds=deadline - time.monotonic(),
        )
        rest = smoothest(branch.ladder, branch.blocked_steps, branch.free, price)
        if rest is not None:
            # the parts are each at least their own least, so the sum is at least theirs
            least = weights.joint_range * certificate.lower_bound + rest.cost
            lower_bound = min(lower_bound, least)
        searches[index] = _Sweep(problem, branch, certificate.box, price, max_contact_change)
        queue += searches[index].entries(index, weights, range(len(WIDENINGS)))
    best, value = fallback, weights.value(_figures(problem, fallback))
    robot = problem.cell.robot
    checks = 0
    heapq.heapify(queue)
    # what a track costs at its nodes bounds from below what its path does
    while queue and queue[0][0] < value and checks < MOST_CHECKS:
        _, index, widening, rows = heapq.heappop(queue)
        for twin in twins(branches, Track(index, np.array(rows)), robot.lower, robot.upper):
            checks += 1
            plan = check_track(problem, branches[twin.branch], twin.rows, checks)
            if plan is not None:
                found = weights.value(_figures(problem, plan))
                if found < value:
                    best, value = plan, found
                break
        else:
            for entry in searches[index].entries(index, weights, [widening]):
                heapq.heappush(queue, entry)
    return replace(best, weighted=WeightedValue(value, min(lower_bound, value)))


class _Sweep:
    """The boxes of one branch."""

    def __init__(
        self,
        problem: GrindingProblem,
        branch: Branch,
        box: JointBox | None,
        price: Roughness,
        max_contact_change: float,
    ) -> None:
        changes = np.where(problem.off_wheel, np.inf, max_contact_change)
        self._branch = branch
        self._ladder = replace(branch.ladder, max_contact_change=changes)
        self._price = price
        self._box = box
        self._q = np.nan_to_num(branch.nodes.q, nan=np.inf)

    def entries(
        self, index: int, weights: ObjectiveWeights, widenings: Iterable[int]
    ) -> list[Entry]:
        """Return (weighted sum at the nodes, branch, widening, rows) of the best in each box."""
        found = []
        for widening in widenings:
            amount = WIDENINGS[widening]
            inside = self._branch.free
            if self._box is not None and np.isfinite(amount):
                inside = inside & self._box.widened(amount * self._box.size).holds(self._q)
            track = smoothest(self._ladder, self._branch.blocked_steps, inside, self._price)
            if track is not None:
                nodes = self._branch.nodes.q[np.arange(len(track.rows)), track.rows]
                total = weights.joint_range * float(np.ptp(nodes, axis=0).sum()) + track.cost
                found.append((total, index, widening, tuple(track.rows.tolist())))
        return found


def _figures(problem: GrindingProblem, plan: Plan) -> Figures:
    robot = problem.cell.robot
    return figures_of_path(plan.path, plan.motion, problem.points, problem.process, robot)
