"""Postures as placed: in compiled loops, and with numpy one placement after the other."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.walls.images import image_within_limits, wrist_flips
from opl.walls.placement import Placement, placed
from tests.support.planned import small_problem

PASSES = 3


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_places_are_placed_as_their_passes_are(seed):
    draw = np.random.default_rng(seed)
    flips = wrist_flips(small_problem().cell.robot.arm)
    starts = draw.uniform(-np.pi, 2.0 * np.pi, (8, 6))
    starts[draw.random((8, 6)) < 0.2] = -np.pi
    angles = draw.uniform(-np.pi, np.pi, (7, 5, 6))
    angles[draw.random((7, 5)) < 0.1] = np.nan
    angles[draw.random((7, 5, 6)) < 0.1] = np.pi
    pass_index = np.sort(draw.integers(0, PASSES, 7))
    placements = []
    for _ in range(PASSES):
        number = int(draw.integers(0, 2))
        turns, loose = 2.0 * np.pi * draw.integers(-2, 3, 6), draw.random(6) < 0.3
        center = draw.uniform(-4.0, 4.0, 6)
        family = int(draw.integers(0, 8))
        placements.append(Placement(family, number, flips[number], turns, loose, center))
    found = placed(angles.copy(), starts, pass_index, placements)
    for place, own in enumerate(pass_index):
        start = starts[placements[own].family]
        unrolled = start + np.remainder(angles[place] - start, 2.0 * np.pi)
        np.testing.assert_array_equal(found[place], placements[own].of(unrolled))


def test_what_full_turns_or_a_flip_bring_within_the_limits():
    robot = small_problem().cell.robot
    q = np.random.default_rng(7).uniform(-8.0, 8.0, (20_000, 6))
    flips, turns = wrist_flips(robot.arm), 2.0 * np.pi * np.arange(-3, 4)
    kept = np.zeros(len(q), dtype=bool)
    for sign, shift in flips:
        moved = (q * sign + shift)[..., None] + turns
        within = (moved >= robot.lower[:, None]) & (moved <= robot.upper[:, None])
        kept |= within.any(axis=-1).all(axis=-1)
    assert 0.1 < kept.mean() < 0.9
    np.testing.assert_array_equal(image_within_limits(robot, flips, q), kept)
