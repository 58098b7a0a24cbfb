"""A pass that a joint could follow only across its limit: some places are on one side, some beyond.

Every place has postures within the limits, after full turns; a box that holds one of each place
does not keep the limits.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from opl.least.optimal import OptimalSearch
from opl.search.joint_limits import about
from opl.walls.families import Families, few_columns
from opl.walls.images import Images, seams_of
from opl.walls.sides import ANY_SIDE
from tests.support.planned import problem_of, small_job, v_job, with_positions, with_scene

LARGEST = 50.0  # [rad] boxes of that size are of no interest


@cache
def torn(limit):
    """Return a row of the V part on the flat of the wheel, joint 1 at its limit in [deg] on it."""
    job = small_job()
    wheel = replace(job.cell.wheel, max_roll=0.0)
    job = replace(job, cell=replace(job.cell, wheel=wheel), passes=replace(job.passes, rows=1))
    problem = problem_of(with_positions(job, 40))
    robot = problem.cell.robot
    lower, upper = robot.lower.copy(), robot.upper.copy()
    upper[0] = np.radians(limit)
    lower[0] = upper[0] - 2.0 * np.pi
    cell = replace(problem.cell, robot=replace(robot, lower=lower, upper=upper))
    return with_scene(problem, cell=cell)


@pytest.mark.parametrize("limit", [29.0, 6.5])  # a few places are beyond, or all but a few
def test_a_box_misses_the_places_that_are_beyond_the_limits_about_it(limit):
    problem = torn(limit)
    points, t = problem.points, problem.field.contact_positions
    q = problem.solutions(few_columns(points.pass_index))
    images = Images(problem.cell.robot, seams_of(q), LARGEST)
    families = Families(images, q, problem.cuts, points.pass_index, t, [[ANY_SIDE]])
    box = families.smallest_grown()
    (placement,), missed = families.hold(box, {}, set(), 0.01)
    assert missed
    placed = placement.of(q[:, :, placement.family])
    within = about(box, images.limits).holds(placed) & ~problem.cuts
    for place in missed:
        assert not within[int(place)].any()


def test_that_there_is_no_motion_is_proven_in_few_proofs():
    search = OptimalSearch(torn(29.0), v_job().search.optimal, None)
    hoped = []
    while not search.finished:
        search.step()
        hoped.append(search.proof.threshold)
    robot = torn(29.0).cell.robot
    assert search.lower_bound > float((robot.upper - robot.lower).sum())
    assert len(set(hoped)) < 30
