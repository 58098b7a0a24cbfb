"""Part against wheel: distances of triangles against dense samples of them, and of ways out."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from opl.cell.part_tree import part_tree
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.wheel_triangle import TOLERANCE
from opl.geometry.frames import inverse, pose
from opl.geometry.mesh import TriangleMesh
from opl.geometry.wheel import ContactWheel
from opl.planning.depths import wheel_distances
from tests.support.planned import small_problem

EXACT = np.inf  # whatever is needed is not kept: everything is measured to the end


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


def out_along(triangle, wheel, directions):
    """Return how far a triangle is beyond all of the wheel in directions, written out here."""
    x, y, z = directions.T
    rim = wheel.width / 2 * np.abs(x) + wheel.radius * np.hypot(y, z)
    return ((triangle - [0.0, 0.0, wheel.radius]) @ directions.T).min(axis=0) - rim


def way_out_by_trying(random, triangle, wheel):
    """Return minus the shortest way out: eight directions far apart, each led to the best near it.

    By the simplex method of Nelder and Mead, which follows the ridges that ways out have.
    """

    def longer(n):
        return -out_along(triangle, wheel, (n / np.linalg.norm(n))[None])[0]

    tried = random.normal(size=(5000, 3))
    tried /= np.linalg.norm(tried, axis=1)[:, None]
    starts = []
    for n in tried[np.argsort(-out_along(triangle, wheel, tried))]:
        if len(starts) < 8 and all(n @ other < 0.98 for other in starts):
            starts.append(n)
    exact = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 2000}
    return max(-minimize(longer, n, method="Nelder-Mead", options=exact).fun for n in starts)


def random_poses(random, n, reach):
    R = Rotation.from_quat(random.normal(size=(n, 4))).as_matrix()
    return pose(R, random.uniform(-reach, reach, (n, 3)))


def mesh_of(triangles):
    return TriangleMesh(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))


def random_mesh(random, n, scale):
    """Return n triangles, some of them long and thin."""
    triangles = random.normal(scale=scale, size=(n, 1, 3)) + random.normal(
        scale=scale * random.choice([0.02, 0.3, 1.0], size=(n, 1, 1)), size=(n, 3, 3)
    )
    triangles[::4, 1] = triangles[::4, 0] + 0.01 * (triangles[::4, 1] - triangles[::4, 0])
    return mesh_of(triangles)


def samples_of(mesh, n):
    """Return points on every triangle, and how far any point of one is from the nearest, in [m]."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    u, v = (grid[i + j <= n] / n for grid in (i, j))
    weights = np.stack([1.0 - u - v, u, v], axis=-1)
    points = np.einsum("sk,tkx->tsx", weights, mesh.triangles).reshape(-1, 3)
    edges = np.linalg.norm(mesh.triangles - np.roll(mesh.triangles, 1, axis=1), axis=2)
    return points, float(edges.max()) / n


parts_and_wheels = given(
    st.integers(1, 60),
    st.integers(0, 2**32 - 1),
    st.floats(0.005, 0.3),
    st.floats(0.02, 0.4),
    st.floats(0.01, 0.3),
)


@settings(max_examples=60, deadline=None)
@parts_and_wheels
def test_the_distance_is_that_of_the_nearest_point_of_any_triangle(n, seed, width, radius, scale):
    random = np.random.default_rng(seed)
    mesh = random_mesh(random, n, scale)
    wheel = wheel_of(width, radius)
    Ts = random_poses(random, 8, reach=0.4)
    found = signed_wheel_distance(part_tree(mesh), wheel, Ts, EXACT)
    points, spacing = samples_of(mesh, 24)
    sampled = by_brute_force(points, wheel, Ts)
    assert (found <= sampled + TOLERANCE + 1e-12).all()
    apart = found >= 0.0
    assert (found >= sampled - spacing - 1e-12)[apart].all()
    # a point in the wheel is not deeper in it than all of its triangle, which must come out as one
    assert (found < TOLERANCE)[sampled < 0.0].all()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.005, 0.3), st.floats(0.02, 0.4), st.floats(0.001, 1))
