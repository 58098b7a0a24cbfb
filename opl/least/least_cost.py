"""What travel and time on the wheel cost at the least, at any contact positions.

The sum over the passes of what each costs at the least; the work allowed is shared among them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from opl.least.own_track import OwnTrack
from opl.least.pass_cost import NO_TRACK, PassCost
from opl.planning.problem import GrindingProblem
from opl.walls.barriers import all_sides
from opl.walls.columns import ColumnWalls
from opl.walls.images import Images, seams_of
from opl.walls.shut_leads import ShutLeads

MOST_WORK = 4000.0  # units, of all passes
SLACK = 1e-9  # rounding of the sums that make a bound, as a fraction of it


def least_cost(
    problem: GrindingProblem,
    travel: float,
    time: float,
    known: Sequence[OwnTrack] = (),
    goes_on: Callable[[float], bool] = lambda _: True,
    attain: Callable[[OwnTrack], OwnTrack | None] = lambda _: None,
) -> float:
    """Return what no motion along the passes costs less than, whatever its contact positions.

    Of those that keep the clearances of the plan, with leads as the process sets them. Each pass
    lies on one IK branch; moves between passes are not charged for.

    Args:
        problem: What is to be planned.
        travel: Price of a radian of joint travel on the wheel.
        time: Price of a second on the wheel.
        known: A track of each pass, with what it costs; no bound is sought beyond.
        goes_on: Given the bound so far, often; says whether to raise it further.
        attain: Given a way over some places of a pass that costs less than what is known, with a
            posture for the IK branch; returns a track about it over all cutter points, if any.
    """
    seams = seams_of(problem.solutions(np.arange(len(problem.points))))
    images = Images(problem.cell.robot, seams, 0.0)
    sides = all_sides(problem)
    walls = ColumnWalls(problem.cell, problem.scene.part, problem.points, images, sides)
    leads, total, left = ShutLeads(problem), 0.0, MOST_WORK
    n_passes = problem.points.n_passes
    for index in range(n_passes):
        ended, bound, share = False, 0.0, left / (n_passes - index)
        track = known[index] if known else NO_TRACK
        of_pass = PassCost(problem, walls, leads, sides[index], travel, time, index, share, attain)
        for bound in of_pass.rising(track):
            ended = not goes_on((total + bound) * (1.0 - SLACK))
            if ended:
                break
        total += bound
        left -= share - of_pass.left
        if ended:
            break
    return total * (1.0 - SLACK)
