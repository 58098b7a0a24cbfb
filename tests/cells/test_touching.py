"""Pairs of plain solids that certainly are as near as asked, against the distances of coal."""

import coal
import numpy as np
import pytest

from opl.cell.touching import surely_within
from opl.geometry.frames import pose
from opl.geometry.rotations import from_rotation_vector


def solid(rng):
    """Sizes of a box or a cylinder as `Bodies` has them, and the same for coal."""
    if rng.uniform() < 0.5:
        size = rng.uniform(0.02, 0.5, 3)
        return size, coal.Box(*(2.0 * size))
    radius, half = rng.uniform(0.02, 0.5, 2)
    return np.array([radius, half, -1.0]), coal.Cylinder(radius, 2.0 * half)


def placed(rng):
    """A pose near the origin."""
    return pose(from_rotation_vector(rng.normal(size=3)), rng.uniform(-0.6, 0.6, 3))


def distance(shapes, poses):
    """The distance of two shapes, below 0 if they sink into each other, as coal measures it."""
    found = coal.DistanceResult()
    at = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in poses]
    return coal.distance(shapes[0], at[0], shapes[1], at[1], coal.DistanceRequest(), found)


@pytest.mark.parametrize("allowed", [0.05, 0.02, 1e-6, -1e-6, -0.01])
def test_what_is_found_to_be_within_a_distance_is(allowed):
    rng = np.random.default_rng(3)
    found, within = [], []
    for _ in range(1500):
        (a, first), (b, second) = solid(rng), solid(rng)
        poses = np.array([placed(rng), placed(rng)])
        found.append(surely_within(poses, np.array([a, b]), 0, 1, allowed))
        within.append(distance((first, second), poses) - allowed)
    found, within = np.array(found), np.array(within)
    assert (within[found] <= 1e-6).all()
    assert 0.3 < (within < 0.0).mean() < 0.9
    # and nearly all that are much nearer are found
    assert found[within < -0.1].mean() > 0.95


def test_what_is_thinner_than_it_is_to_sink_in_is_told_nothing_of():
    sizes = np.array([[0.1, 0.1, 0.004], [0.1, 0.003, -1.0]])
    poses = np.array([np.eye(4), np.eye(4)])
    assert surely_within(poses, sizes, 0, 1, -0.003)
    assert not surely_within(poses, sizes, 0, 1, -0.01)
