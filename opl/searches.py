"""Which search a job asks for, and how what it finds compares with the others."""

from __future__ import annotations

from dataclasses import replace

from opl.job.search import Method, Objective
from opl.motion.figures import Figures, figures_of_path, figures_of_points
from opl.outcome import Outcome
from opl.planning.cheapest import plan_cheapest
from opl.planning.costs import ObjectiveWeights
from opl.planning.optimal import plan_optimal
from opl.planning.plan import Found, Plan
from opl.planning.problem import GrindingProblem
from opl.planning.starts import Start, plan_recursive, try_recursive
from opl.planning.weighted import plan_weighted

# of motions from the paper's start node, which are sought for comparison only
MOST_CHECKS = 20


def search_path(outcome: Outcome, problem: GrindingProblem) -> Plan:
    """Search the path by the method and for the objective of the job.

    Raises:
        NoPathError: If there is none.
    """
    search = outcome.job.search
    outcome.recursive = plan = plan_recursive(problem, search.start)
    if search.method is Method.RECURSIVE:
        return plan
    if search.objective is Objective.RANGE:
        return plan_optimal(problem, search.optimal, plan)
    if search.objective is Objective.WEIGHTED:
        weights, change = search.objective_weights, search.optimal.max_contact_change
        return plan_weighted(problem, weights, change, search.optimal.seconds, plan)
    travel, time = (0.0, 1.0) if search.objective is Objective.TIME else (1.0, 0.0)
    prices = search.optimal.costs
    costs = replace(prices, joint_weights=travel * prices.joint_weights, time_weight=time)
    cheapest = plan_cheapest(problem, costs, search.optimal.max_contact_change)
    # the cheapest at the cutter points need not be so on the way between them
    alone, robot = ObjectiveWeights(0.0, travel, time), problem.cell.robot
    values = [
        alone.value(figures_of_path(one.path, one.motion, problem.points, problem.process, robot))
        for one in (cheapest, plan)
    ]
    return cheapest if values[0] <= values[1] else replace(plan)


def compare(outcome: Outcome) -> dict[str, Figures]:
    """Return the figures of the contact-fixed path and of all that were found."""
    job, points = outcome.job, outcome.points
    assert points is not None
    robot = job.cell.robot
    compared = {}
    if outcome.fixed is not None and outcome.fixed.q is not None:
        q = outcome.fixed.q
        compared["fixed"] = figures_of_points(q, points, job.process, robot)
    plans = {"paper_start": outcome.paper_start, "recursive": outcome.recursive}
    if outcome.plan is not outcome.recursive:
        plans["optimal"] = outcome.plan
    for name, plan in plans.items():
        if plan is not None:
            compared[name] = figures_of_path(plan.path, plan.motion, points, job.process, robot)
    return compared


def from_paper_start(problem: GrindingProblem) -> Plan | None:
    """Return what the paper's search finds from the paper's own start node, None if nothing."""
    outcome = try_recursive(problem, Start.NEAREST, MOST_CHECKS)
    return outcome.plan if isinstance(outcome, Found) else None
