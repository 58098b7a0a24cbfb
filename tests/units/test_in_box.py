"""Where chords lie in a box, held against closed forms on straight columns."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.search.box import JointBox
from opl.search.in_box import about_nearest, clipped, hidden, nearest_points, sampled

ROWS = np.linspace(-1.0, 1.0, 9)
some = st.lists(st.integers(-200, 200).map(lambda k: k / 1000.0), min_size=6, max_size=6)


@settings(deadline=None)
@given(some, some, st.integers(1, 200).map(lambda k: k / 1000.0 + 1e-4))
def test_a_straight_column_is_sampled_where_the_box_holds_it(start, slope, half):
    q = np.array(start) + ROWS[:, None] * np.array(slope)
    box = JointBox(np.full(6, -half), np.full(6, half))
    # where each joint is within its faces
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort((np.array([[-half], [half]]) - start) / np.array(slope), axis=0)
    still = np.abs(slope) < 1e-12
    ends[:, still] = np.where(np.abs(np.array(start)[still]) <= half, [[-9.0], [9.0]], 9.0)
    first, last = max(ends[0].max(), -1.0), min(ends[1].min(), 1.0)
    if last - first < 1e-6:
        return
    free = np.ones((1, len(ROWS)), dtype=bool)
    t, spacing = sampled(ROWS[None], q[None], free, box, 5)
    assert t[0] == pytest.approx(np.linspace(first, last, 5), abs=1e-6)
    assert spacing == pytest.approx((last - first) / 4.0, abs=1e-6)
    assert nearest_points(q[None], free, box)[0] == pytest.approx(0.0, abs=1e-9)


def test_columns_may_be_read_only():
    """Those of one place are contiguous where they are broadcast, too."""
    t = np.broadcast_to(ROWS, (1, len(ROWS)))
    q = np.broadcast_to(np.repeat(ROWS[:, None], 6, axis=1), (1, len(ROWS), 6))
    free = np.broadcast_to(np.ones(len(ROWS), dtype=bool), (1, len(ROWS)))
    assert not (t.flags.writeable or q.flags.writeable or free.flags.writeable)
    box = JointBox(np.full(6, 0.3), np.full(6, 0.6))
    assert sampled(t, q, free, box, 2)[0][0] == pytest.approx([0.3, 0.6])
    assert (np.diff(clipped(q, box), axis=0) >= 0.0).sum() == 2
    assert nearest_points(q, free, box)[0] == pytest.approx(0.0)


def test_a_narrow_band_beside_a_wide_one_has_a_sample():
    q = np.zeros((1, len(ROWS), 6))
    q[0, 5:, 0] = [0.1, 0.1, -0.1, -0.1]  # in the box up to the middle, then once more on the way
    free = np.ones((1, len(ROWS)), dtype=bool)
    box = JointBox(np.full(6, -0.001), np.full(6, 0.001))
    t, _ = sampled(ROWS[None], q, free, box, 9)
    bands = np.split(t[0], np.flatnonzero(np.diff(t[0]) > 0.5) + 1)
    assert [len(band) for band in bands] == [7, 2]
    assert bands[1][0] == np.mean([0.5, 0.75])


def test_the_nearest_chord_is_sampled_where_another_is_met_for_its_bend_alone():
    q = np.zeros((1, len(ROWS), 6))
    # straight and nearest to the box, then a jump, then farther but bent
    q[0, :, 0] = [0.126, 0.126, 0.126, 0.126, 0.9, 0.2, 0.139, 0.139, 0.2]
    free = np.ones((1, len(ROWS)), dtype=bool)
    box = JointBox(np.full(6, -0.125), np.full(6, 0.125))
    t, _ = sampled(ROWS[None], q, free, box, 9)
    assert (t[0] <= ROWS[3]).any()
    assert ((t[0] >= ROWS[5]) & (t[0] <= ROWS[8])).any()


def test_what_hides_beside_the_last_row_is_that_of_the_last_chord():
    q = np.zeros((3, 5, 6))
    q[:, :, 0] = 0.01 * np.arange(5) ** 2
    at = hidden(q, np.array([0.0, 3.5, 4.0]))
    assert at[1] == at[2] > 0.0


def test_past_samples_that_are_not_free_the_other_end_is_looked_at_too():
    t, away = np.arange(12.0), np.abs(np.arange(12) - 5.2) + 0.1
    free = np.ones((4, 12), dtype=bool)
    free[1, 4:7] = free[2, 4:] = False
    free[3, [4, 5, 6, 8]] = False  # the last is farther than what is nearest
    row = np.array([5.0, 3.0, 3.0, 7.0])
    found = about_nearest(np.tile(t, (4, 1)), row, free, np.tile(away, (4, 1)))
    assert found[0] == pytest.approx(np.linspace(4.0, 6.0, 12))
    assert found[1] == pytest.approx([*np.linspace(2, 4, 6), *np.linspace(6, 8, 6)])
    assert found[2] == pytest.approx(np.linspace(2.0, 4.0, 12))
    assert found[3] == pytest.approx([*np.linspace(2, 4, 6), *np.linspace(6, 8, 6)])


@given(st.floats(0.03, 0.97), st.floats(0.01, 0.4), st.floats(0.0, 1.0))
def test_zooming_in_finds_the_nearest_end_of_what_is_not_free(middle, width, at):
    """A box met in a stretch that is not free, on a straight column: one end is nearest."""
    begin, end = middle - width / 2.0, middle + width / 2.0
    target, last = begin + at * width, 40
    t = np.linspace(0.0, 1.0, last + 1)
    wanted = min(target - begin if begin > 0.0 else 9.0, end - target if end < 1.0 else 9.0)
    if wanted > 8.0:
        return
    for _ in range(6):
        away, free = np.abs(t - target), (t < begin) | (t > end)
        if free.all():
            return  # too narrow to be seen
        row = np.array([np.argmin(np.where(free, away, np.inf))], dtype=float)
        t = about_nearest(t[None], row, free[None], away[None])[0]
    away = np.where((t < begin) | (t > end), np.abs(t - target), np.inf).min()
    assert away == pytest.approx(wanted, abs=1e-5)
