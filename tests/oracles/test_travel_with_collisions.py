"""Joint travel where robot or leads collide, against ways over a grid of contact positions."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.stranger_jobs import draw_job
from opl.files.resources import folder
from opl.job.load import load_job
from opl.least.least_cost import least_cost
from opl.least.pass_tracks import FEWS, PassTracks
from opl.motion.collision_check import colliding_moves
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import PassEnd
from opl.motion.whole_motion import UnreachableApproachError
from opl.run.surfacing import cut_surface
from opl.walls.shut_leads import ShutLeads
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
        least = min(least, cheapest_in(nodes.q, free))
    return least


def cheapest_in(q, free):
    """Return the least travel over free nodes of postures, shape (n, m, 6)."""
    cost = np.where(free[0], 0.0, np.inf)
    for column in range(1, len(free)):
        turned = np.abs(q[column, :, None] - q[column - 1]).sum(axis=-1)
        turned = np.where(free[column][:, None] & free[column - 1], turned, np.inf)
        cost = (turned + cost).min(axis=1)
    return float(cost.min())


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


def lead_is_free(problem, kind, nodes, column, row):
    """Return whether a free move may begin at the end of a lead."""
    scene = problem.scene
    t, q = float(nodes.contact_position[column, row]), nodes.at(column, row)
    end = PassEnd(kind, int(nodes.ik_branch[column]), column, t, q)
    try:
        found = scene.free_leads.find(problem.points, problem.process, end)
    except UnreachableApproachError:
        return False
    motion = Motion.off_wheel(np.vstack([end.q, found]), kind, 0)
    faults = colliding_moves(problem.cell, scene.collision, scene.part, motion)
    return not faults and scene.free_moves.blocked_at(found[-1]) is None


def test_where_a_pass_cannot_begin_or_end_no_way_does(tmp_path, monkeypatch):
    """On the fourth pass of this random job, leads are shut where the cheapest ways begin."""
    drawn = draw_job(20263806, 17, 0, tmp_path)
    job = with_positions(load_job(drawn.job), FINE)
    points = cut_surface(job).points
    problem = problem_of(job, slice(*np.flatnonzero(points.pass_index == 3)[[0, -1]] + [0, 1]))
    ends = (0, MoveKind.APPROACH), (len(problem.points) - 1, MoveKind.RETRACT)
    least = np.inf
    for nodes in problem.field.matrices:
        free = problem.free_nodes(nodes)
        free[free] = ~problem.scene.collision.collides(nodes.q[free])
        for column, kind in ends:
            some = np.flatnonzero(free[column])[::8]
            free[column] = False
            for row in some:
                free[column, row] = lead_is_free(problem, kind, nodes, column, row)
        least = min(least, cheapest_in(nodes.q, free))
    bound = least_cost(problem, 1.0, 0.0, np.array([least]))
    monkeypatch.setattr(
        ShutLeads, "at", lambda self, T, family, flip, t, *reserve: np.zeros(len(t), bool)
    )
    without = least_cost(problem, 1.0, 0.0, np.array([least]))
    assert 1.05 * without < bound <= least


def test_a_slanted_way_is_found_where_staircases_over_the_field_mislead(tmp_path):
    """On the second pass of this random job they cost less along another, dearer way."""
    drawn = draw_job(20263806, 23, 0, tmp_path)
    job = load_job(drawn.job)
    points = cut_surface(job).points
    problem = problem_of(job, slice(*np.flatnonzero(points.pass_index == 1)[[0, -1]] + [0, 1]))
    weights = replace(job.search.optimal.costs, joint_weights=np.ones(6))
    prices = replace(weights, contact_weight=0.0, time_weight=0.0, limit_weight=0.0)
    tracks = PassTracks(problem, prices)
    cost = {}
    for few in FEWS:
        found = [tracks.over_all(start) for start in tracks.over_few(0, few).values()]
        cost[few] = min(np.abs(np.diff(one.q, axis=0)).sum() for one in found if one is not None)
    cheapest = min(cost.values())
    assert cost[FEWS[0]] > 1.5 * cheapest
    assert 0.9 * cheapest < least_cost(problem, 1.0, 0.0, np.array([cheapest])) <= cheapest
