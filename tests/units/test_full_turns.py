"""Joint positions apart from full turns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.cell.full_turns import angular_distance, full_turns, nearest_turn, principal
from opl.cell.robot_loading import load_robot

MH24 = load_robot("mh24")
ANGLES = st.floats(-30.0, 30.0)


@given(ANGLES)
def test_a_principal_angle_points_the_same_way(angle):
    turned = principal(np.array(angle))
    assert -np.pi < turned <= np.pi
    assert np.exp(1j * turned) == pytest.approx(np.exp(1j * angle), abs=1e-12)


def test_half_a_turn_is_positive_and_nothing_stays_nothing():
    np.testing.assert_array_equal(
        principal(np.array([np.pi, -np.pi, np.nan])), [np.pi, np.pi, np.nan]
    )


@given(ANGLES, ANGLES)
def test_the_nearest_turn_is_at_most_half_a_turn_away(q, reference):
    turned = nearest_turn(np.array(q), np.array(reference))
    assert abs(turned - reference) <= np.pi + 1e-9
    assert (turned - q) / (2.0 * np.pi) == pytest.approx(round((turned - q) / (2.0 * np.pi)))
    assert angular_distance(np.array(q), np.array(reference)) == pytest.approx(
        abs(turned - reference)
    )


def test_only_r_and_t_of_the_mh24_have_turns():
    found = full_turns(MH24.lower, MH24.upper) / (2 * np.pi)
    assert found.shape == (9, 6)
    np.testing.assert_array_equal(found[0], np.zeros(6))
    np.testing.assert_array_equal(found[:, [0, 1, 2, 4]], np.zeros((9, 4)))
    assert {(r, t) for r, t in found[:, [3, 5]]} == {(r, t) for r in (-1, 0, 1) for t in (-1, 0, 1)}
    n_turns = np.abs(found).sum(axis=1)
    np.testing.assert_array_equal(n_turns, np.sort(n_turns))


def test_turns_cover_limits_on_one_side():
    lower, upper = np.zeros(6), np.full(6, np.pi / 2)
    lower[5], upper[5] = np.radians([200, 400])  # principal angles -160..180 or -180..40, turned
    np.testing.assert_allclose(full_turns(lower, upper), [[0, 0, 0, 0, 0, 2 * np.pi]])
