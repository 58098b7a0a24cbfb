"""Boxes without a motion: one is found in a larger box, or chains stand in the way."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.least.box_nodes import TrackSearch
from opl.least.motions import LARGER, MOST_LOOKS, Motions
from opl.least.rows import Bulge
from opl.least.search_space import SearchSpace, seams_in
from opl.planning.costs import PushAway
from opl.search.in_box import missing
from opl.search.smooth import Travel
from tests.oracles.test_optimal import SETTINGS, recursive, v_row


@cache
def space():
    """Return what is looked at of one row of the V part."""
    return SearchSpace.of(v_row(), seams_in(v_row()), recursive(v_row).path.joint_range_sum)


@pytest.fixture(autouse=True)
def anew():
    """Begin each test with no more known than at first: ways grow finer."""
    space.cache_clear()


def motions(known, largest=None):
    """Return a search for motions in boxes of that row, of whatever size or below that known."""
    problem, costs = v_row(), SETTINGS.costs
    push_away = PushAway(problem.cell, costs)
    most = Travel(np.inf, np.inf)
    tracks = TrackSearch(problem, space().sampler, costs, most, push_away)
    largest = largest or recursive(v_row).path.joint_range_sum
    return Motions(space(), tracks, SETTINGS, known, largest)


def smaller(share):
    """Return a box that holds all places, smaller by a share about its middle; and placements."""
    box = space().families.smallest_grown()
    box = box.scaled((1.0 - share) * box.size)
    return box, space().families.hold(box, {}, set(), 0.01)[0]


def always():
    return True


def test_a_motion_is_found_about_a_box_that_is_too_small():
    search, (box, placements) = motions(None), smaller(0.02)
    assert search.look_about(box, placements, always)
    found = search.best.path
    assert box.size < found.joint_range_sum
    assert found.joint_range_sum == pytest.approx(np.ptp(found.q, axis=0).sum(), rel=1e-9)
    widest = box.widened(LARGER[-1] * box.size).size
    assert found.joint_range_sum <= widest + SETTINGS.room(widest)
    assert found.joint_range_sum < recursive(v_row).path.joint_range_sum


def test_none_is_kept_that_is_no_better():
    box, placements = smaller(0.02)
    search = motions(None)
    assert search.look_about(box, placements, always)
    while (again := motions(search.best)).look_about(box, placements, always):
        assert again.value < search.value  # among places that were cut finer
        search = again
    assert again.best is search.best


def test_a_motion_of_whatever_size_is_made_smaller():
    search = motions(None, np.inf)
    assert search.look_anywhere(always) and search.may_be_smaller
    large = search.value
    search.make_smaller(always, 0.0)
    assert not search.may_be_smaller
    assert np.ptp(search.best.path.q, axis=0).sum() == pytest.approx(search.value, rel=1e-9)
    space.cache_clear()
    least = motions(None)
    assert least.look_about(*smaller(0.02), always)
    assert search.value == pytest.approx(least.value, rel=0.01)
    assert large > 1.2 * search.value


def test_a_motion_is_not_made_smaller_than_what_is_proven():
    search = motions(None, np.inf)
    assert search.look_anywhere(always)
    large = search.best
    search.make_smaller(always, search.value)
    assert search.best is large


@pytest.mark.parametrize("share", [0.02, 0.9])
def test_boxes_as_large_as_the_best_are_not_looked_at(share, monkeypatch):
    box, placements = smaller(share)
    search = motions(recursive(v_row))
    monkeypatch.setattr(type(search), "value", property(lambda _: box.size))
    monkeypatch.setattr(type(space()), "look", lambda *_: pytest.fail("looked at"))
    assert not search.look_about(box, placements, always)


@pytest.mark.parametrize("goes_on", [False, True])
def test_places_are_cut_finer_some_times_in_each_box_as_long_as_it_goes_on(goes_on, monkeypatch):
    box, placements = smaller(0.02)
    search, sizes = motions(None), []

    def look(_, larger, *given):
        sizes.append(larger.size)
        return None, None, larger

    monkeypatch.setattr(type(space()), "look", look)
    monkeypatch.setattr(Motions, "learn_in", lambda *_: True)
    assert not search.look_about(box, placements, lambda: goes_on)
    looks = MOST_LOOKS if goes_on else 1
    larger = [box.widened(share * box.size).size for share in LARGER]
    wanted = [size for size in larger if size < search.value for _ in range(looks)]
    assert len(larger) > len(wanted) // looks > 0
    assert sizes == pytest.approx(wanted)


def postures_of(chain):
    """Return all postures along a chain of places and contact positions in [rad], shape (n, 6)."""
    problem = v_row()
    ways = [np.linspace(one, other, 400) for one, other in pairwise(chain)]
    places, t = np.concatenate(ways).T
    T = problem.points.frames_at(places)
    q = inverse_kinematics(problem.cell.robot.arm, problem.cell.Ts_base_flange(t, T))
    return q[~np.isnan(q).any(axis=-1)]


def passages(box, placements):
    given = SETTINGS.missed(box.size), SETTINGS.room(box.size)
    return space().rectangles.held(box, placements, *given)


def test_a_box_meets_no_posture_of_the_chains_that_stand_in_its_way():
    box, placements = smaller(0.3)
    assert passages(box, placements).open  # nothing is cut between places
    space().rectangles.refine([Bulge(29.0, 30.0, 8, True)], box)
    found = passages(box, placements)
    assert found.walls and not found.open
    for chain in found.walls:
        assert chain[0][1] == -chain[-1][1] == -v_row().cell.wheel.last_position
        q = postures_of(chain)
        middle = (box.lower + box.upper) / 2.0
        q = q + 2.0 * np.pi * np.round((middle - q) / (2.0 * np.pi))
        assert missing(q, box).min() > SETTINGS.missed(box.size)
    assert passages(box.widened(10.0), placements).open


def test_a_sweep_that_is_barred_again_and_again_beside_itself_soon_has_all_stretches_cut():
    """One more at each look would take as many looks as there are stretches."""
    rectangles, (box, _) = space().rectangles, smaller(0.3)
    n_stretches = len(v_row().points) - 1

    def cut():
        return set(np.floor(rectangles.places[rectangles.places % 1.0 > 0.0]).astype(int).tolist())

    looks, numbers = 0, []
    for first in range(n_stretches):
        if first not in cut():
            looks += 1
            assert rectangles.refine(
                [Bulge(float(first), first + 1.0, 8, True)], box.widened(looks)
            )
            numbers.append(len(cut()))
    assert numbers[:4] == [1, 2, 3, 4]  # few are mostly enough
    assert cut() == set(range(n_stretches))
    assert looks < n_stretches / 2
    counts = np.unique(np.floor(rectangles.places), return_counts=True)[1]
    assert (counts[:-1] == 8).all()  # none twice
