"""Free moves, and that none of them is taken on trust."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from opl.cell.collision import CollisionScene
from opl.cell.part_tree import part_tree
from opl.cell.robot import forward_kinematics
from opl.geometry.frames import pose, transform
from opl.geometry.shapes import Body, Box
from opl.motion import sampling
from opl.motion.free_move_search import ANEW, BlockedMoveError, FreeMoveSearch
from opl.motion.joint_lines import RESOLUTION, densify
from opl.motion.sampling import fewest, sample_path
from opl.motion.straight_moves import StraightMoves
from tests.support.bare_cells import bare_cell, block, with_obstacle
from tests.support.fcl_scene import margin_along

HOME = np.deg2rad([0.0, -20.0, -20.0, 0.0, 30.0, 0.0])
AWAY = np.deg2rad([80.0, -10.0, -30.0, 40.0, 40.0, 60.0])
CLEARANCE = 0.005


@cache
def open_cell():
    """Return an arm with a block in its hand, its wheel where it can reach it."""
    cell = bare_cell(block((0.08, 0.12, 0.06)), clearance=CLEARANCE)
    wheel = replace(cell.wheel, T_base_contact0=pose(np.eye(3), np.array([0.9, 0.5, -0.1])))
    return replace(cell, wheel=wheel)


def moves_in(cell):
    return StraightMoves(cell, CollisionScene(cell), part_tree(cell.part))


def search_in(cell):
    return FreeMoveSearch(cell, CollisionScene(cell), part_tree(cell.part))


def part_at(cell, q):
    return (forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece)[:3, 3]


# straight moves


def test_nothing_moves_farther_than_the_levers_say():
    cell = open_cell()
    levers = moves_in(cell).levers
    rng = np.random.default_rng(3)
    reach = np.zeros(6)
    for q in rng.uniform(cell.robot.lower, cell.robot.upper, (40, 6)):
        corners = transform(
            forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece, cell.part.vertices
        )
        for joint in range(6):
            turned = q + 1e-4 * np.eye(6)[joint]
            T = forward_kinematics(cell.robot, turned) @ cell.T_flange_workpiece
            moved = np.linalg.norm(transform(T, cell.part.vertices) - corners, axis=1).max()
            reach[joint] = max(reach[joint], moved / 1e-4)
    assert (reach <= levers).all()
    assert (reach > 0.4 * levers).all()


@settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 10**6))
def test_a_move_is_free_if_and_only_if_an_independent_scene_says_so(seed):
    rng = np.random.default_rng(seed)
    start = HOME + rng.normal(0.0, 0.3, 6)
    end = start + rng.normal(0.0, 0.3, 6)
    cell = open_cell()
    middle = part_at(cell, (start + end) / 2.0)
    cell = with_obstacle(cell, middle + rng.normal(0.0, 0.15, 3), rng.uniform(0.01, 0.2, 3))
    margin = margin_along(cell, np.stack([start, end]))
    if abs(margin) > 0.002:  # neither scene is checked everywhere, and ours keeps a little more
        assert moves_in(cell).free(start, end) == (margin > 0.0)


def test_a_plate_thinner_than_the_gap_between_two_looks_is_found():
    cell = open_cell()
    cell = replace(cell, part=block((0.12, 0.002, 0.06)), required_clearance=0.0)
    # the arm sweeps a thin plate over S, far out: by 14 mm from look to look
    swept = HOME + np.deg2rad([20.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    between = HOME + np.deg2rad([9.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    needle = with_obstacle(cell, part_at(cell, between), (0.0005, 0.0005, 0.0005))
    looks, _ = densify(np.stack([HOME, swept]), RESOLUTION)
    assert not CollisionScene(needle).collides(looks).any()
    assert moves_in(cell).free(HOME, swept)
    assert not moves_in(needle).free(HOME, swept)


# paths


def test_a_free_straight_move_is_taken_as_it_is():
    assert search_in(open_cell()).find(HOME, AWAY).shape == (0, 6)


@cache
def blocked_cell():
    cell = open_cell()
    return with_obstacle(cell, part_at(cell, (HOME + AWAY) / 2.0), (0.15, 0.15, 0.3), "frame")


@cache
def path_around():
    return search_in(blocked_cell()).find(HOME, AWAY)


def test_a_path_leads_around_what_blocks_the_straight_move():
    cell = blocked_cell()
    assert not moves_in(cell).free(HOME, AWAY)
    via = path_around()
    assert 1 <= len(via) <= 6
    assert margin_along(cell, np.stack([HOME, *via, AWAY])) > 0.0
    assert (via >= cell.robot.lower).all() and (via <= cell.robot.upper).all()


@settings(max_examples=3, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 10**6))
def test_every_path_that_is_found_is_free_in_an_independent_scene(seed):
    rng = np.random.default_rng(seed)
    cell = open_cell()
    for k in range(3):
        at = part_at(cell, HOME + rng.uniform(0.2, 0.8) * (AWAY - HOME))
        cell = with_obstacle(cell, at + rng.normal(0.0, 0.1, 3), rng.uniform(0.03, 0.2, 3), f"{k}")
    try:
        via = search_in(cell).find(HOME, AWAY)
    except BlockedMoveError as error:
        # only an end that is too near to something rules out these few boxes
        ends = [margin_along(cell, end[None]) for end in (HOME, AWAY)]
        assert error.end is not None and ends[error.end] < 0.0005
        return
    assert margin_along(cell, np.stack([HOME, *via, AWAY]), 0.8) > 0.0


def test_what_was_sought_elsewhere_before_does_not_change_what_a_search_finds():
    # the random numbers of OMPL are one for the whole process
    first = path_around()
    turned = AWAY + np.deg2rad([5.0, 0.0, 0.0, 0.0, 0.0, 90.0])
    assert len(search_in(blocked_cell()).find(turned, HOME))
    again = search_in(blocked_cell()).find(HOME, AWAY)
    np.testing.assert_array_equal(again, first)


def test_an_end_that_is_too_near_is_named():
    cell = with_obstacle(open_cell(), part_at(open_cell(), AWAY), (0.1, 0.1, 0.1), "anvil")
    with pytest.raises(BlockedMoveError) as caught:
        search_in(cell).find(HOME, AWAY)
    assert caught.value.end == 1
    assert "anvil" in caught.value.pair


def caged(cell, q):
    """Return a cell with six walls around the part at a configuration; one is behind it."""
    T = forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece
    low, high, thick = np.array([-0.06, -0.08, -0.045]), np.array([0.06, 0.08, 0.06]), 0.01
    walls = []
    for axis in range(3):
        for side, edge in (("low", low[axis] - thick / 2.0), ("high", high[axis] + thick / 2.0)):
            middle, size = (low + high) / 2.0, high - low + 2.0 * thick
            middle[axis], size[axis] = edge, thick
            at = pose(T[:3, :3], transform(T, middle))
            walls.append(Body(f"{'xyz'[axis]} {side} wall", Box(tuple(size)), at))
    return replace(cell, obstacles=tuple(walls))


def test_a_configuration_that_is_shut_in_is_named_with_what_shuts_it_in(monkeypatch):
    monkeypatch.setattr("opl.motion.free_move_search.MOST_CHECKED", 3000)
    search = search_in(caged(open_cell(), HOME))
    for ends in ((HOME, AWAY), (AWAY, HOME)):
        with pytest.raises(BlockedMoveError) as caught:
            search.find(*ends)
        assert caught.value.end is None
        assert caught.value.pair[0] == "part"
        assert caught.value.pair[1].endswith("wall")


def test_what_is_joined_to_an_end_sought_in_vain_is_not_sought_again(monkeypatch):
    monkeypatch.setattr("opl.motion.free_move_search.MOST_CHECKED", 3000)
    search = search_in(caged(open_cell(), HOME))
    with pytest.raises(BlockedMoveError) as first:
        search.find(HOME, AWAY)

    def searched(*arguments):
        raise AssertionError("searched again")

    monkeypatch.setattr("opl.motion.sampling.sample_path", searched)
    near = AWAY + np.deg2rad([2.0, 0.0, 0.0, 0.0, 0.0, 5.0])
    beside = HOME + np.deg2rad([0.0, 0.0, 0.0, 0.0, 0.0, 0.5])  # in the cage as well
    assert search.joined(HOME, beside)
    for ends in ((near, HOME), (AWAY, beside), (beside, near)):
        with pytest.raises(BlockedMoveError) as second:
            search.find(*ends)
        assert second.value.pair == first.value.pair


def test_what_was_in_vain_is_begun_anew_once_it_stood_for_many(monkeypatch):
    search, seeds = search_in(blocked_cell()), []
    sample_path = sampling.sample_path

    def unlucky(*arguments):
        seeds.append(arguments[-1])
        no_path = sampling.Sampled(None, np.stack([arguments[:2]]))
        return sample_path(*arguments) if arguments[-1] == ANEW[1] else no_path

    monkeypatch.setattr(sampling, "sample_path", unlucky)
    for k in range(1 + ANEW[1]):
        near = AWAY + np.deg2rad([0.01 * k, 0.0, 0.0, 0.0, 0.0, 0.0])
        if k < ANEW[1]:
            with pytest.raises(BlockedMoveError):
                search.find(HOME, near)
            continue
        via = search.find(HOME, near)
    assert seeds == [0, *ANEW[:2]]
    assert margin_along(blocked_cell(), np.stack([HOME, *via, near])) > 0.0
    # and serves those beside it
    assert len(search.find(HOME, AWAY)) >= 1
    assert len(seeds) == 3


def test_a_path_is_led_on_from_one_that_is_known(monkeypatch):
    search = search_in(blocked_cell())
    known = search.find(HOME, AWAY)

    def searched(*arguments):
        raise AssertionError("searched again")

    monkeypatch.setattr("opl.motion.sampling.sample_path", searched)
    near = AWAY + np.deg2rad([2.0, 0.0, 0.0, 0.0, 0.0, 5.0])
    beside = HOME + np.deg2rad([-2.0, 0.0, 1.0, 0.0, 0.0, 3.0])
    for ends in ((HOME, near), (near, HOME), (beside, AWAY), (near, beside)):
        via = search.find(*ends)
        assert 1 <= len(via) <= len(known) + 2
        assert margin_along(blocked_cell(), np.stack([ends[0], *via, ends[1]])) > 0.0


# sampling in the plane, where the answer is known


def wall_with_gap(low, high):
    def free(a, b):
        # the segment crosses x = 0 outside of the gap
        if (a[0] < 0.0) == (b[0] < 0.0):
            return True
        y = a[1] + (b[1] - a[1]) * a[0] / (a[0] - b[0])
        return bool(low < y < high)

    return free


def test_a_gap_in_a_wall_is_found_and_few_places_are_left():
    start, goal = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    free = wall_with_gap(0.7, 0.9)
    found = sample_path(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, lambda: False)
    np.testing.assert_array_equal(found.path[[0, -1]], [start, goal])
    assert all(free(a, b) for a, b in zip(found.path[:-1], found.path[1:], strict=True))
    assert 3 <= len(found.path) <= 5


def test_a_search_ends_after_as_many_moves_as_it_may_check():
    asked = []

    def free(a, b):
        asked.append((a, b))
        return wall_with_gap(5.0, 6.0)(a, b)

    start, goal = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    box = np.full(2, -2.0), np.full(2, 2.0)
    found = sample_path(start, goal, *box, free, lambda: len(asked) >= 500)
    assert found.path is None
    assert 500 <= len(asked) < 520


def test_refused_moves_are_those_of_the_end_that_is_shut_in():
    def free(a, b):  # nothing comes out of a small box around the goal
        return (np.abs(a - 1.0).max() < 0.1) == (np.abs(b - 1.0).max() < 0.1)

    asked = iter(range(2000))
    start, goal = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    box = np.full(2, -2.0), np.full(2, 2.0)
    found = sample_path(start, goal, *box, free, lambda: next(asked, None) is None)
    assert found.path is None
    assert len(found.refused) > 10
    assert (np.abs(found.refused[:, 0] - 1.0) < 0.1).all()


def test_idle_places_are_left_out():
    path = np.array([[0.0, 0.0], [0.5, 0.3], [1.0, 0.0], [1.0, 1.0]])
    everything = fewest(path, lambda a, b: True)
    np.testing.assert_array_equal(everything, path[[0, 3]])
    nothing = fewest(path, lambda a, b: False)
    np.testing.assert_array_equal(nothing, path)
