"""The clearance layer: the tree of spheres against asking every sample."""

import numpy as np
import pytest
from cells import small_problem
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from opl.cell.clearance import LEAF_SIZE, sample_tree, wheel_clearance
from opl.geometry.frames import pose
from opl.geometry.wheel import ContactWheel


def wheel_of(width, radius):
    return ContactWheel(width, radius, np.radians(45.0), np.eye(4))


def by_brute_force(points, wheel, Ts):
    """Return the least distance of any sample to the cylinder, written out here."""
    least = []
    for T in Ts:
        x, y, z = (points @ T[:3, :3].T + T[:3, 3]).T
        beside, beyond = np.abs(x) - wheel.width / 2, np.hypot(y, z - wheel.radius) - wheel.radius
        outside = np.hypot(np.clip(beside, 0, None), np.clip(beyond, 0, None))
        least.append(
            np.where((beside < 0) & (beyond < 0), np.maximum(beside, beyond), outside).min()
        )
    return np.array(least)


def random_poses(random, n, reach):
    R = Rotation.from_quat(random.normal(size=(n, 4))).as_matrix()
    return pose(R, random.uniform(-reach, reach, (n, 3)))


@settings(max_examples=150, deadline=None)
@given(
    st.integers(1, 400),
    st.integers(0, 2**32 - 1),
    st.floats(0.005, 0.3),
    st.floats(0.01, 0.4),
    st.sampled_from(["cloud", "sheet", "line", "clusters", "same point"]),
)
def test_the_tree_finds_what_asking_every_sample_finds(n, seed, width, radius, shape):
    random = np.random.default_rng(seed)
    points = random.normal(scale=0.1, size=(n, 3))
    if shape == "sheet":
        points[:, 2] = 0.03
    elif shape == "line":
        points[:, 1:] = 0.01
    elif shape == "clusters":
        points = random.normal(scale=0.1, size=(4, 3))[random.integers(0, 4, n)] + 1e-3 * points
    elif shape == "same point":
        points[:] = points[0]
    wheel = wheel_of(width, radius)
    Ts = random_poses(random, 20, reach=0.4)
    found = wheel_clearance(sample_tree(points), wheel, Ts)
    np.testing.assert_allclose(found, by_brute_force(points, wheel, Ts), rtol=0, atol=1e-14)


@pytest.mark.parametrize("n", [1, LEAF_SIZE, LEAF_SIZE + 1, 2 * LEAF_SIZE + 1, 20000])
def test_one_sample_and_many(n):
    random = np.random.default_rng(n)
    points = random.uniform(-0.1, 0.1, (n, 3))
    wheel = wheel_of(0.05, 0.15)
    Ts = random_poses(random, 30, reach=0.3)
    found = wheel_clearance(sample_tree(points), wheel, Ts)
    np.testing.assert_allclose(found, by_brute_force(points, wheel, Ts), rtol=0, atol=1e-14)


def test_the_part_of_the_job_at_every_cutter_point():
    problem = small_problem()
    positions = problem.field.contact_positions[::7]
    frames = problem.points.Ts_workpiece_cutter[::9]
    Ts = np.array(
        [
            [problem.cell.wheel.T_contact0_contact(t) @ np.linalg.inv(frame) for t in positions]
            for frame in frames
        ]
    )
    wanted = by_brute_force(problem.samples.points, problem.cell.wheel, Ts.reshape(-1, 4, 4))
    found = problem.wheel_clearance[::9, ::7]
    np.testing.assert_allclose(found.ravel(), wanted, rtol=0, atol=1e-14)


def test_stacks_keep_their_shape():
    samples = sample_tree(np.random.default_rng(0).normal(size=(50, 3)))
    wheel = wheel_of(0.05, 0.15)
    Ts = random_poses(np.random.default_rng(1), 24, 0.3).reshape(2, 3, 4, 4, 4)
    found = wheel_clearance(samples, wheel, Ts)
    assert found.shape == (2, 3, 4)
    assert wheel_clearance(samples, wheel, Ts[0, 0, 0]) == found[0, 0, 0]
    assert wheel_clearance(samples, wheel, Ts[:0]).shape == (0, 3, 4)


def test_poses_need_not_be_contiguous():
    samples = sample_tree(np.random.default_rng(0).normal(size=(50, 3)))
    wheel = wheel_of(0.05, 0.15)
    Ts = random_poses(np.random.default_rng(1), 24, 0.3)
    fortran = np.asfortranarray(Ts)
    expected = wheel_clearance(samples, wheel, Ts)
    np.testing.assert_array_equal(wheel_clearance(samples, wheel, fortran), expected)
    np.testing.assert_array_equal(wheel_clearance(samples, wheel, Ts[::2]), expected[::2])


def test_every_sphere_holds_its_samples_and_every_sample_is_there():
    points = np.random.default_rng(0).normal(size=(777, 3))
    tree = sample_tree(points)
    for (x, y, z, radius), first, end in zip(tree.spheres, tree.first, tree.end, strict=True):
        away = np.linalg.norm(tree.points[first:end] - [x, y, z], axis=1)
        assert away.max() <= radius * (1 + 1e-12)
    assert sorted(map(tuple, tree.points)) == sorted(map(tuple, points))
    leaves = tree.child == 0
    assert (tree.end - tree.first)[leaves].sum() == 777


def test_the_wheels_own_pose_does_not_matter():
    samples = sample_tree(np.random.default_rng(0).normal(scale=0.1, size=(50, 3)))
    Ts = random_poses(np.random.default_rng(1), 5, 0.3)
    elsewhere = ContactWheel(0.05, 0.15, 1.0, random_poses(np.random.default_rng(2), 1, 5.0)[0])
    np.testing.assert_array_equal(
        wheel_clearance(samples, elsewhere, Ts), wheel_clearance(samples, wheel_of(0.05, 0.15), Ts)
    )
