"""Flange poses against pinocchio's, to the last digit."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell import chain as module
from opl.cell.chain import FEW
from opl.cell.robot_loading import known_robots, load_robot
from opl.cell.urdf_chain import read_chain
from opl.cell.urdf_tree import UrdfTree
from opl.files.kernels import load_kernels

CHAIN = """<robot name="r"><link name="base"/>{links}
<link name="tool0"/><joint name="f" type="fixed"><parent link="{last}"/><child link="tool0"/>
<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.9"/></joint></robot>"""
LINK = """<link name="{name}"/><joint name="j{name}" type="{kind}"><parent link="{parent}"/>
<child link="{name}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>"""


def urdf(parents, last, kind="revolute"):
    links = "".join(
        LINK.format(
            name=f"l{k}", parent=parent, kind=kind, axis="0.6 0 0.8",
            xyz=f"0.{k} 0.2 0", rpy=f"0.{k} 1 0.5",
        )
        for k, parent in enumerate(parents)
    )  # fmt: skip
    return CHAIN.format(links=links, last=last)


def chain_of(path, text):
    path.write_text(text)
    return read_chain(UrdfTree(path), "base", "tool0").chain


def by_pinocchio(model, q):
    data = model.createData()
    base, flange = model.getFrameId("base"), model.getFrameId("tool0")
    found = []
    for configuration in q:
        pin.framesForwardKinematics(model, data, configuration)
        found.append(data.oMf[base].actInv(data.oMf[flange]).homogeneous)
    return np.array(found)


@pytest.fixture(params=["compiled", "numpy"])
def poses(request, monkeypatch):
    """Return what finds poses, in one of both ways."""
    if request.param == "numpy":
        monkeypatch.setattr(module, "kernels_are_loaded", lambda: False)
    else:
        load_kernels()
    return lambda chain, q: chain.poses(q)


@pytest.mark.parametrize("name", known_robots())
def test_poses_are_those_of_pinocchio_to_the_last_digit(name, poses):
    robot = load_robot(name)
    found = read_chain(UrdfTree(robot.urdf), "base", "tool0")
    model = pin.buildModelFromUrdf(str(robot.urdf))
    assert [joint.name for joint in found.joints] == list(model.names)[1:]
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (2000, 6))
    q[:500] = np.round(q[:500] / (np.pi / 2)) * np.pi / 2
    q[0] = 0.0
    np.testing.assert_array_equal(poses(found.chain, q), by_pinocchio(model, q))


def test_any_number_of_joints_about_any_axes(tmp_path, poses):
    text = urdf(["base", "l0", "l1"], "l2")
    q = np.random.default_rng(0).uniform(-9.0, 9.0, (500, 3))
    found = poses(chain_of(tmp_path / "a.urdf", text), q)
    np.testing.assert_array_equal(found, by_pinocchio(pin.buildModelFromXML(text), q))
    assert np.isnan(poses(chain_of(tmp_path / "a.urdf", text), np.full((1, 3), np.inf))[0, 0, 0])


numbers = st.floats(-4.0, 4.0).map(lambda value: round(value, 7))
triples = st.tuples(numbers, numbers, numbers).map(lambda three: " ".join(map(str, three)))
axes = st.sampled_from(["1 0 0", "0 1 0", "0 0 1", "0 0 2", "0 -1 0", "-3e-13 1 0", "0.2 0.3 -1"])


@settings(max_examples=60, deadline=None)
@given(
    joints=st.lists(st.tuples(st.sampled_from(["revolute", "fixed"]), triples, triples, axes),
                    min_size=1, max_size=6),
    seed=st.integers(0, 99),
)  # fmt: skip
def test_joints_lie_where_pinocchio_puts_them(tmp_path_factory, joints, seed):
    parents = ["base", *(f"l{k}" for k in range(len(joints)))]
    links = "".join(
        LINK.format(name=f"l{k}", parent=parents[k], kind=kind, xyz=xyz, rpy=rpy, axis=axis)
        for k, (kind, xyz, rpy, axis) in enumerate(joints)
    )
    text = CHAIN.format(links=links, last=parents[-1])
    found = chain_of(tmp_path_factory.mktemp("chain") / "a.urdf", text)
    model = pin.buildModelFromXML(text)
    if model.nq == 0:
        assert found is None
        return
    q = np.random.default_rng(seed).uniform(-9.0, 9.0, (5, model.nq))
    np.testing.assert_array_equal(found.poses(q), by_pinocchio(model, q))


def test_after_some_calls_poses_are_compiled(monkeypatch):
    chain = read_chain(UrdfTree(load_robot("mh24").urdf), "base", "tool0").chain
    monkeypatch.setattr(module, "kernels_are_loaded", lambda: False)
    called = []
    monkeypatch.setattr(module, "_poses", lambda *arguments: called.append(1))
    for _ in range(FEW):
        chain.poses(np.zeros((1, 6)))
    assert not called
    chain.poses(np.zeros((1, 6)))
    assert called


@pytest.mark.parametrize(
    ("parents", "last", "kind"),
    [
        (["base", "base"], "l1", "revolute"),
        (["base", "l0"], "l0", "revolute"),
        (["base", "l0"], "l1", "prismatic"),
        (["base", "l0"], "l1", "continuous"),
    ],
)
def test_what_is_no_chain_of_turning_joints_is_none(tmp_path, parents, last, kind):
    assert chain_of(tmp_path / "a.urdf", urdf(parents, last, kind)) is None