def test_a_triangle_in_the_wheel_is_as_deep_as_its_shortest_way_out(seed, width, radius, scale):
    random = np.random.default_rng(seed)
    wheel = wheel_of(width, radius)
    mesh = random_mesh(random, 1, scale)
    # near the rim, where ways out lead between the directions of side and axle
    rim = np.array([random.choice([-0.5, 0.5]) * width, 0.0, 0.0])
    triangle = mesh.triangles[0] - mesh.triangles[0].mean(axis=0) + rim
    triangle += random.normal(scale=0.1 * min(width, radius), size=3)
    found = signed_wheel_distance(part_tree(mesh_of(triangle[None])), wheel, np.eye(4), EXACT)
    tried = way_out_by_trying(random, triangle, wheel)
    assert found >= tried - TOLERANCE  # every direction is a way out
    if found < 0.0:
        assert found == pytest.approx(tried, rel=1e-3, abs=1e-5)
    else:
        assert tried <= found + TOLERANCE


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_triangle_about_the_axle_gets_out_across_the_edge_next_to_the_axle(seed):
    random = np.random.default_rng(seed)
    wheel = wheel_of(10.0, 0.15)  # out at a side is far
    turns = np.sort(random.uniform(0.0, 2 * np.pi / 3, 3) + 2 * np.pi / 3 * np.arange(3))
    y, z = random.uniform(0.02, 0.3, 3) * np.array([np.cos(turns), np.sin(turns)])
    about = np.column_stack([random.uniform(-0.05, 0.05, 3), y, z])
    before, after = about[:, 1:], np.roll(about[:, 1:], -1, axis=0)
    across = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    past_axle = across / np.linalg.norm(after - before, axis=1)
    assume((past_axle > 0.0).all())  # the axle goes through it
    found = signed_wheel_distance(
        part_tree(mesh_of(about[None] + [0.0, 0.0, wheel.radius])), wheel, np.eye(4), EXACT
    )
    assert found == pytest.approx(-wheel.radius - past_axle.min(), abs=TOLERANCE)


def test_dense_samples_come_as_near_as_the_exact_distance():
    random = np.random.default_rng(3)
    mesh, wheel = random_mesh(random, 6, 0.05), wheel_of(0.05, 0.15)
    Ts = random_poses(random, 6, reach=0.2)
    points, _ = samples_of(mesh, 700)
    found = signed_wheel_distance(part_tree(mesh), wheel, Ts, EXACT)
    sampled = by_brute_force(points, wheel, Ts)
    apart = sampled > 0.0
    assert apart.any()
    np.testing.assert_allclose(found[apart], sampled[apart], atol=2e-4)
    assert (found <= sampled + TOLERANCE).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-0.05, 0.2))
def test_it_is_less_than_needed_exactly_where_the_part_is_too_near(seed, needed):
    random = np.random.default_rng(seed)
    part, wheel = part_tree(random_mesh(random, 20, 0.1)), wheel_of(0.05, 0.15)
    Ts = random_poses(random, 20, reach=0.4)
    exact = signed_wheel_distance(part, wheel, Ts, EXACT)
    found = signed_wheel_distance(part, wheel, Ts, needed)
    sure = np.abs(exact - needed) > 2 * TOLERANCE
    np.testing.assert_array_equal((found < needed)[sure], (exact < needed)[sure])
    near = sure & (exact < needed)
    np.testing.assert_allclose(found[near], exact[near], atol=2 * TOLERANCE)
    assert (found >= exact - TOLERANCE).all()
    # where it may stop at some depth, it tells of each pose whether the part is as deep
    stopped = signed_wheel_distance(part, wheel, Ts, needed, needed - 0.02)
    np.testing.assert_array_equal(stopped < needed - 0.02, found < needed - 0.02)
    less = found >= needed - 0.02
    np.testing.assert_array_equal(stopped[less], found[less])


def test_an_edge_of_the_wheel_that_sinks_into_a_flat_face_is_seen():
    # corners and middle of the face are far from where the rim cuts
    face = mesh_of(np.array([[[-1.03, -1.0, 0.0], [1.0, -1.01, 0.0], [0.02, 1.5, 0.0]]]))
    wheel = wheel_of(0.05, 0.15)
    tilted = pose(Rotation.from_euler("y", -30.0, degrees=True).as_matrix(), np.zeros(3))
    corner = np.array([0.025, 0.0, 0.0])  # on the rim, nearest to the robot
    depth = 0.0004
    normal = tilted[:3, 2]
    tilted[:3, 3] = corner + depth * normal
    found = signed_wheel_distance(part_tree(face), wheel, tilted, EXACT)
    points, _ = samples_of(face, 60)
    assert by_brute_force(points, wheel, tilted[None])[0] > 0.0  # samples miss it
    # the face is out of the wheel once it is at the corner; its deepest point, as far from the
    # wheel's side as from its rim, is only 0.73 as deep
    assert found == pytest.approx(-depth, abs=2 * TOLERANCE)


