"""Joint travel where the robot collides, against ways over a fine grid of contact positions."""

from functools import cache

import numpy as np

from opl.files.resources import folder
from opl.job.load import load_job
from opl.least.least_cost import least_cost
from tests.support.planned import problem_of, with_positions

FIRST_PASS = slice(0, 27)
FINE = 400


@cache
def problem(positions):
    """Return the first pass of the S part, which the robot cannot grind all over the wheel."""
    job = load_job(folder("workpieces") / "s_shape" / "job.yaml")
    return problem_of(with_positions(job, positions), FIRST_PASS)


def cheapest(minding_collisions):
    """Return the least travel over all nodes of a fine grid that do not cut into the wheel."""
    fine, least = problem(FINE), np.inf
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


def test_the_bound_lies_below_the_cheapest_way_that_is_free_and_above_one_that_collides():
    free, colliding = cheapest(True), cheapest(False)
    bound = least_cost(problem(140), 1.0, 0.0, np.array([free]))
    assert colliding < bound <= free
    assert bound > 0.9 * free
