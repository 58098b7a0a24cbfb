import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from opl.geometry.frames import (
    NotARotationError,
    from_axes,
    from_roll_pitch_yaw,
    interpolate,
    inverse,
    nearest_pose,
    pose,
    roll_pitch_yaw,
    rotation_angle,
    transform,
)

angle = st.floats(-np.pi, np.pi)
metre = st.floats(-2.0, 2.0)
points = st.tuples(metre, metre, metre).map(np.array)


@st.composite
def poses(draw):
    """Draw a pose from Euler angles as scipy understands them."""
    R = Rotation.from_euler("zyx", [draw(angle), draw(angle), draw(angle)]).as_matrix()
    return pose(R, draw(points))


@given(poses(), points)
def test_inverse_takes_a_point_back(T_a_b, p_b):
    np.testing.assert_allclose(transform(inverse(T_a_b), transform(T_a_b, p_b)), p_b, atol=1e-12)
    np.testing.assert_allclose(inverse(T_a_b) @ T_a_b, np.eye(4), atol=1e-12)


@given(poses(), poses(), points)
def test_neighbouring_frames_cancel(T_a_b, T_b_c, p_c):
    p_a = transform(T_a_b, transform(T_b_c, p_c))
    np.testing.assert_allclose(transform(T_a_b @ T_b_c, p_c), p_a, atol=1e-12)


def test_stacks_give_what_their_members_give():
    rng = np.random.default_rng(0)
    Ts = pose(Rotation.random(6, random_state=0).as_matrix(), rng.random((6, 3)))
    Ts_other, fractions = Ts[::-1], rng.random(6)
    for k in range(6):
        np.testing.assert_allclose(inverse(Ts)[k], inverse(Ts[k]))
        np.testing.assert_allclose(roll_pitch_yaw(Ts)[k], roll_pitch_yaw(Ts[k]))
        np.testing.assert_allclose(
            interpolate(Ts, Ts_other, fractions)[k], interpolate(Ts[k], Ts_other[k], fractions[k])
        )


