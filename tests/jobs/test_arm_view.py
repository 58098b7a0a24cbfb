"""The picture of an arm, and what is drawn there."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from opl.cell.drawing import drawn_arm, wrist_reach
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import known_robots, load_robot
from opl.report.arm_view import arm_view
from tests.support.jobs import opl


@pytest.mark.parametrize("name", ["mh24", "kr16", "ur10e"])
def test_the_picture_shows_dimensions_axes_and_limits_and_repeats_to_the_byte(name):
    robot = load_robot(name)
    text = arm_view(robot)
    assert text == arm_view(robot)
    shown = {"".join(node.itertext()).strip() for node in ElementTree.fromstring(text).iter()}
    lengths = {
        "mh24": ["505", "760", "200", "150", "795", "100"],
        "kr16": ["640", "35", "260", "680", "670", "158"],
        "ur10e": ["612.7", "571.55", "119.85", "60.85"],
    }[name]
    speeds = [f"{speed:.4g} deg/s" for speed in np.rad2deg(robot.max_speed)]
    limits = [f"{limit:.4g}" for limit in np.rad2deg([*robot.lower, *robot.upper])]
    assert {*lengths, *speeds, *limits, "1", "6"} <= shown
    assert any(robot.title in one and f"{1e3 * robot.reach:.0f} mm" in one for one in shown)


@pytest.mark.parametrize("name", known_robots())
def test_what_is_drawn_is_the_arm_at_zero(name):
    robot = load_robot(name)
    arm = drawn_arm(robot)
    np.testing.assert_allclose(
        arm.flange, forward_kinematics(robot, np.zeros(6))[:3, 3], atol=1e-12
    )
    np.testing.assert_allclose(np.abs(arm.axes[1]), [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(arm.axis_points[1], [robot.arm.a1, 0, robot.arm.c1], atol=1e-12)
    corners = np.concatenate([points for _, points in arm.outlines])
    assert corners[:, 2].min() == pytest.approx(-robot.base_height, abs=1e-9)


@pytest.mark.parametrize("name", ["mh24", "kr16", "irb2600"])
def test_the_reach_is_where_joints_2_and_3_can_bring_the_wrist(name):
    robot = load_robot(name)
    # the flange looks sideways, so that the wrist centre is beside it: only joints 2, 3 matter
    x, z = np.random.default_rng(0).uniform(-1.9, 1.9, (2, 400))
    inside = wrist_reach(robot, x, z)
    Ts = np.tile(np.eye(4), (400, 1, 1))
    Ts[:, :3, 2], Ts[:, :3, 0], Ts[:, :3, 1] = [0, 1, 0], [1, 0, 0], [0, 0, -1]
    Ts[:, :3, 3] = np.column_stack([x, np.full(400, robot.arm.c4), z])
    found = inverse_kinematics(robot.arm, Ts)
    at_zero = np.abs(np.remainder(found[..., 0] + 1.0, 2.0 * np.pi) - 1.0) < 1e-9
    q = found[..., 1:3]
    turned = np.stack([q - 2.0 * np.pi, q, q + 2.0 * np.pi], axis=2)
    within = ((turned >= robot.lower[1:3]) & (turned <= robot.upper[1:3])).any(axis=2).all(axis=-1)
    expected = (within & at_zero).any(axis=1)
    np.testing.assert_array_equal(inside >= 0.0, expected)
    assert 50 < expected.sum() < 350


def test_the_command_writes_the_picture(tmp_path):
    path = tmp_path / "arm.svg"
    ended = opl("robots", "show", "gp12", "--picture", path)
    assert ended.status == 0 and f"wrote {path}" in ended.out
    assert path.read_text(encoding="utf-8").startswith("<?xml")
    ended = opl("robots", "show", "gp12", "--picture", tmp_path / "no" / "arm.svg")
    assert ended.status == 2 and "cannot be written" in ended.err
