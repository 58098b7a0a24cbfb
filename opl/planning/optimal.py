"""The least joint range sum, certified, and the smoothest motion that attains it.

First over the field: at its contact positions the least box is known, and how far the path that was
found is from it. Then contact positions between these are taken in around the path, which may lead
to less than is possible without them.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from opl.planning.box_search import PROOF_GAP, REFINED_GAP, BoxSearch, OptimalSettings
from opl.planning.plan import Plan, Refinement
from opl.planning.problem import GrindingProblem
from opl.planning.refine import RefinedProblem
from opl.planning.tube import halved, tube
from opl.search.smooth import Travel

MOST_ROUNDS = 3  # of halving the contact positions: eight times as many


def plan_optimal(problem: GrindingProblem, settings: OptimalSettings, fallback: Plan) -> Plan:
    """Find the collision-free motion with the least joint range sum, the smoothest of these.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: The motion to return if no better one is found in time. Joints and contact should
            not travel further than along it.

    Returns:
        The plan with the lower bound of the field, and what was gained between its positions.
    """
    deadline = time.monotonic() + settings.seconds
    most = _travel(fallback)
    whole = RefinedProblem(problem, np.arange(len(problem.points), dtype=float))
    search = BoxSearch(whole, settings, most, fallback.path.joint_range_sum, deadline)
    plan, refined = search.run(PROOF_GAP), search.refined
    if plan is None or plan.path.joint_range_sum > fallback.path.joint_range_sum:
        plan, refined = fallback, whole
    plan = replace(plan, lower_bound=search.lower_bound(plan.path.joint_range_sum))
    return _between_positions(refined, plan, settings, most, deadline)


def _between_positions(
    refined: RefinedProblem, plan: Plan, settings: OptimalSettings, most: Travel, deadline: float
) -> Plan:
    """Return a plan with its contact positions refined, as long as that is worth it.

    Where joints or contact still move further than wanted, what was gained may be spent on that.
    """
    start = plan
    finer = refined.problem.field.contact_positions
    gain = np.inf
    rounds = 0
    while rounds < MOST_ROUNDS and time.monotonic() < deadline:
        if gain < settings.tolerance and _travel(plan).within(most):
            break
        finer = halved(finer)
        search = BoxSearch(
            tube(refined, plan.path, finer), settings, most, plan.path.joint_range_sum, deadline
        )
        found = search.run(REFINED_GAP)
        if found is None or found.path.joint_range_sum >= plan.path.joint_range_sum:
            break
        gain = 1.0 - found.path.joint_range_sum / plan.path.joint_range_sum
        plan, refined = replace(found, checks=plan.checks + found.checks), search.refined
        rounds += 1
    if rounds and not _travel(plan).within(most):
        room = start.path.joint_range_sum
        ceiling = plan.path.joint_range_sum
        around = tube(refined, plan.path, finer)
        search = BoxSearch(around, settings, most, ceiling, deadline, room)
        calm = search.run(REFINED_GAP)
        if calm is not None and calm.path.joint_range_sum <= room and _travel(calm).within(most):
            plan = replace(calm, checks=plan.checks + calm.checks)
    value = start.path.joint_range_sum
    refinement = Refinement(value, value - plan.path.joint_range_sum, rounds)
    return replace(plan, lower_bound=start.lower_bound, refinement=refinement)


def _travel(plan: Plan) -> Travel:
    return Travel(plan.path.joint_travel, plan.path.contact_travel)