@given(poses(), points)
def test_axis_z_is_kept_and_axis_x_only_leans(T, wish):
    z = T[:3, 2]
    if np.linalg.norm(np.cross(z, wish)) < 1e-3:
        return
    made = from_axes(3.0 * z, wish, T[:3, 3])
    np.testing.assert_allclose(made[:3, 2], z, atol=1e-12)
    np.testing.assert_allclose(made[:3, :3].T @ made[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(made) == pytest.approx(1.0)
    assert made[:3, 0] @ wish > 0.0
    assert made[:3, 1] @ wish == pytest.approx(0.0, abs=1e-9)


@given(poses(), poses())
def test_interpolation_begins_and_ends_at_its_ends(T_a_b, T_a_c):
    np.testing.assert_allclose(interpolate(T_a_b, T_a_c, 0.0), T_a_b, atol=1e-12)
    np.testing.assert_allclose(interpolate(T_a_b, T_a_c, 1.0), T_a_c, atol=1e-12)


@given(poses(), st.floats(-1.0, 1.0), st.floats(0.0, 1.0))
def test_interpolation_passes_through_proper_poses_between(T_a_b, turn, fraction):
    T_a_c = T_a_b @ from_roll_pitch_yaw(np.array([0.5 * turn, turn, 0.0]), np.array([1.0, 0, 0]))
    between = interpolate(T_a_b, T_a_c, fraction)
    np.testing.assert_allclose(between[:3, :3].T @ between[:3, :3], np.eye(3), atol=1e-9)
    assert np.linalg.det(between) == pytest.approx(1.0)
    p_b, p_c = T_a_b[:3, 3], T_a_c[:3, 3]
    np.testing.assert_allclose(between[:3, 3], p_b + fraction * (p_c - p_b), atol=1e-12)
    assert rotation_angle(T_a_b, between) <= rotation_angle(T_a_b, T_a_c) + 1e-9


@given(poses(), st.integers(0, 2**32 - 1), st.floats(0.0, 0.005))
def test_a_rounded_matrix_becomes_the_nearest_pose(T, seed, rounding):
    rounded = T.copy()
    rounded[:3, :3] += np.random.default_rng(seed).uniform(-rounding, rounding, (3, 3))
    made = nearest_pose(rounded)
    np.testing.assert_allclose(made[:3, :3].T @ made[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(made) == pytest.approx(1.0)
    # nearest in the sum of squares: no proper rotation, and so not T, is nearer
    assert np.linalg.norm(made - rounded) <= np.linalg.norm(T - rounded) + 1e-12
    np.testing.assert_array_equal(made[:3, 3], T[:3, 3])


@given(poses())
def test_a_proper_pose_stays_what_it_is(T):
    np.testing.assert_allclose(nearest_pose(T), T, atol=1e-12)


def test_a_matrix_too_far_from_a_rotation_is_refused_with_the_amount():
    stretched = np.diag([1.0, 1.1, 1.0, 1.0])
    with pytest.raises(NotARotationError, match=r"is 0\.1 away from a rotation") as caught:
        nearest_pose(stretched)
    assert caught.value.distance == pytest.approx(0.1)
    np.testing.assert_allclose(nearest_pose(stretched, tolerance=0.11), np.eye(4), atol=1e-12)


@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([1.0, 1.0, -1.0, 1.0]),
        np.diag([1.0, 1.0, 1.0, 0.9]),
        np.eye(4) + np.eye(4)[[3, 1, 2, 0]] * 0.1,
        np.diag([0.0, 0.0, 0.0, 1.0]),
    ],
)
def test_mirrors_projections_and_collapsed_matrices_are_refused(matrix):
    with pytest.raises(NotARotationError):
        nearest_pose(matrix)


@given(poses(), angle, points)
def test_the_angle_between_two_poses_is_the_turn_between_them(T_a_b, turn, axis):
    if np.linalg.norm(axis) < 1e-3:
        return
    R_b_c = Rotation.from_rotvec(turn * axis / np.linalg.norm(axis)).as_matrix()
    T_a_c = T_a_b @ pose(R_b_c, np.zeros(3))
    assert rotation_angle(T_a_b, T_a_c) == pytest.approx(abs(turn), abs=1e-7)


def test_a_tiny_turn_is_not_lost_in_rounding():
    T_a_c = from_roll_pitch_yaw(np.array([1e-9, 0.0, 0.0]), np.zeros(3))
    assert rotation_angle(np.eye(4), T_a_c) == pytest.approx(1e-9, rel=1e-6)


@given(poses())
def test_fixed_axis_angles_lead_back_to_the_pose(T):
    np.testing.assert_allclose(from_roll_pitch_yaw(roll_pitch_yaw(T), T[:3, 3]), T, atol=1e-8)


@given(angle, st.floats(-1.5, 1.5), angle)
def test_fixed_axis_angles_are_those_of_scipy(roll, pitch, yaw):
    T = pose(Rotation.from_euler("xyz", [roll, pitch, yaw]).as_matrix(), np.zeros(3))
    difference = np.array(roll_pitch_yaw(T)) - [roll, pitch, yaw]
    np.testing.assert_allclose(np.sin(0.5 * difference), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        from_roll_pitch_yaw(np.array([roll, pitch, yaw]), np.zeros(3)), T, atol=1e-12
    )


@given(angle, angle, st.sampled_from([-np.pi / 2, np.pi / 2]))
def test_at_gimbal_lock_the_whole_turn_is_put_in_rz(roll, yaw, pitch):
    T = from_roll_pitch_yaw(np.array([roll, pitch, yaw]), np.zeros(3))
    angles = roll_pitch_yaw(T)
    assert angles[0] == 0.0
    assert angles[1] == pytest.approx(pitch, abs=1e-8)
    np.testing.assert_allclose(from_roll_pitch_yaw(angles, np.zeros(3)), T, atol=1e-8)
