"""Closed-form inverse kinematics against forward kinematics and against an independent package."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from opl.cell import many_poses
from opl.cell.full_turns import full_turns
from opl.cell.inverse_kinematics import N_IK_BRANCHES, ik_branch_name, inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import load_robot
from opl.cell.spherical_wrist import SphericalWristArm
from opl.geometry.frames import pose
from tests.support.closed_forms import difference, opw_solutions

MH24 = load_robot("mh24")
ARM = MH24.arm
UR10E = load_robot("ur10e").arm
REACH = ARM.c2 + np.hypot(ARM.a2, ARM.c3)  # of the wrist centre from axis 2
STRETCHED_U = np.pi / 2 + np.arctan2(ARM.a2, ARM.c3)  # elbow straight

# no real robot: nothing is zero, nothing is symmetrical
ODD_ARM = SphericalWristArm(
    a1=0.12,
    a2=0.07,
    b=-0.05,
    c1=0.4,
    c2=0.6,
    c3=0.55,
    c4=0.09,
    offsets=(0.3, -0.4, 1.1, 0.2, -0.7, 2.5),
    signs=(-1, 1, 1, -1, 1, -1),
)


def random_configurations(n, seed=0):
    return np.random.default_rng(seed).uniform(MH24.lower, MH24.upper, (n, 6))


def assert_reaches(q, T_base_flange, atol=1e-11):
    """Assert that every configuration there is, and there is one, has the flange at the pose."""
    found = q[~np.isnan(q).any(axis=-1)]
    assert len(found)
    np.testing.assert_allclose(forward_kinematics(MH24, found) - T_base_flange, 0, atol=atol)


# compiled, and by numpy


@pytest.mark.parametrize("arm", [ARM, ODD_ARM, UR10E], ids=["mh24", "odd", "ur10e"])
def test_compiled_code_numpy_and_threads_give_the_same_to_the_last_digit(monkeypatch, arm):
    q = random_configurations(3000)
    q[:300, 4] = 0.0  # straight wrist
    q[300:600, 2] = STRETCHED_U
    q[600:800] = np.round(q[600:800] / (np.pi / 2)) * (np.pi / 2)
    Ts = forward_kinematics(MH24, q)
    Ts[2500:, :3, 3] *= 1.3
    near = random_configurations(3000, seed=1)
    for nearby in (None, near):
        monkeypatch.setattr(many_poses, "kernels_are_loaded", lambda: False)
        by_numpy = inverse_kinematics(arm, Ts, nearby)
        monkeypatch.setattr(many_poses, "kernels_are_loaded", lambda: True)
        for few in (10_000, 100):
            monkeypatch.setattr(many_poses, "FEW", few)
            np.testing.assert_array_equal(inverse_kinematics(arm, Ts, nearby), by_numpy)
        assert 0.0 < np.isnan(by_numpy).mean() < 1.0


# closing the circle


def test_every_configuration_found_reaches_the_pose():
    Ts = forward_kinematics(MH24, random_configurations(2000))
    q = inverse_kinematics(ARM, Ts)
    found = ~np.isnan(q).any(axis=-1)
    wanted = np.broadcast_to(Ts[:, None], (2000, N_IK_BRANCHES, 4, 4))[found]
    np.testing.assert_allclose(forward_kinematics(MH24, q[found]), wanted, atol=1e-11)


def test_the_original_configuration_is_among_slots_and_turns():
    q = random_configurations(2000)
    candidates = inverse_kinematics(ARM, forward_kinematics(MH24, q))[:, :, None] + full_turns(
        MH24.lower, MH24.upper
    )
    distance = np.abs(candidates - q[:, None, None]).max(axis=-1)
    assert np.nanmin(distance.reshape(2000, -1), axis=1).max() < 1e-8


whole_degrees = arrays(np.int64, 6, elements=st.integers(-180, 180))


@settings(deadline=None, max_examples=200)
@given(whole_degrees)
def test_whole_degrees_come_back_however_singular_they_are(degrees):
    T = forward_kinematics(MH24, np.radians(degrees))
    assert_reaches(inverse_kinematics(ARM, T), T)


def test_single_poses_and_stacks_agree():
    Ts = forward_kinematics(MH24, random_configurations(6)).reshape(2, 3, 4, 4)
    q = inverse_kinematics(ARM, Ts)
    assert q.shape == (2, 3, 8, 6)
    assert inverse_kinematics(ARM, Ts[:0]).shape == (0, 3, 8, 6)
    np.testing.assert_allclose(inverse_kinematics(ARM, Ts[1, 2]), q[1, 2], atol=1e-12)


@pytest.mark.parametrize("wrist", [None, 0.0, np.pi], ids=["random", "zero", "half a turn"])
def test_angles_are_principal_to_the_last_digit(wrist):
    q = random_configurations(2000)
    if wrist is not None:
        q[:, [3, 5]] = wrist  # the flipped slot, or this one, has joints 4 and 6 at the seam
    q = inverse_kinematics(ARM, forward_kinematics(MH24, q))
    assert np.nanmin(q) > -np.pi
    assert np.nanmax(q) <= np.pi


def test_a_pose_straight_behind_stays_within_the_limits_of_s():
    q = np.array([np.pi, 0.2, 0.3, 0.4, 0.5, 0.6])
    q1 = inverse_kinematics(ARM, forward_kinematics(MH24, q))[:, 0]
    assert np.nanmax(q1) <= MH24.upper[0]
    assert np.nanmin(q1) >= MH24.lower[0]
    assert np.nanmin(np.abs(np.abs(q1) - np.pi)) < 1e-15


# an independent package


@pytest.mark.parametrize("arm", [ARM, ODD_ARM], ids=["mh24", "odd"])
def test_an_independent_package_finds_the_same_configurations(arm):
    random = np.random.default_rng(1)
    p = random.uniform([-1, -1, -0.3], [1, 1, 1.2], (300, 3))
    Ts = pose(Rotation.random(300, random_state=1).as_matrix(), p)
    n_found = 0
    for q, q_opw in zip(inverse_kinematics(arm, Ts), opw_solutions(arm, Ts), strict=True):
        q = q[~np.isnan(q).any(axis=-1)]
        assert len(q) == len(q_opw)
        if len(q):
            distance = difference(q[:, None], q_opw[None])
            assert distance.min(axis=1).max() < 1e-7
            assert distance.min(axis=0).max() < 1e-7
            n_found += 1
    assert n_found > 100


# singular poses


def with_joint_4(angle):
    return np.array([0.0, 0.0, 0.0, angle, 0.0, 0.0])


@pytest.mark.parametrize("straight", [0.0, np.pi, -np.pi])
@pytest.mark.parametrize("q4", [0.0, 0.7, -3.0, np.pi])
def test_a_straight_wrist_takes_joint_4_from_the_argument(straight, q4):
    T = forward_kinematics(MH24, np.array([0.3, 0.2, -0.1, 0.9, straight, -0.5]))
    q = inverse_kinematics(ARM, T, with_joint_4(q4))
    assert_reaches(q, T)
    found = q[~np.isnan(q[:, 0])]
    singular = np.abs(np.sin(found[:, 4])) < 1e-9
    assert singular.any()
    np.testing.assert_allclose(found[singular, 3], q4, atol=1e-12)


def test_each_pose_may_have_its_own_joint_4():
    q = np.array([[0.3, 0.2, -0.1, 0.9, 0.0, -0.5], [0.3, 0.2, -0.1, 0.9, 0.4, -0.5]])
    found = inverse_kinematics(ARM, forward_kinematics(MH24, q), q)
    assert (difference(found, q[:, None]).min(axis=1) < 1e-11).all()


@pytest.mark.parametrize("exponent", range(-16, -2))
def test_a_nearly_straight_wrist_closes_as_well(exponent):
    q = np.array([0.3, 0.2, -0.1, 0.9, 10.0**exponent, -0.5])
    T = forward_kinematics(MH24, q)
    assert_reaches(inverse_kinematics(ARM, T), T)
    assert_reaches(inverse_kinematics(ARM, T, with_joint_4(-2.0)), T)


@pytest.mark.parametrize("elbow", [STRETCHED_U, STRETCHED_U + np.pi], ids=["stretched", "folded"])
@pytest.mark.parametrize("shoulder", np.radians([-100, -37, 0, 41, 90]))
def test_an_arm_in_line_is_reached(elbow, shoulder):
    q = np.array([0.3, shoulder, elbow, 0.4, 0.5, 0.6])
    T = forward_kinematics(MH24, q)
    found = inverse_kinematics(ARM, T)
    assert_reaches(found, T, atol=1e-9)
    assert difference(found, q).min() < 1e-6  # the cosine of an angle near 0 knows half its digits


def flange_ahead_of_axis_2(distance):
    """Return a pose facing forward whose wrist centre lies so far ahead of axis 2."""
    return pose(
        forward_kinematics(MH24, np.zeros(6))[:3, :3],
        np.array([ARM.a1 + distance + ARM.c4, 0.0, ARM.c1]),
    )


def test_reach_ends_where_the_arm_is_straight():
    assert not np.isnan(inverse_kinematics(ARM, flange_ahead_of_axis_2(REACH - 1e-9))[:2]).any()
    assert not np.isnan(inverse_kinematics(ARM, flange_ahead_of_axis_2(REACH + 1e-10))[:2]).any()
    assert np.isnan(inverse_kinematics(ARM, flange_ahead_of_axis_2(REACH + 1e-7))).all()


def test_out_of_reach_is_nan_in_all_joints():
    Ts = forward_kinematics(MH24, random_configurations(500))
    Ts[:, :3, 3] *= 1.3
    missing = np.isnan(inverse_kinematics(ARM, Ts))
    assert missing.any()
    assert not missing.all()
    np.testing.assert_array_equal(missing.any(axis=-1), missing.all(axis=-1))


def test_a_wrist_centre_beside_an_offset_arm_is_out_of_reach():
    near_axis_1 = pose(np.eye(3), np.array([0.5 * ODD_ARM.b, 0.0, 1.0]))
    assert np.isnan(inverse_kinematics(ODD_ARM, near_axis_1)).all()


def test_a_wrist_centre_on_axis_1_is_reached():
    T = forward_kinematics(MH24, np.zeros(6))
    T[:3, 3] = [ARM.c4, 0.0, 0.9]  # facing forward
    q = inverse_kinematics(ARM, T)
    assert_reaches(q, T)
    assert not np.isnan(q).any()


# slots, names


def test_a_configuration_keeps_its_slot_along_a_path():
    start = np.array([-0.4, -0.5, 0.3, -1.0, -1.2, 0.0])
    end = np.array([0.6, 0.5, -0.4, 1.0, -0.3, 2.0])
    path = start + np.linspace(0, 1, 200)[:, None] * (end - start)
    slots = difference(
        inverse_kinematics(ARM, forward_kinematics(MH24, path)), path[:, None]
    ).argmin(axis=1)
    assert set(slots) == {0}


def test_names_say_how_the_arm_stands():
    model = pin.buildModelFromUrdf(str(MH24.urdf))
    data = model.createData()
    seen = set()
    for q in inverse_kinematics(ARM, forward_kinematics(MH24, random_configurations(100))):
        for slot in np.flatnonzero(~np.isnan(q[:, 0])):
            pin.forwardKinematics(model, data, q[slot])
            axis_2, axis_3, wrist = (data.oMi[joint].translation for joint in (2, 3, 5))
            heading = np.array([np.cos(q[slot, 0]), np.sin(q[slot, 0]), 0.0])
            ahead = wrist @ heading
            if 0 < ahead < ARM.a1:
                continue  # above or below the shoulder, where up and down are a convention
            line, elbow = wrist - axis_2, axis_3 - axis_2
            height = elbow[2] - line[2] * (elbow @ heading) / (line @ heading)
            name = [
                "front" if ahead > 0 else "back",
                "elbow up" if height > 0 else "elbow down",
                "no flip" if q[slot, 4] < 0 else "flip",
            ]
            assert ik_branch_name(slot) == ", ".join(name)
            seen.add(slot)
    assert seen == set(range(N_IK_BRANCHES))
