"""Triangles that cross each other, against a test that shares nothing with ours, and on solids."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.errors import InputError
from opl.files.resources import folder
from opl.geometry.crossings import crossing_triangles
from opl.geometry.mesh import load_mesh


def volume(a, b, c, d):
    return np.linalg.det(np.stack([b - a, c - a, d - a], axis=-1))


def pierces(start, end, triangle):
    """Return whether a segment goes through the inside of a triangle, by signed volumes."""
    a, b, c = triangle
    if volume(a, b, c, start) * volume(a, b, c, end) >= 0.0:
        return False
    around = [volume(start, end, p, q) for p, q in ((a, b), (b, c), (c, a))]
    return min(around) > 0.0 or max(around) < 0.0


def cross(one, other):
    return any(
        pierces(corners[k], corners[k - 1], against)
        for corners, against in ((one, other), (other, one))
        for k in range(3)
    )


@pytest.mark.parametrize("shared", [0, 1])
def test_random_triangles_cross_where_an_edge_goes_through_the_other(shared):
    triangles = np.random.default_rng(shared).random((300, 2, 3, 3))
    triangles[:, 1, :shared] = triangles[:, 0, :shared]
    expected = np.array([cross(*pair) for pair in triangles])
    found = np.array([len(crossing_triangles(pair)) == 1 for pair in triangles])
    assert 30 < expected.sum() < 150
    np.testing.assert_array_equal(found, expected)


def test_all_pairs_of_a_cloud_of_triangles_are_found():
    rng = np.random.default_rng(3)
    cloud = rng.random((70, 1, 3)) + 0.6 * rng.random((70, 3, 3))
    expected = [[i, j] for i in range(70) for j in range(i + 1, 70) if cross(cloud[i], cloud[j])]
    assert len(expected) > 40
    np.testing.assert_array_equal(crossing_triangles(cloud), expected)


def beside(p, q, r):
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def overlap(one, other):
    """Return whether triangles in one plane overlap: edges that cross, or a corner inside."""
    edges = [[(t[k - 1], t[k]) for k in range(3)] for t in (one, other)]
    crossed = any(
        beside(a, b, p) * beside(a, b, q) < 0 and beside(p, q, a) * beside(p, q, b) < 0
        for a, b in edges[0]
        for p, q in edges[1]
    )
    inside = [
        len({np.sign(beside(a, b, t[0])) for a, b in around}) == 1
        for t, around in ((one, edges[1]), (other, edges[0]))
    ]
    return crossed or any(inside)


def test_triangles_in_one_plane_overlap_or_lie_beside_each_other():
    rng = np.random.default_rng(7)
    flat = rng.random((300, 2, 3, 2))
    across, up = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    tilted = flat[..., :1] * across + flat[..., 1:] * up + [5.0, -2.0, 1.0]
    expected = np.array([overlap(*pair) for pair in flat])
    found = np.array([len(crossing_triangles(pair)) == 1 for pair in tilted])
    assert 100 < expected.sum() < 290
    np.testing.assert_array_equal(found, expected)


corner = st.tuples(*[st.floats(-1.0, 1.0, allow_subnormal=False)] * 3)


@settings(max_examples=100, deadline=None)
@given(st.lists(corner, min_size=4, max_size=4), st.floats(1e-3, 1.0))
def test_the_sides_of_a_tetrahedron_never_cross_however_flat(corners, flatness):
    vertices = np.array(corners) * [1.0, 1.0, flatness]
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    heights = [
        abs(volume(*vertices)) / max(np.linalg.norm(np.cross(b - a, c - a)), 1e-12)
        for a, b, c in vertices[faces]
    ]
    # one that is flat to the last digits is two sheets on each other
    if min(heights) > 1e-4:
        assert len(crossing_triangles(vertices[faces])) == 0


@pytest.mark.parametrize("part", ["v_shape", "s_shape", "faucet", "turbine_blade", "bent_tube"])
def test_the_parts_do_not_cross_themselves(part):
    assert load_mesh(folder("workpieces") / part / f"{part}.stl", "mm").volume > 0.0


@pytest.mark.parametrize(
    "solid",
    [
        trimesh.creation.box((60, 40, 20)).subdivide().subdivide(),
        trimesh.creation.icosphere(3, 30.0),
        trimesh.creation.annulus(18.0, 20.0, 50.0, sections=150),
        trimesh.creation.cone(20.0, 50.0, sections=200),
    ],
    ids=["coplanar neighbours", "sphere", "thin wall", "slivers at a tip"],
)
def test_sound_solids_in_any_position_and_single_precision_are_no_false_alarm(solid):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        turned = solid.copy()
        turned.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
        moved = (turned.vertices + 400.0 * rng.random(3)).astype(np.float32)
        assert len(crossing_triangles(moved.astype(float)[turned.faces])) == 0


def spindle():
    """A torus whose tube is wider than its ring: it goes through its own axis."""
    return trimesh.creation.torus(10.0, 14.0, major_sections=40, minor_sections=30)


def boxes(shift):
    box = trimesh.creation.box((20, 20, 20))
    other = box.copy()
    other.apply_translation(shift)
    return trimesh.util.concatenate([box, other])


def pulled_through():
    """A box with a corner pulled through the opposite side."""
    box = trimesh.creation.box((20, 20, 20))
    vertices = box.vertices.copy()
    vertices[np.argmin(vertices.sum(axis=1))] = [14.0, 3.0, 4.0]
    return trimesh.Trimesh(vertices, box.faces, process=False)


@pytest.mark.parametrize(
    "make",
    [spindle, lambda: boxes([7, 5, 3]), lambda: boxes([7, 0, 0]), pulled_through],
    ids=["through its axis", "two bodies", "two bodies flush", "a corner through a side"],
)
def test_a_solid_that_crosses_itself_is_refused_and_the_place_named(tmp_path, make):
    path = tmp_path / "part.stl"
    solid = make()
    assert solid.is_watertight  # as far as its edges tell
    solid.export(path)
    with pytest.raises(InputError, match=r"crosses itself: triangles \d+ and \d+ of \d+ near \("):
        load_mesh(path, "mm")


def test_the_place_is_where_two_bodies_meet(tmp_path):
    path = tmp_path / "part.stl"
    boxes([15, 0, 0.5]).export(path)  # they share 5 mm along x
    with pytest.raises(InputError) as caught:
        load_mesh(path, "mm")
    x = float(str(caught.value).split("near (")[1].split(",")[0])
    assert 5.0 <= x <= 10.0
