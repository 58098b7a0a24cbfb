"""Straight ways between two poses; how rotation vectors turn frames."""

import numpy as np
import pinocchio
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from opl.geometry.frames import from_roll_pitch_yaw, rotation_angle
from opl.geometry.rotations import quaternion, straight_between, turn_of_change

NUMBERS = st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6).map(np.array)


@settings(deadline=None)
@given(NUMBERS, NUMBERS, st.floats(0.0, 1.0))
def test_a_straight_way_shares_line_and_angle_out_in_proportion(one, other, s):
    start, end = (from_roll_pitch_yaw(values[:3], values[3:]) for values in (one, other))
    (found,) = straight_between(start, end, np.array([s]))
    np.testing.assert_allclose(found[:3, 3], (1 - s) * one[3:] + s * other[3:], atol=1e-12)
    whole = rotation_angle(start, end)
    np.testing.assert_allclose(rotation_angle(start, found), s * whole, atol=1e-7)
    np.testing.assert_allclose(rotation_angle(found, end), (1 - s) * whole, atol=1e-7)


@settings(deadline=None)
@given(NUMBERS, st.sampled_from([0.0, 1e-9, 1e-5, 1e-3, 1.0, 2.0]))
def test_a_change_of_a_rotation_vector_turns_as_another_library_says(values, scale):
    turn = scale * values[:3]
    np.testing.assert_allclose(turn_of_change(turn), pinocchio.Jexp3(turn), atol=1e-9)


def test_quaternions_are_those_of_scipy_to_the_last_digit():
    turns = Rotation.concatenate([Rotation.random(500, rng=1), Rotation.create_group("O")])
    for R in turns.as_matrix():
        expected = Rotation.from_matrix(R).as_quat(canonical=True)
        np.testing.assert_array_equal(quaternion(R), expected)
