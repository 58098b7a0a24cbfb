"""Leads cut short: free as proven, and no longer than that takes."""

from functools import cache

import numpy as np

from opl.motion.motion import Phase
from opl.motion.short_ways import shortened
from opl.motion.timing import time_motion
from tests.support.fcl_scene import margin_along
from tests.support.planned import (
    replay_tiny,
    small_job,
    small_plan,
    small_problem,
    timed,
    tiny_motion,
    tiny_problem,
)


@cache
def short():
    return shortened(small_plan().motion, small_problem().scene.free_moves.joined)


def free_moves(motion):
    """Return the ends of each free move, as indices."""
    return [(moves[0] - 1, moves[-1]) for phase, moves in motion.runs() if phase is Phase.FREE]


def row_of(motion, q):
    return int(np.flatnonzero((motion.q == q).all(axis=1))[0])


def test_what_is_left_is_part_of_what_was_planned_in_the_same_order():
    rows = [row_of(small_plan().motion, q) for q in short().q[:-1]]
    assert (np.diff(rows) > 0).all()
    assert len(rows) < len(small_plan().motion) - 20
    np.testing.assert_array_equal(short().ground_points, small_plan().motion.ground_points)


def test_free_moves_keep_their_clearance_in_an_independent_scene():
    motion, cell = short(), small_problem().cell
    for start, end in free_moves(motion):
        assert margin_along(cell, motion.q[start : end + 1]) > 0.0


def test_a_configuration_less_of_both_leads_is_not_free():
    motion, joined = small_plan().motion, small_problem().scene.free_moves.joined
    for start, end in free_moves(short())[1:-1]:
        before, after = row_of(motion, short().q[start]), row_of(motion, short().q[end])
        assert joined(motion.q[before], motion.q[after])
        assert not joined(motion.q[before - 1], motion.q[after])
        assert not joined(motion.q[before], motion.q[after + 1])


def test_where_no_straight_move_is_free_all_stays_as_it_was():
    motion = small_plan().motion
    same = shortened(motion, lambda one, other: False)
    np.testing.assert_array_equal(same.q, motion.q)
    assert same.kind == motion.kind


def test_where_every_move_is_free_a_lead_is_one_move():
    motion = shortened(small_plan().motion, lambda one, other: True)
    runs = [(phase, len(moves)) for phase, moves in motion.runs() if phase is not Phase.GRINDING]
    assert [count for _, count in runs] == [1] * len(runs)


def test_a_shortened_motion_is_verified():
    motion = shortened(tiny_motion(), tiny_problem().scene.free_moves.joined)
    assert len(motion) < len(tiny_motion())
    found = replay_tiny(timed(tiny_problem(), motion))
    assert found.findings == () and found.verified is not None


def test_the_way_between_passes_takes_a_fraction_of_the_time():
    problem, robot = small_problem(), small_job().cell.robot

    def off_wheel(motion):
        found = time_motion(motion, problem.points, problem.process, robot).timed
        return found.duration[~motion.grinding].sum()

    assert off_wheel(short()) < 0.9 * off_wheel(small_plan().motion)