def test_a_part_that_encloses_the_wheel_is_far_from_its_surface_but_not_inside():
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    part = part_tree(TriangleMesh(box, np.array(faces)))
    found = signed_wheel_distance(part, wheel_of(0.05, 0.15), np.eye(4), EXACT)
    assert found == pytest.approx(1.0 - 0.3, abs=2 * TOLERANCE)  # the face at z = 1 m


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
    points, _ = samples_of(problem.cell.part, 12)
    sampled = by_brute_force(points, problem.cell.wheel, Ts.reshape(-1, 4, 4))
    found = problem.wheel_distance[::9, ::7].ravel()
    cuts = found < -problem.cell.max_belt_penetration
    assert (found[cuts] <= sampled[cuts] + TOLERANCE).all()
    assert (sampled[~cuts] >= -problem.cell.max_belt_penetration - TOLERANCE).all()


def test_stacks_keep_their_shape():
    part = part_tree(random_mesh(np.random.default_rng(0), 50, 0.3))
    wheel = wheel_of(0.05, 0.15)
    Ts = random_poses(np.random.default_rng(1), 24, 0.3).reshape(2, 3, 4, 4, 4)
    found = signed_wheel_distance(part, wheel, Ts, EXACT)
    assert found.shape == (2, 3, 4)
    assert signed_wheel_distance(part, wheel, Ts[0, 0, 0], EXACT) == found[0, 0, 0]
    assert signed_wheel_distance(part, wheel, Ts[:0], EXACT).shape == (0, 3, 4)
    needs = np.where(np.arange(4) % 2, EXACT, 0.01)  # one for each pose
    mixed = signed_wheel_distance(part, wheel, Ts, np.broadcast_to(needs, (2, 3, 4)))
    np.testing.assert_array_equal(mixed[..., 1::2], found[..., 1::2])


def test_poses_need_not_be_contiguous():
    part = part_tree(random_mesh(np.random.default_rng(0), 50, 0.3))
    wheel = wheel_of(0.05, 0.15)
    Ts = random_poses(np.random.default_rng(1), 24, 0.3)
    expected = signed_wheel_distance(part, wheel, Ts, EXACT)
    fortran = np.asfortranarray(Ts)
    np.testing.assert_array_equal(signed_wheel_distance(part, wheel, fortran, EXACT), expected)
    np.testing.assert_array_equal(signed_wheel_distance(part, wheel, Ts[::2], EXACT), expected[::2])


def test_every_sphere_slab_and_box_holds_its_triangles_and_every_triangle_is_there():
    mesh = random_mesh(np.random.default_rng(0), 333, 0.3)
    tree = part_tree(mesh)
    nodes = zip(tree.spheres, tree.slabs, tree.boxes, tree.first, tree.end, strict=True)
    for (x, y, z, radius), (*normal, low, high), half, first, end in nodes:
        from_centre = tree.triangles[first:end] - [x, y, z]
        assert np.linalg.norm(from_centre, axis=2).max() <= radius * (1 + 1e-12)
        assert (np.abs(from_centre) <= half + 1e-12).all()
        assert abs(np.linalg.norm(normal) - 1.0) < 1e-12
        assert low - 1e-12 <= (from_centre @ normal).min()
        assert (from_centre @ normal).max() <= high + 1e-12
    wanted = sorted(map(tuple, mesh.triangles.reshape(-1, 9)))
    assert sorted(map(tuple, tree.triangles.reshape(-1, 9))) == wanted
    leaves = tree.child == 0
    assert (tree.end - tree.first)[leaves].sum() == 333


def test_the_wheels_own_pose_does_not_matter():
    part = part_tree(random_mesh(np.random.default_rng(0), 50, 0.1))
    Ts = random_poses(np.random.default_rng(1), 5, 0.3)
    elsewhere = ContactWheel(0.05, 0.15, 1.0, random_poses(np.random.default_rng(2), 1, 5.0)[0])
    np.testing.assert_array_equal(
        signed_wheel_distance(part, elsewhere, Ts, EXACT),
        signed_wheel_distance(part, wheel_of(0.05, 0.15), Ts, EXACT),
    )


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 6e-4))
def test_what_is_told_of_a_whole_field_is_what_each_node_tells_alone(seed, bumps):
    problem = small_problem()
    part, wheel = problem.cell.part, problem.cell.wheel
    moved = np.random.default_rng(seed).normal(scale=bumps, size=part.vertices.shape)
    scene = replace(problem.scene, part=part_tree(TriangleMesh(part.vertices + moved, part.faces)))
    points, positions = problem.points, problem.field.contact_positions
    found = wheel_distances(scene, points, positions)
    Ts = wheel.T_contact0_contact(positions) @ inverse(points.Ts_workpiece_cutter)[:, None]
    depth = -problem.cell.planned_penetration
    alone = signed_wheel_distance(scene.part, wheel, Ts, depth)
    np.testing.assert_array_equal(found < depth, alone < depth)
    np.testing.assert_array_equal(found[found < depth], alone[alone < depth])
