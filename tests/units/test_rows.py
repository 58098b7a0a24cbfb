"""Where tracks get no further and what rows shut, against all tracks and edges one by one."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.least.rows import (
    MOST_PARTS,
    SAME,
    SAME_PLACE,
    Row,
    bars,
    broken_at,
    crossed,
    shut_edges,
)
from opl.least.stretches import stretches
from opl.search.box import JointBox
from opl.search.in_box import clipped
from opl.search.ladder import Ladder

COLUMNS, ROWS = 4, 3
EDGES = (COLUMNS - 1) * ROWS * ROWS


@settings(deadline=None)
@given(
    st.sets(st.integers(0, EDGES - 1)),
    st.lists(st.booleans(), min_size=COLUMNS * ROWS, max_size=COLUMNS * ROWS),
)
def test_bars_are_where_the_longest_tracks_stop_from_either_end_and_beyond_each(blocked, free):
    free = np.array(free).reshape(COLUMNS, ROWS)
    free[0, 0] = free[-1, 0] = True
    ladder = Ladder(
        np.zeros((COLUMNS, ROWS, 6)),
        free,
        np.arange(3.0),
        np.zeros(COLUMNS - 1, dtype=bool),
        1.0,
        1.0,
    )
    shut = np.isin(np.arange(EDGES), sorted(blocked)).reshape(COLUMNS - 1, ROWS, ROWS)

    def goes(track, first):
        return all(free[k, row] for k, row in enumerate(track, first)) and not any(
            shut[k, row, after] for k, (row, after) in enumerate(itertools.pairwise(track), first)
        )

    def stops(first_of):
        """Return how many columns are behind each place where tracks stop, in their direction."""
        found, begin = set(), 0
        while begin < COLUMNS:
            length = max(
                (
                    length
                    for length in range(1, COLUMNS - begin + 1)
                    for track in itertools.product(range(ROWS), repeat=length)
                    if goes(track, first_of(begin, length))
                ),
                default=1,  # nothing is free
            )
            begin += length
            found.add(begin)
        return found - {COLUMNS}

    on = stops(lambda begin, length: begin)
    back = stops(lambda begin, length: COLUMNS - begin - length)
    found = bars(np.arange(COLUMNS) / 10.0, [ladder], [np.flatnonzero(shut)])
    expected = sorted({(n - 1) / 10.0 for n in on} | {(COLUMNS - 1 - n) / 10.0 for n in back})
    assert sorted({bar.first for bar in found}) == pytest.approx(expected)


def test_a_bar_is_told_once_though_tracks_of_several_images_end_there():
    free = np.ones((COLUMNS, ROWS), dtype=bool)
    free[2] = False
    q, t, on = np.zeros((COLUMNS, ROWS, 6)), np.arange(3.0), np.zeros(COLUMNS - 1, dtype=bool)
    ladders = [Ladder(q + turn, free, t, on, 1.0, 1.0) for turn in (0.0, 2.0 * np.pi)]
    found = bars(np.arange(COLUMNS, dtype=float), ladders, [np.empty(0, dtype=int)] * 2)
    assert {(bar.first, bar.last) for bar in found} == {(1.0, 2.0), (2.0, 3.0)}
    assert len(found) == 2


def test_where_a_sweep_leads_away_from_the_only_way_on_it_is_not_counted_on():
    """The joints turn too far along the way that leads on; a sweep need not, but ends nowhere."""
    q = np.zeros((4, 2, 6))
    q[2:, 0] = 1.5  # times what an edge may turn without a sweep
    free, on = np.ones((4, 2), dtype=bool), np.zeros(3, dtype=bool)
    free[0, 1] = free[3, 1] = False
    ladder = Ladder(q, free, np.array([0.0, 20.0]), on, 1.0, 1.0)
    # near the end places are as close together as they may be
    places = np.array([0.0, 1.0, 2.0, 2.0 + 1.0 / 1000.0])
    shut = np.array([(2 * 2 + 1) * 2 + 0])  # from where the sweep leads, there is no way on
    assert [(bar.first, bar.last) for bar in bars(places, [ladder], [shut])] == [(1.0, 2.0)]
    # where places are close together, it is known what a sweep passes over
    assert bars(places / 10.0, [ladder], [shut]) == []


def test_a_way_is_crossed_straight_on_from_crossing_to_crossing():
    crossings = np.array([[2.0, 4.0], [2.5, 6.0], [3.0, 6.0], [7.0, -2.0]])
    places = np.array([1.0, 2.0, 2.25, 2.75, 3.0, 5.0, 7.0, 7.5])
    otherwise = np.full((len(places), 1), 9.0)
    t = crossed(places, crossings, otherwise)
    assert t[:, 0] == pytest.approx([9.0, 4.0, 5.0, 6.0, 6.0, 2.0, -2.0, 9.0])
    assert (crossed(places, np.empty((0, 2)), otherwise) == otherwise).all()


def test_a_way_that_cannot_be_made_is_cut_further_until_it_is_too_short():
    places = np.array([0.0, 1.0, 1.001, 2.0])
    (bulge,) = broken_at(places, [0, 1])
    assert (bulge.first, bulge.last, bulge.parts) == (0.0, 1.0, MOST_PARTS)
    assert len(broken_at(places, [0, 2])) == 2


def inside(row, box):
    """The stretches of a row that a box holds, each chord joined to the one before it."""
    enter, leave = (share[0] for share in clipped(row.q[None], box))
    found = []
    for k in np.flatnonzero(leave >= enter).tolist():
        ends = row.places[k] + np.array([enter[k], leave[k]]) * (row.places[k + 1] - row.places[k])
        if found and ends[0] <= found[-1][1] + 1e-9:
            found[-1][1] = ends[1]
        else:
            found.append(ends)
    return np.array(found).reshape(-1, 2)


def random_rows(rng, n_rows):
    """Rows of postures that wander in and out of a box, some of them missing."""
    rows = []
    for _ in range(n_rows):
        places = 10.0 + np.cumsum(rng.uniform(0.01, 0.4, rng.integers(2, 40)))
        q = np.cumsum(rng.normal(0.0, 0.12, (len(places), 6)), axis=0)
        q[rng.uniform(size=len(q)) < 0.1] = np.nan
        rows.append(Row(places, float(rng.integers(-3, 4)), q))
    return rows


@pytest.mark.parametrize("seed", range(4))
def test_stretches_of_rows_are_the_chords_that_the_box_holds(seed):
    rng = np.random.default_rng(seed)
    box = JointBox(np.full(6, -0.4), np.full(6, 0.5))
    for row in random_rows(rng, 60):
        found = np.empty((len(row.q), 2))
        count = stretches(row.q, row.places, box.lower, box.upper, SAME_PLACE, found)
        np.testing.assert_array_equal(found[:count], inside(row, box))


@pytest.mark.parametrize("seed", range(4))
def test_edges_are_shut_where_any_row_between_their_ends_lies_outside_of_the_box(seed):
    rng = np.random.default_rng(seed)
    box = JointBox(np.full(6, -0.4), np.full(6, 0.5))
    rows = random_rows(rng, 40)
    places = np.sort(rng.uniform(9.5, 14.0, 60))
    t = rng.uniform(-4.0, 4.0, (60, 7)).round(1)
    expected = []
    for k in range(len(places) - 1):
        shut = [
            row.contact_position
            for row in rows
            if row.places[0] <= places[k] and places[k + 1] <= row.places[-1]
            and not any(
                first < places[k + 1] + SAME and last >= places[k] - SAME
                for first, last in inside(row, box)
            )
        ]  # fmt: skip
        for a, b in itertools.product(range(7), repeat=2):
            low, high = sorted((t[k, a], t[k + 1, b]))
            if any(low < level <= high for level in shut):
                expected.append((k * 7 + a) * 7 + b)
    assert 0 < len(expected) < 59 * 49
    np.testing.assert_array_equal(shut_edges(places, t, rows, box), expected)
    assert not len(shut_edges(places, t, [], box))
