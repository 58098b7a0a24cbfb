"""Arms with three parallel axes: the closed form against its drawing, and against EAIK."""

import numpy as np
import pinocchio as pin
import pytest
from eaik.IK_DH import DhRobot
from eaik.IK_URDF import UrdfRobot
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from opl.cell.inverse_kinematics import inverse_kinematics, singularity_margins
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.robot import controller_poses, forward_kinematics
from opl.cell.robot_loading import known_robots, load_robot
from opl.planning.nodes import _unrolled
from tests.support.closed_forms import difference

UR10E = load_robot("ur10e")
# no real robot: nothing is zero, nothing is symmetrical
ODD_ARM = ParallelAxesArm(
    a1=0.12,
    b=-0.07,
    c1=0.4,
    c2=0.6,
    c3=0.5,
    c4=0.1,
    c5=0.13,
    offsets=(0.3, -0.4, 1.1, 0.2, -0.7, 2.5),
    signs=(-1, 1, -1, -1, 1, -1),
)
ARMS = {"ur10e": UR10E.arm, "odd": ODD_ARM}
every_arm = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
angles = arrays(float, 6, elements=st.floats(-np.pi, np.pi))


def drawn(arm, q):
    """Return the flange pose as the drawing has it: one turn or shift after the other."""
    theta = q * np.array(arm.signs) - np.array(arm.offsets)

    def step(axis, angle, x, y, z):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler(axis, angle).as_matrix()
        T[:3, 3] = T[:3, :3] @ [x, y, z]
        return T

    return (
        step("z", theta[0], arm.a1, 0, arm.c1)
        @ step("y", theta[1], 0, 0, arm.c2)
        @ step("y", theta[2], 0, 0, arm.c3)
        @ step("y", theta[3], 0, arm.b, arm.c4)
        @ step("z", theta[4], 0, 0, 0)
        @ step("y", theta[5], 0, arm.c5, 0)
        @ step("x", -np.pi / 2, 0, 0, 0)
    )


def assert_reached(arm, found, T, atol=1e-9):
    there = found[~np.isnan(found).any(axis=-1)]
    assert len(there)
    for q in there:
        np.testing.assert_allclose(drawn(arm, q), T, atol=atol)


@every_arm
@example(q=np.array([-0.002, -0.002, -0.002, -0.002, 4e-11, -0.002]))  # all but straight twice
@example(q=np.array([1e-8, 1e-8, 1e-8, -1.0, 1e-8, 1e-8]))  # so that the tilt is hardly known
@given(q=angles)
@settings(max_examples=80, deadline=None)
def test_every_configuration_found_reaches_the_pose_and_the_original_is_among_them(arm, q):
    T = drawn(arm, q)
    found = inverse_kinematics(arm, T, q)
    assert_reached(arm, found, T, atol=1e-8)
    if singularity_margins(arm, q).min() > 1e-3:
        assert difference(found, q).min() < 1e-8


def test_the_drawing_is_the_urdf():
    q = np.random.default_rng(0).uniform(UR10E.lower, UR10E.upper, (50, 6))
    np.testing.assert_allclose(
        forward_kinematics(UR10E, q), [drawn(UR10E.arm, row) for row in q], atol=1e-12
    )


def test_eaik_finds_the_same_configurations():
    # from the parameters that the maker publishes, in the frame of its controller
    eaik = DhRobot(
        np.array([np.pi / 2, 0, 0, np.pi / 2, -np.pi / 2, 0]),
        np.array([0, -0.6127, -0.57155, 0, 0, 0]),
        np.array([0.1807, 0, 0, 0.17415, 0.11985, 0.11655]),
    )
    assert eaik.getKinematicFamily() == "6R-THREE_INNER_PARALLEL"
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (300, 6))
    Ts = controller_poses(UR10E, q)
    for T, found in zip(
        Ts, inverse_kinematics(UR10E.arm, forward_kinematics(UR10E, q)), strict=True
    ):
        theirs = eaik.IK(T)
        exact = np.array(theirs.Q)[~np.array(theirs.is_LS)]
        ours = found[~np.isnan(found[:, 0])]
        assert len(ours) == len(exact)
        apart = difference(ours[:, None], exact[None])
        assert apart.min(axis=0).max() < 1e-6 and apart.min(axis=1).max() < 1e-6


