import numpy as np
import pytest
import trimesh

from opl.errors import InputError
from opl.geometry.frames import rotation_angle
from opl.geometry.mesh import TriangleMesh, load_triangles
from opl.geometry.mesh_surface import MeshSurface, load_mesh_surface
from opl.geometry.regions import face_normals, neighbours, smooth_regions
from tests.support.solids import ORIGINS, cylinder, lay, sphere, tessellated, torus

X, Y, Z = np.eye(3)
SOLIDS = [cylinder(), sphere(), torus()]


@pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: solid.name)
def test_points_and_normals_are_as_exact_as_the_mesh_says(solid):
    surface = MeshSurface(tessellated(solid.surface))
    laid = lay(surface, [0.3, 0.2, 1.0], pitch=6e-3, margin=4e-3)
    Ts = laid.points.Ts_workpiece_cutter
    # on the triangles, so inside the round by no more than these are
    off = np.abs(solid.distance(Ts[ORIGINS]))
    assert off.max() <= 1.05 * surface.facet_error + 1e-9
    angle = np.arccos(np.clip(np.sum(Ts[:, :3, 2] * solid.normal(Ts[ORIGINS]), axis=1), -1, 1))
    flat, _ = face_normals(surface.mesh)
    one, other = flat[neighbours(surface.mesh).T]
    largest_turn = 2.0 * np.arcsin(0.5 * np.linalg.norm(one - other, axis=1).max())
    assert angle.max() <= largest_turn
    assert np.median(angle) < 0.2 * largest_turn
    one_pass = np.diff(laid.points.pass_index) == 0
    assert rotation_angle(Ts[:-1], Ts[1:])[one_pass].max() < 0.5


@pytest.mark.parametrize("solid", SOLIDS, ids=lambda solid: solid.name)
def test_a_mesh_and_its_own_surface_give_the_same_passes_within_two_hundredths(solid):
    smooth = lay(solid.surface, X + Y, pitch=6e-3, margin=5e-3).points
    meshed = lay(
        MeshSurface(tessellated(solid.surface, 120, 80)), X + Y, pitch=6e-3, margin=5e-3
    ).points
    assert smooth.n_passes == meshed.n_passes
    for index in range(smooth.n_passes):
        one, other = (
            points.Ts_workpiece_cutter[points.pass_index == index][ORIGINS]
            for points in (smooth, meshed)
        )
        assert polyline_distance(other, one) < 0.02e-3 + 0.05e-3  # both cut their corners
        np.testing.assert_allclose(one[[0, -1]], other[[0, -1]], atol=0.02e-3)


def polyline_distance(points, corners):
    """Return the largest distance of points from the polyline through corners."""
    start, end = corners[:-1], corners[1:]
    along = np.sum((end - start) ** 2, axis=1)
    s = np.einsum("pki,ki->pk", points[:, None] - start, end - start) / along
    feet = start + np.clip(s, 0.0, 1.0)[..., None] * (end - start)
    return np.linalg.norm(points[:, None] - feet, axis=-1).min(axis=1).max()


def test_the_bow_height_holds_on_the_triangles_themselves():
    surface = MeshSurface(tessellated(torus().surface))
    laid = lay(surface, Y, rows=1, pitch=1.0, max_bow_height=0.02e-3, largest_step=1.0)
    (curve,) = surface.curves(Y, float(laid.points.Ts_workpiece_cutter[0, 1, 3]), 1e-8)
    dense = curve.positions(np.linspace(0.0, curve.length, 4000))
    assert polyline_distance(dense, laid.points.Ts_workpiece_cutter[ORIGINS]) <= 0.02e-3


def test_curvature_of_a_mesh_is_about_that_of_its_solid():
    laid = lay(MeshSurface(tessellated(sphere().surface, 80, 80)), Z, margin=4e-3)
    np.testing.assert_allclose(laid.bending[:, 0, 0], 1.0 / 0.03, rtol=0.05)
    np.testing.assert_allclose(laid.bending[:, 1, 1], 1.0 / 0.03, rtol=0.05)


def test_a_pass_round_a_closed_mesh_closes_and_one_across_a_hole_breaks():
    tube = trimesh.creation.cylinder(0.02, 0.06, sections=90)
    side = np.abs(tube.face_normals[:, 2]) < 0.5
    surface = MeshSurface(TriangleMesh(tube.vertices, tube.faces[side]))
    laid = lay(surface, Z, pitch=15e-3, margin=10e-3)
    assert laid.points.n_passes == 3
    for index in range(3):
        Ts = laid.points.Ts_workpiece_cutter[laid.points.pass_index == index]
        np.testing.assert_allclose(Ts[0], Ts[-1], atol=1e-9)
    # two lines along the tube, one with a gap
    grid = tessellated(cylinder(length=0.06).surface, 40, 30)
    middle = grid.triangles.mean(axis=1)
    around, along = np.arctan2(middle[:, 1], middle[:, 0]), middle[:, 2]
    hole = (np.abs(around - 1.3) < 0.2) & (np.abs(along - 0.03) < 0.008)
    holed = MeshSurface(TriangleMesh(grid.vertices, grid.faces[~hole]))
    normal = np.array([-np.sin(1.3), np.cos(1.3), 0.0])
    offset_free = lay(MeshSurface(grid), normal, rows=1, pitch=1.0).points
    assert offset_free.n_passes == 1
    assert lay(holed, normal, rows=1, pitch=1.0).points.n_passes == 2


def test_regions_are_what_a_person_calls_faces_the_largest_first(tmp_path):
    tube = trimesh.creation.cylinder(20.0, 60.0, sections=90)
    mesh = TriangleMesh(tube.vertices, tube.faces)
    labels = smooth_regions(mesh, np.deg2rad(30.0))
    assert labels.max() == 2
    assert np.bincount(labels)[0] == 180
    path = tmp_path / "tube.stl"
    tube.export(path)
    side = load_mesh_surface(path, "mm", np.deg2rad(30.0), [1])
    assert side.extent_along(Z) == pytest.approx((-0.03, 0.03), abs=1e-8)
    assert np.abs(side.normals[:, 2]).max() < 1e-9
    with pytest.raises(ValueError, match=r"no face 4; tube\.stl has 1 to 3"):
        load_mesh_surface(path, "mm", np.deg2rad(30.0), [4])


def test_triangles_without_area_are_left_out_or_refused(tmp_path):
    path = tmp_path / "thin.ply"
    corners = [[0.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0], [0.0, 10, 0]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 1, 3]], process=False).export(path)
    assert len(load_triangles(path, "mm").faces) == 1
    trimesh.Trimesh(corners, [[0, 1, 2]], process=False).export(path)
    with pytest.raises(InputError, match="holds no triangle with an area"):
        load_triangles(path, "mm")


def test_triangles_that_face_opposite_sides_are_refused(tmp_path):
    path = tmp_path / "twisted.ply"
    corners = [[0.0, 0, 0], [10.0, 0, 0], [10.0, 10, 0], [0.0, 10, 0]]
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 3, 2]], process=False).export(path)
    with pytest.raises(InputError, match="face opposite sides"):
        load_triangles(path, "mm")


def test_a_plane_through_vertices_cuts_as_one_beside_them():
    grid = tessellated(cylinder(length=0.04).surface, 30, 20)
    laid = lay(MeshSurface(grid), Z, rows=1, pitch=1.0)  # the middle row of vertices
    assert laid.points.n_passes == 1
    assert laid.points.arc_length[-1] == pytest.approx(2.0 * 0.03, rel=1e-3)
