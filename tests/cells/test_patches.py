"""The part in patches: bounds that hold, and the distance that Bullet tells of the whole mesh."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from opl.cell.robot import forward_kinematics
from opl.files.resources import folder
from opl.geometry.frames import inverse, pose
from opl.geometry.wheel import ContactWheel
from opl.job.load import load_job
from opl.verification.drum import Drum
from opl.verification.engine import pybullet, start
from opl.verification.patches import MOST, Patches
from opl.verification.world import MARGIN, World
from tests.support.bare_cells import random_configurations


def at(turn, p):
    return pose(Rotation.from_rotvec(turn).as_matrix(), np.array(p))


DRUM = Drum(at([0.3, -0.8, 0.2], [0.1, 0.2, 0.3]), 0.15, 0.05)
coordinates = st.tuples(*[st.floats(-0.3, 0.3)] * 3)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(coordinates)
def test_the_drum_is_the_contact_wheel(p):
    wheel = ContactWheel(DRUM.width, DRUM.radius, 0.5, np.eye(4))
    in_drum = np.array(p)  # its z is x of contact frame 0, which lies on the rim
    p_contact0 = np.array([in_drum[2], in_drum[1], in_drum[0] + DRUM.radius])
    p_base = DRUM.T_base_drum[:3, :3] @ in_drum + DRUM.T_base_drum[:3, 3]
    distance, _ = DRUM.distances(p_base[None])
    assert distance[0] == pytest.approx(wheel.signed_distance(p_contact0), abs=1e-12)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(coordinates, coordinates)
def test_the_direction_is_a_plane_below_the_distance(p, other):
    (here, there), outward = DRUM.distances(np.array([p, other]))
    if np.isfinite(outward[0]).all() and np.linalg.norm(outward[0]) > 0.5:
        assert np.linalg.norm(outward[0]) == pytest.approx(1.0)
        assert there >= here + outward[0] @ (np.array(other) - np.array(p)) - 1e-12


def test_patches_are_all_the_triangles_and_their_bounds_hold():
    triangles = np.random.default_rng(0).normal(scale=0.05, size=(700, 1, 3))
    triangles = triangles + np.random.default_rng(1).normal(scale=0.01, size=(700, 3, 3))
    patches = Patches.of(triangles)
    assert max(map(len, patches.triangles)) <= MOST
    together = np.concatenate(patches.triangles).reshape(-1, 9)
    assert sorted(map(tuple, together)) == sorted(map(tuple, triangles.reshape(-1, 9)))
    weights = np.random.default_rng(2).dirichlet(np.ones(3), 200)
    T = at([0.5, 0.1, 1.0], [0.15, 0.2, 0.3])
    beside = patches.beside(DRUM, T)
    for k, (patch, of_box) in enumerate(zip(patches.triangles, beside.boxes, strict=True)):
        points = np.einsum("wk,mki->wmi", weights, patch).reshape(-1, 3)
        nearest = DRUM.distances(points @ T[:3, :3].T + T[:3, 3])[0].min()
        assert nearest >= beside.of_corners(k) >= of_box - 1e-12
    low, high = np.array([-0.1, 0.1, 0.0]), np.array([0.05, 0.3, 0.2])
    from_box = patches.from_box(low, high, T)
    assert from_box.max() > 0.05
    for patch, bound in zip(patches.triangles, from_box, strict=True):
        points = np.einsum("wk,mki->wmi", weights, patch).reshape(-1, 3)
        p_base = points @ T[:3, :3].T + T[:3, 3]
        between = np.maximum(np.maximum(low - p_base, p_base - high), 0.0)
        assert np.linalg.norm(between, axis=1).min() >= bound - 1e-12


def test_triangles_are_said_to_be_beyond_only_where_no_point_is_nearer():
    random = np.random.default_rng(3)
    T = at([0.5, 0.1, 1.0], [0.15, 0.2, 0.3])
    T_drum = inverse(DRUM.T_base_drum) @ T
    weights = np.vstack([np.eye(3), random.dirichlet(np.full(3, 0.5), 2000)])
    told = []
    for _ in range(1500):
        triangle = random.normal(scale=0.1, size=3) + random.normal(scale=0.02, size=(1, 3, 3))
        points = weights @ triangle[0]
        nearest = DRUM.distances(points @ T[:3, :3].T + T[:3, 3])[0].min()
        assert not DRUM.are_beyond(triangle, T_drum, nearest + 1e-9)
        if nearest > 0.0:
            told.append(DRUM.are_beyond(triangle, T_drum, nearest - 1e-3))
    assert len(told) > 300 and np.mean(told) > 0.9


def whole_mesh(client, cell):
    """Return a function that asks Bullet for the distance of the whole part from the wheel."""
    part = client.createCollisionShape(
        pybullet.GEOM_MESH,
        vertices=cell.part.vertices.tolist(),
        indices=cell.part.faces.ravel().tolist(),
        flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
    )
    wheel = client.createCollisionShape(
        pybullet.GEOM_CYLINDER, radius=cell.wheel.radius, height=cell.wheel.width
    )
    bodies = [client.createMultiBody(0.0, shape) for shape in (part, wheel)]
    for body in bodies:
        client.changeDynamics(body, -1, collisionMargin=MARGIN)

    def distance(T_base_workpiece, within):
        for body, T in zip(
            bodies, (T_base_workpiece, cell.wheel_body().T_parent_body), strict=True
        ):
            turn = Rotation.from_matrix(T[:3, :3]).as_quat().tolist()
            client.resetBasePositionAndOrientation(body, T[:3, 3].tolist(), turn)
        contacts = client.getClosestPoints(*bodies, within)
        return min((contact[8] for contact in contacts), default=np.inf)

    return distance


@pytest.mark.parametrize("part", ["v_shape", "turbine_blade"])
def test_patch_by_patch_is_the_distance_of_the_whole_mesh(part):
    cell = load_job(folder("workpieces") / part / "job.yaml").cell
    random = np.random.default_rng(0)
    middle = cell.wheel.T_base_contact0[:3, 3]
    configurations = random_configurations(cell.robot, 6000)
    parts = (forward_kinematics(cell.robot, configurations) @ cell.T_flange_workpiece)[:, :3, 3]
    configurations = configurations[np.linalg.norm(parts - middle, axis=1).argsort()[:80]]
    configurations = configurations + random.normal(scale=0.02, size=configurations.shape)
    client, found = start(), []
    whole = whole_mesh(client, cell)
    with World(cell) as world:
        for q in configurations:
            wanted = whole(world.move_to(q), 0.1)
            assert world.gap(0.1) == pytest.approx(wanted, abs=1e-7)
            found.append(wanted)
    client.disconnect()
    assert min(found) < 0.0 < max(d for d in found if d < np.inf)
