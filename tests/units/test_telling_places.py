"""Places that tell what a track costs, against tracks whose turns are known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.least.own_track import OwnTrack
from opl.least.telling_places import LITTLE, telling_places
from opl.search.way_cells import WayPrices

N = 40
TRAVEL = WayPrices(1.0, 0.0, np.full(N - 1, 0.1), np.full(6, 2.0), 400.0)
BOTH = WayPrices(0.5, 0.7, np.full(N - 1, 0.1), np.full(6, 2.0), 400.0)
ENDS = np.array([0.0, N - 1.0])


def track_of(first_joint):
    """Return a track along which the first joint alone turns."""
    q = np.zeros((N, 6))
    q[:, 0] = first_joint
    return OwnTrack(np.arange(N, dtype=float), np.zeros(N, dtype=int), np.zeros(N), q)


def told(prices, track, places):
    """Return what a track costs straight from place to place."""
    at = np.searchsorted(track.places, places)
    until = np.concatenate([[0.0], np.cumsum(prices.seconds)])
    q, t = track.q[at], track.t[at]
    return prices.of(np.diff(q, axis=0), np.diff(t), np.diff(until[at])).sum()


def test_of_a_joint_that_turns_one_way_no_place_tells_more():
    assert not len(telling_places(TRAVEL, track_of(np.linspace(0.0, 1.0, N)), ENDS, 10))


@pytest.mark.parametrize("turn", [1, 7, 20, 38])
def test_where_a_joint_turns_back_is_told_and_nothing_else(turn):
    forth_and_back = -np.abs(np.arange(N) - turn) * 0.01
    assert telling_places(TRAVEL, track_of(forth_and_back), ENDS, 10).tolist() == [turn]


def test_what_tells_most_comes_first():
    q = np.zeros(N)
    q[10], q[30] = 0.1, 0.3
    assert telling_places(TRAVEL, track_of(q), ENDS, 1).tolist() == [30.0]
    # of the way up to it, no place alone tells that the joint turns back at another
    assert {10.0, 30.0} <= set(telling_places(TRAVEL, track_of(q), ENDS, 10).tolist())


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([TRAVEL, BOTH]),
    st.sets(st.integers(1, N - 2), max_size=6),
    st.integers(0, N),
)
def test_they_are_new_and_tell_no_less_and_all_of_them_nearly_all(seed, prices, more, most):
    random = np.random.default_rng(seed)
    track = track_of(0.0)
    track = OwnTrack(
        track.places, track.ik_branch, np.cumsum(random.normal(0.0, 9.0, N)),
        np.cumsum(random.normal(0.0, 0.1, (N, 6)), axis=0),
    )  # fmt: skip
    places = np.union1d(ENDS, list(more))
    found = telling_places(prices, track, places, most)
    assert len(found) <= most and not np.isin(found, places).any()
    both = np.union1d(places, found)
    assert len(both) == len(places) + len(found)
    whole = told(prices, track, track.places)
    assert told(prices, track, places) - 1e-9 <= told(prices, track, both) <= whole + 1e-9
    if len(found) < most:
        assert told(prices, track, both) >= whole - N * LITTLE * whole