@pytest.mark.parametrize("name", known_robots())
def test_eaik_on_the_urdf_agrees_about_every_robot_that_comes_with_opl(name):
    robot = load_robot(name)
    # EAIK reads the six joints and knows no flange: its end effector is ours, with its own axes
    eaik = UrdfRobot(str(robot.urdf), [])
    q = np.random.default_rng(2).uniform(robot.lower, robot.upper, (40, 6))
    q = q[singularity_margins(robot.arm, q).min(axis=-1) > 0.02]
    for row, found in zip(
        q, inverse_kinematics(robot.arm, forward_kinematics(robot, q)), strict=True
    ):
        theirs = eaik.IK(eaik.fwdKin(row))
        exact = np.array(theirs.Q)[~np.array(theirs.is_LS)]
        ours = found[~np.isnan(found[:, 0])]
        assert len(ours) == len(exact)
        assert difference(ours[:, None], exact[None]).min(axis=0).max() < 1e-6


def test_the_determinant_of_the_jacobian_is_the_product_of_the_margins():
    model = pin.buildModelFromUrdf(str(UR10E.urdf))
    data, flange = model.createData(), model.getFrameId("tool0")
    q = np.random.default_rng(3).uniform(-np.pi, np.pi, (200, 6))
    determinants = np.array(
        [np.linalg.det(pin.computeFrameJacobian(model, data, row, flange)) for row in q]
    )
    ratio = np.abs(determinants) / singularity_margins(UR10E.arm, q).prod(axis=-1)
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)


# singular poses and slots


@every_arm
@pytest.mark.parametrize("straight", [0.0, np.pi])
@pytest.mark.parametrize("q6", [0.0, 0.7, -3.0])
def test_a_straight_wrist_keeps_joint_6(arm, straight, q6):
    q = np.array([0.3, -0.9, 1.1, 0.4, (straight + arm.offsets[4]) * arm.signs[4], q6])
    found = inverse_kinematics(arm, drawn(arm, q), q)
    assert_reached(arm, found, drawn(arm, q))
    assert difference(found, q).min() < 1e-7
    assert_reached(arm, inverse_kinematics(arm, drawn(arm, q)), drawn(arm, q))


@pytest.mark.parametrize("exponent", range(-16, -2))
def test_a_nearly_straight_wrist_closes_as_well(exponent):
    q = np.array([0.3, -0.9, 1.1, 0.4, 10.0**exponent, -0.5])
    T = drawn(UR10E.arm, q)
    assert_reached(UR10E.arm, inverse_kinematics(UR10E.arm, T, q), T, atol=1e-10)


@pytest.mark.parametrize("elbow", [0.0, np.pi])
def test_an_arm_in_line_is_reached(elbow):
    q = np.array([0.3, -0.9, elbow, 0.4, 0.8, -0.5])
    T = forward_kinematics(UR10E, q)
    assert_reached(UR10E.arm, inverse_kinematics(UR10E.arm, T), T, atol=1e-8)


def test_out_of_reach_is_nan_in_all_joints():
    Ts = forward_kinematics(UR10E, np.random.default_rng(0).uniform(-np.pi, np.pi, (300, 6)))
    Ts[:, :3, 3] *= 1.3
    missing = np.isnan(inverse_kinematics(UR10E.arm, Ts))
    assert missing.any() and not missing.all()
    np.testing.assert_array_equal(missing.any(axis=-1), missing.all(axis=-1))


@every_arm
def test_a_slot_is_left_only_through_a_singularity(arm):
    random = np.random.default_rng(4)
    start, end = random.uniform(-np.pi, np.pi, (2, 60, 1, 6))
    path = start + np.linspace(0, 1, 20)[:, None] * (end - start)
    Ts = np.array([[drawn(arm, q) for q in way] for way in path])
    slots = np.nan_to_num(
        difference(inverse_kinematics(arm, Ts), path[:, :, None]), nan=9.0
    ).argmin(axis=-1)
    theta = path * np.array(arm.signs) - np.array(arm.offsets)
    tilt = np.cumsum(theta[..., 1:4], axis=-1)
    signs = [
        np.sin(theta[..., 4]) > 0,
        np.sin(theta[..., 2]) > 0,
        arm.a1 + np.sin(tilt) @ [arm.c2, arm.c3, arm.c4] > 0,
    ]
    wrist, elbow, shoulder = (sign.astype(int) for sign in signs)
    np.testing.assert_array_equal(slots, 4 * (1 - wrist) + 2 * (1 - shoulder) + (1 - elbow))
    assert set(np.unique(slots)) == set(range(8))


def test_full_turns_of_nearly_every_joint_do_not_multiply_the_work():
    q = inverse_kinematics(
        UR10E.arm, forward_kinematics(UR10E, np.array([[[0.1, -1.5, 1.2, 0.3, -1.4, 0.2]]]))
    )
    _, sheets, copies = _unrolled(q[:, :, 0], UR10E.lower, UR10E.upper)
    assert len(sheets) == len(copies) == 1
