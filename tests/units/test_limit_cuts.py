"""Which part of a cell is within the limits of joints, held against postures along it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.search.box import JointBox
from opl.search.limit_cuts import within_limits

NARROW = np.array([-2.0, -1.0, -2.5, -6.0, -2.2, -6.0]), np.array([2.0, 1.5, 2.5, 6.0, 2.2, 6.0])
LIMITS = JointBox(*NARROW)
MOVED = JointBox(NARROW[0] + 0.4, NARROW[1] + 0.4)
SHARES = np.linspace(0.0, 1.0, 201)
angles = st.lists(st.integers(-900, 900).map(lambda k: k / 100.0), min_size=6, max_size=6)
steps = st.lists(st.integers(-60, 60).map(lambda k: k / 100.0), min_size=6, max_size=6)
pads = st.sampled_from([0.0, 1e-3, 0.05])


def a_cell(start, step, pad):
    start, step = np.array(start), np.array(step)
    return np.concatenate([start, start + step, np.full(6, -pad), np.full(6, pad), [0.0, 1.0]])


def kept(row, limits):
    """Return at which shares of a cell some posture within the pads is within the limits."""
    q = row[:6] + SHARES[:, None] * (row[6:12] - row[:6])
    low, high = q + row[12:18], q + row[18:24]
    up = 2.0 * np.pi * np.ceil((limits.lower - high) / (2.0 * np.pi))
    return (low + up <= limits.upper).all(axis=1)


@given(angles, steps, pads, st.booleans())
def test_nothing_that_is_within_limits_is_cut_off(start, step, pad, flipped):
    row, limits = a_cell(start, step, pad), [LIMITS, MOVED][: 1 + flipped]
    low, high = within_limits(row, limits)
    within = np.any([kept(row, one) for one in limits], axis=0)
    assert ((low <= SHARES) & (high >= SHARES))[within].all()


@given(angles, st.integers(-60, 60).map(lambda k: k / 100.0), pads)
def test_what_is_left_of_a_cell_ends_at_the_limit(start, step, pad):
    """One joint turns, as far as others leave it: the ends that are cut are at its limits."""
    row = a_cell(np.zeros(6), np.eye(6)[4] * step, pad)
    row[[4, 10]] += start[4]
    low, high = within_limits(row, [LIMITS])
    within = SHARES[kept(row, LIMITS)]
    if len(within) == 0:
        assert low > high - 0.01
        return
    assert low == pytest.approx(within[0], abs=0.006)
    assert high == pytest.approx(within[-1], abs=0.006)


def test_a_joint_that_turns_more_than_once_and_one_without_limits_cut_nothing():
    row = a_cell([0.0, 0.0, 0.0, 6.2, 0.0, 0.0], [0.0, 0.0, 0.0, 0.3, 0.0, 0.0], 0.0)
    assert within_limits(row, [LIMITS]) == (0.0, 1.0)
    free = JointBox(np.full(6, -np.inf), np.full(6, np.inf))
    assert within_limits(row + 100.0, [free]) == (0.0, 1.0)
