"""Flange poses against pinocchio's, to the last digit."""

import numpy as np
import pinocchio as pin
import pytest

from opl.cell.chain import Chain
from opl.cell.robot import known_robots, load_robot

CHAIN = """<robot name="r"><link name="base"/>{links}
<link name="tool0"/><joint name="f" type="fixed"><parent link="{last}"/><child link="tool0"/>
<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.9"/></joint></robot>"""


def urdf(parents, last, kind="revolute"):
    links = "".join(
        f'<link name="l{k}"/><joint name="j{k}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="l{k}"/><origin xyz="0.{k} 0.2 0" rpy="0.{k} 1 0.5"/><axis xyz="0.6 0 0.8"/>'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>'
        for k, parent in enumerate(parents)
    )
    return pin.buildModelFromXML(CHAIN.format(links=links, last=last))


def by_pinocchio(model, q):
    data = model.createData()
    base, flange = model.getFrameId("base"), model.getFrameId("tool0")
    found = []
    for configuration in q:
        pin.framesForwardKinematics(model, data, configuration)
        found.append(data.oMf[base].actInv(data.oMf[flange]).homogeneous)
    return np.array(found)


@pytest.mark.parametrize("name", known_robots())
def test_poses_are_those_of_pinocchio_to_the_last_digit(name):
    robot = load_robot(name)
    model = pin.buildModelFromUrdf(str(robot.urdf))
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (2000, 6))
    q[:500] = np.round(q[:500] / (np.pi / 2)) * np.pi / 2
    q[0] = 0.0
    found = Chain.of(model, "base", "tool0").poses(q)
    np.testing.assert_array_equal(found, by_pinocchio(model, q))


def test_any_number_of_joints_about_any_axes():
    model = urdf(["base", "l0", "l1"], "l2")
    q = np.random.default_rng(0).uniform(-9.0, 9.0, (500, 3))
    found = Chain.of(model, "base", "tool0").poses(q)
    np.testing.assert_array_equal(found, by_pinocchio(model, q))


@pytest.mark.parametrize(
    ("parents", "last", "kind"),
    [
        (["base", "base"], "l1", "revolute"),
        (["base", "l0"], "l0", "revolute"),
        (["base", "l0"], "l1", "prismatic"),
    ],
)
def test_what_is_no_chain_of_turning_joints_is_none(parents, last, kind):
    assert Chain.of(urdf(parents, last, kind), "base", "tool0") is None
