"""The track that costs least over the whole field: least travel, or least time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.planning.branch import Track, branches_of
from opl.planning.costs import Costs, roughness
from opl.planning.plan import Plan, check_track, no_path
from opl.planning.problem import GrindingProblem
from opl.planning.symmetry import twins
from opl.search.smooth import smoothest


def plan_cheapest(problem: GrindingProblem, costs: Costs, max_contact_change: float) -> Plan:
    """Find the collision-free motion whose track costs least.

    Exact over the field and all branches: what a proposed motion collides with is taken out, and
    the least of what is left is proposed next.

    Args:
        problem: What is to be planned.
        costs: The prices.
        max_contact_change: Largest change of t between neighbouring cutter points in belt units.

    Raises:
        NoPathError: If there is none; says where it ends and why.
    """
    branches = branches_of(problem)
    robot = problem.cell.robot
    prices = [roughness(problem, branch.nodes, costs, branch.free.copy()) for branch in branches]
    checks = 0
    while True:
        found = []
        for index, (branch, price) in enumerate(zip(branches, prices, strict=True)):
            changes = np.where(problem.off_wheel, np.inf, max_contact_change)
            ladder = replace(branch.ladder, max_contact_change=changes)
            smooth = smoothest(ladder, branch.blocked_steps, branch.free, price)
            if smooth is not None:
                branch.reached = len(smooth.rows)
                found.append((smooth.cost, index, smooth.rows))
        if not found:
            raise no_path(problem, branches)
        _, index, rows = min(found, key=lambda entry: entry[:2])
        for twin in twins(branches, Track(index, rows), robot.lower, robot.upper):
            checks += 1
            plan = check_track(problem, branches[twin.branch], twin.rows, checks)
            if plan is not None:
                return plan
