"""Stretches on which the part surely stays out of the wheel, against distances all along."""

import numpy as np
from hypothesis import settings
from scipy.spatial.transform import Rotation

from opl.cell.part_tree import part_tree
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.wheel_sweep import surely_out
from opl.geometry.frames import pose
from tests.oracles.test_wheel_distance import (
    EXACT,
    mesh_of,
    parts_and_wheels,
    random_mesh,
    random_poses,
    wheel_of,
)

ALONG = np.linspace(-1.0, 1.0, 17)


def screws(Ts, turn, way):
    """Return poses led along screws about axes of the wheel's frame, shape (17, n, 4, 4)."""
    R = Rotation.from_rotvec((ALONG[:, None, None] * turn).reshape(-1, 3)).as_matrix()
    p = ALONG[:, None, None] * way
    return pose(R.reshape(len(ALONG), -1, 3, 3), p) @ Ts


def least_of(part, wheel, Ts):
    """Return the least distance on each stretch, exact where it was looked at, in [m]."""
    return signed_wheel_distance(part, wheel, Ts, EXACT).min(axis=0)


def judged(part, wheel, Ts, needed):
    """Return on which stretches the part surely keeps a distance."""
    needed = np.broadcast_to(needed, Ts.shape[1]).astype(float)
    return surely_out(part, wheel, Ts[0], Ts[8], Ts[-1], needed)


@settings(max_examples=30, deadline=None)
@parts_and_wheels
def test_what_is_surely_out_is_so_all_along(n, seed, width, radius, scale):
    random = np.random.default_rng(seed)
    part, wheel = part_tree(random_mesh(random, n, scale)), wheel_of(width, radius)
    Ts = screws(
        random_poses(random, 8, reach=0.4),
        random.normal(scale=0.02, size=(8, 3)),
        random.normal(scale=3e-3, size=(8, 3)),
    )
    # a little more than there is
    least = least_of(part, wheel, Ts)
    for more in (1e-6, 1e-4, 1e-2):
        assert not judged(part, wheel, Ts, least + more).any()
    assert (judged(part, wheel, Ts, least - 0.02) | (least < 0.0)).mean() > 0.5


def plate(n, half):
    """Return a flat plate that faces the wheel, of 2 n * n triangles."""
    grid = np.linspace(-half, half, n + 1)
    x, y = (of.ravel() for of in np.meshgrid(grid, grid, indexing="ij"))
    corners = np.stack([x, y, np.zeros_like(x)], axis=1)
    k = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    one, other = np.stack([k, k + 1, k + n + 1]), np.stack([k + 1, k + n + 2, k + n + 1])
    return mesh_of(corners[np.concatenate([one.T, other.T])])


def test_a_plate_that_slides_along_the_wheel_is_surely_out_on_long_stretches():
    wheel = wheel_of(0.04, 0.1)
    tilted = np.deg2rad([-60.0, -20.0, 0.0, 20.0, 60.0])  # about the rims, and on the flat
    R = Rotation.from_rotvec(np.outer(tilted, [0.0, 1.0, 0.0])).as_matrix()
    # the rim that it lies on, and 0.3 mm into the belt
    rim = np.stack([-np.sign(tilted) * 0.02, 0.0 * tilted, 0.0 * tilted], axis=1)
    p = rim - (R @ [0.0, 0.0, 1.0]) * -3e-4
    for n in (1, 7, 40):
        part = part_tree(plate(n, 0.05))
        for way in (R @ [4e-3, 0.0, 0.0], R @ [0.0, 4e-3, 0.0], R @ [2e-3, -2e-3, 0.0]):
            Ts = screws(pose(R, p), np.zeros((5, 3)), way)
            assert judged(part, wheel, Ts, -3.5e-4).all()
            # a triangle that only a bit of the rim cuts into is less deep than the plate
            least = least_of(part, wheel, Ts)
            assert ((least >= -3.001e-4) & (least < -2.5e-4)).all()
            assert not judged(part, wheel, Ts, least + 1e-6).any()
