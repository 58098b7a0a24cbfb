"""What viewers draw: joints and solids where the robot has them, and the nearest pair."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from opl.cell.collision import CollisionScene
from opl.cell.drawn_cell import drawn_chain, drawn_links
from opl.cell.nearest import nearest_pairs
from opl.cell.robot import forward_kinematics, link_names
from opl.cell.robot_loading import known_robots, load_robot
from opl.geometry.mesh import TriangleMesh
from opl.job.load import load_job
from tests.support.jobs import V_JOB


@pytest.fixture(scope="module")
def cell():
    return load_job(V_JOB).cell


def posed(chain, q):
    """Multiply the joints of a drawn arm as a viewer does; return the flange, (4, 4)."""
    T = np.eye(4)
    for T_parent_joint, axis, angle in zip(chain.Ts_parent_joint, chain.axes, q, strict=True):
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec(axis * angle).as_matrix()
        T = T @ T_parent_joint @ turn
    return T @ chain.T_joint_flange


@pytest.mark.parametrize("name", known_robots())
def test_drawn_joints_lead_to_the_flange(name):
    robot = load_robot(name)
    chain = drawn_chain(robot)
    rng = np.random.default_rng(7)
    for q in rng.uniform(robot.lower, robot.upper, (5, 6)):
        assert np.allclose(posed(chain, q), forward_kinematics(robot, q), atol=1e-9)
    drawn = drawn_links(robot)
    assert {solid.body.name for solid in drawn} <= set(link_names(robot))
    assert all(solid.of_robot for solid in drawn)
    for solid in drawn:
        if isinstance(solid.body.shape, TriangleMesh):
            assert solid.body.shape.volume > 0.0  # faces look outwards


def test_the_nearest_pair_is_that_of_all_pairs_measured_one_by_one(cell):
    scene = CollisionScene(cell)
    rng = np.random.default_rng(3)
    home = np.deg2rad([15, -45, -50, 0, 50, -180])
    steps = rng.normal(0.0, 0.05, (12, 6))
    steps[6] *= 20.0  # a jump, after which nothing known helps
    q = home + np.cumsum(steps, axis=0)
    found = nearest_pairs(scene, q)
    for k, configuration in enumerate(q):
        scene.place(configuration)
        every = {int(index): scene.distance(int(index)) for index in scene.kept_apart}
        least = min(every.values())
        assert found.distance[k] == pytest.approx(least, abs=1e-6)
        if least > 0.0:
            apart = np.linalg.norm(np.diff(found.points[k], axis=0))
            assert apart == pytest.approx(least, abs=1e-5)


def test_without_a_pair_that_keeps_a_distance_nothing_is_nearest(cell):
    scene = CollisionScene(replace(cell, required_clearance=0.0))
    found = nearest_pairs(scene, np.zeros((2, 6)))
    assert found.pairs == () and np.isinf(found.distance).all()
