"""The least joint range sum, certified, and the smoothest motion that attains it.

First over the field: at its contact positions the least box is known, and how far the path that was
found is from it. Then contact positions between these are taken in around the path, which may lead
to less than is possible without them; if so, the bound is proven anew for all that were taken.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.planning.box_search import PROOF_GAP, REFINED_GAP, BoxSearch, OptimalSettings
from opl.planning.finer_bound import finer_bound
from opl.planning.plan import Found, Plan, Refinement
from opl.planning.problem import GrindingProblem
from opl.planning.refine import RefinedProblem
from opl.planning.tube import halved, tube
from opl.search.smooth import Travel

MOST_ROUNDS = 3  # of halving the contact positions: eight times as many
FINER_PROOF = 10.0  # [s] the bound of a finer field may take; what it is by then is reported


def plan_optimal(problem: GrindingProblem, settings: OptimalSettings, fallback: Plan) -> Plan:
    """Find the collision-free motion with the least joint range sum, the smoothest of these.

    Args:
        problem: What is to be planned.
        settings: What is wanted.
        fallback: The motion to return if no better one is found in time. Joints and contact should
            not travel further than along it.

    Returns:
        The plan with its lower bound, and what was gained between the positions of the field.
    """
    deadline = time.monotonic() + settings.seconds
    most = _travel(fallback)
    whole = RefinedProblem(problem, np.arange(len(problem.points), dtype=float))
    search = BoxSearch(whole, settings, most, _range(fallback), deadline)
    plan, refined = fallback, whole
    outcome = search.run(PROOF_GAP)
    if isinstance(outcome, Found) and _range(outcome.plan) <= _range(fallback):
        plan, refined = outcome.plan, search.refined
    plan = replace(plan, lower_bound=search.lower_bound(_range(plan)))
    plan, positions = _between_positions(refined, plan, settings, most, deadline)
    found, bound = _range(plan), plan.lower_bound
    if bound is not None and plan.refinement is not None and found < bound:
        # less than is possible without the finer positions: with them, a lower bound holds
        until = min(deadline, time.monotonic() + FINER_PROOF)
        bound = finer_bound(problem, positions, settings, found, until)
        refinement = replace(plan.refinement, bound_positions=len(positions))
        plan = replace(plan, lower_bound=bound, refinement=refinement)
    return plan


def _between_positions(
    refined: RefinedProblem, plan: Plan, settings: OptimalSettings, most: Travel, deadline: float
) -> tuple[Plan, Array]:
    """Return a plan with its contact positions refined as long as that is worth it, and these.

    Where joints or contact still move further than wanted, what was gained may be spent on that.
    """
    start = plan
    positions = finer = refined.problem.field.contact_positions
    n_positions = len(positions)
    gain = np.inf
    rounds = 0
    while rounds < MOST_ROUNDS and time.monotonic() < deadline:
        if gain < settings.tolerance and _travel(plan).within(most):
            break
        finer = halved(finer)
        search = BoxSearch(tube(refined, plan.path, finer), settings, most, _range(plan), deadline)
        outcome = search.run(REFINED_GAP)
        if not isinstance(outcome, Found) or _range(outcome.plan) >= _range(plan):
            break
        gain = 1.0 - _range(outcome.plan) / _range(plan)
        plan, refined = _added(plan, outcome.plan), search.refined
        positions = finer
        rounds += 1
    if rounds and not _travel(plan).within(most):
        room = _range(start)
        around = tube(refined, plan.path, finer)
        outcome = BoxSearch(around, settings, most, _range(plan), deadline, room).run(REFINED_GAP)
        if isinstance(outcome, Found):
            wider = outcome.plan
            if _range(wider) <= room and _travel(wider).within(most):
                plan, positions = _added(plan, wider), finer
    gain = _range(start) - _range(plan)
    bound = start.lower_bound
    refinement = Refinement(_range(start), bound, gain, rounds, n_positions)
    return replace(plan, lower_bound=bound, refinement=refinement), positions


def _added(before: Plan, found: Plan) -> Plan:
    """Return a plan that counts the motions checked for the one before as well."""
    return replace(found, checks=before.checks + found.checks)


def _range(plan: Plan) -> float:
    return plan.path.joint_range_sum


def _travel(plan: Plan) -> Travel:
    return Travel(plan.path.joint_travel, plan.path.contact_travel)
