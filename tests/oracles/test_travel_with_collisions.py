"""Joint travel where robot or leads collide, against ways over a grid of contact positions."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.stranger_jobs import draw_job
from opl.files.resources import folder
from opl.job.load import load_job
from opl.least.least_cost import least_cost
from opl.least.pass_cost import NO_TRACK
from opl.least.pass_tracks import FEWS, PassTracks
from opl.motion.collision_check import colliding_moves
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import PassEnd
from opl.motion.whole_motion import UnreachableApproachError
from opl.planning.settings import ObjectiveWeights
from opl.run.surfacing import cut_surface
from opl.walls.shut_leads import ShutLeads
from tests.support.planned import problem_of, with_positions

FINE = 400
TRAVEL = ObjectiveWeights(joint_range=0.0, travel=1.0, time=0.0)


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


def costing(cost):
    """Return a track of one pass of which nothing is known but what it costs."""
    return [replace(NO_TRACK, cost=cost)]


def check(job, points, near):
    fine = problem_of(with_positions(job, FINE), points)
    free, colliding = cheapest(fine, True), cheapest(fine, False)
    bound = least_cost(problem_of(with_positions(job, 140), points), 1.0, 0.0, costing(free))
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
    bound = least_cost(problem, 1.0, 0.0, costing(least))
    monkeypatch.setattr(
        ShutLeads, "at", lambda self, T, family, flip, t, *reserve: np.zeros(len(t), bool)
    )
    without = least_cost(problem, 1.0, 0.0, costing(least))
    assert 1.05 * without < bound <= least


def test_a_slanted_way_is_found_where_staircases_over_the_field_mislead(tmp_path):
    """On the second pass of this random job they cost less along another, dearer way."""
    drawn = draw_job(20263806, 23, 0, tmp_path)
    job = load_job(drawn.job)
    points = cut_surface(job).points
    problem = problem_of(job, slice(*np.flatnonzero(points.pass_index == 1)[[0, -1]] + [0, 1]))
    tracks = PassTracks(problem, TRAVEL, job.search.optimal.costs)
    cost = {}
    for few in FEWS:
        found = [tracks.over_all(start) for start in tracks.over_few(0, few).values()]
        cost[few] = min(np.abs(np.diff(one.q, axis=0)).sum() for one in found if one is not None)
    cheapest = min(cost.values())
    assert cost[FEWS[0]] > 1.5 * cheapest
    assert 0.9 * cheapest < least_cost(problem, 1.0, 0.0, costing(cheapest)) <= cheapest


@pytest.fixture(scope="module")
def wavy(tmp_path_factory):
    """Return a random job: on its first pass, the least travel holds joints still."""
    drawn = draw_job(20264803, 8, 0, tmp_path_factory.mktemp("wavy"))
    job = load_job(drawn.job)
    problem = problem_of(job, slice(0, 37))
    return problem, PassTracks(problem, TRAVEL, job.search.optimal.costs)


def test_a_track_is_drawn_straight_and_stays_free(wavy):
    """Of a track over nodes of the field, which is a staircase."""
    problem, tracks = wavy
    begun = min(tracks.over_few(0, 37).values(), key=lambda track: track.cost)
    straight = tracks.straightened(begun)
    turned = np.abs(np.diff(straight.q, axis=0)).sum()
    assert turned == pytest.approx(tracks.charged(straight).cost)
    assert turned < 0.9 * tracks.charged(begun).cost
    assert not problem.scene.collision.collides(straight.q).any()
    points = problem.points.at_places(straight.places)
    assert not problem.cuts_at(straight.places, points, straight.t[:, None]).any()


def test_a_way_of_the_bound_leads_to_a_track_as_cheap_as_any_known(wavy):
    problem, tracks = wavy
    begun = filter(None, map(tracks.over_all, tracks.over_few(0).values()))
    known = tracks.charged(min(begun, key=lambda track: track.cost))
    found = []

    def attain(way):
        # a posture of one family for each place, at most half a turn from one to the next
        assert (way.ik_branch == way.ik_branch[0]).all() and way.ik_branch[0] < 4
        assert (np.abs(np.diff(way.q, axis=0)) <= np.pi).all()
        track = tracks.along_way(way, known)
        assert track is not None
        found.append(tracks.charged(track))
        return found[-1]

    bound = least_cost(problem, 1.0, 0.0, [replace(known, cost=2.0 * known.cost)], attain=attain)
    cheapest = min(track.cost for track in found)
    assert bound <= cheapest < 1.002 * min(bound, known.cost)


def test_a_way_over_many_places_but_not_all_cutter_points_leads_to_a_track_over_all(wavy):
    _, tracks = wavy
    few = tracks.over_few(0)
    known = min(filter(None, map(tracks.over_all, few.values())), key=lambda track: track.cost)
    halves = np.arange(0.0, 36.5, 0.5)
    begun = known.at(halves[halves % 1.0 != 0.0])  # all between cutter points
    ends = known.at(np.array([0.0, *begun.places, 36.0]))
    found = tracks.over_all(ends)
    assert found is not None
    assert np.isin(np.arange(37.0), found.places).all()
