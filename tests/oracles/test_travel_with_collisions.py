"""Joint travel where the robot collides, against ways over a fine grid of contact positions."""

import numpy as np
import pytest

from benchmarks.stranger_jobs import draw_job
from opl.files.resources import folder
from opl.job.load import load_job
from opl.least.least_cost import least_cost
from tests.support.planned import problem_of, with_positions

FINE = 400


def s_shape():
    """Return the job of the S part, which the robot cannot grind all over the wheel."""
    return load_job(folder("workpieces") / "s_shape" / "job.yaml"), slice(0, 27)


@pytest.fixture(scope="module")
def blade(tmp_path_factory):
    """Return a random job: on its second pass, the arm collides in the cheapest postures."""
    drawn = draw_job(20262001, 1, 0, tmp_path_factory.mktemp("blade"))
    return load_job(drawn.job), slice(31, 62)


def cheapest(fine, minding_collisions):
    """Return the least travel over all nodes of a fine grid that do not cut into the wheel."""
    least = np.inf
    for nodes in fine.field.matrices:
        free = fine.free_nodes(nodes)
        if minding_collisions:
            free[free] = ~fine.scene.collision.collides(nodes.q[free])
        cost = np.where(free[0], 0.0, np.inf)
        for column in range(1, len(free)):
            turned = np.abs(nodes.q[column, :, None] - nodes.q[column - 1]).sum(axis=-1)
            turned = np.where(free[column][:, None] & free[column - 1], turned, np.inf)
            cost = (turned + cost).min(axis=1)
        least = min(least, float(cost.min()))
    return least


def check(job, points, near):
    fine = problem_of(with_positions(job, FINE), points)
    free, colliding = cheapest(fine, True), cheapest(fine, False)
    bound = least_cost(problem_of(with_positions(job, 140), points), 1.0, 0.0, np.array([free]))
    assert colliding < bound <= free
    assert bound > near * free


def test_the_bound_lies_below_the_cheapest_way_that_is_free_and_above_one_that_collides():
    check(*s_shape(), 0.9)


def test_it_looks_closer_at_postures_that_collide_where_no_others_are_as_cheap(blade):
    check(*blade, 0.98)
