"""Surfaces that face the wrong way, recognised by the solid behind them."""

import json

import numpy as np
import pytest
import trimesh

from opl.geometry.mesh import TriangleMesh, winding_number
from opl.geometry.mesh_surface import MeshSurface
from opl.geometry.patchwork import Face, Patchwork
from opl.geometry.surface_on_solid import facing_inward, heights_of_solid
from tests.support.jobs import opl, write_job
from tests.support.solids import cylinder, sphere, tessellated


def solid(mesh):
    return TriangleMesh(mesh.vertices, mesh.faces)


def test_heights_are_those_of_the_nearest_faces_edges_and_corners():
    box = solid(trimesh.creation.box([0.02, 0.02, 0.02]))
    frames = np.tile(np.eye(4), (6, 1, 1))
    frames[:, :3, 3] = 1e-3 * np.array(
        [[3, 4, 10.5], [3, 4, 9.5], [10.3, 2, 10.4], [10.3, 10.4, 11.2], [3, 4, 10], [3, 4, 13]]
    )
    expected = [-0.5, 0.5, -0.5, -1.3, 0.0, -np.inf]
    np.testing.assert_allclose(1e3 * heights_of_solid(frames, box), expected, atol=1e-9)
    # the same points on a surface that faces down
    frames[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    expected = [0.5, -0.5, 0.5, 1.3, 0.0, -np.inf]
    np.testing.assert_allclose(1e3 * heights_of_solid(frames, box), expected, atol=1e-9)


def test_heights_of_a_mesh_are_how_far_its_chords_lie_below():
    round_part = cylinder(radius=0.03)
    frames = np.tile(np.eye(4), (200, 1, 1))
    angle = np.linspace(0.4, 1.0, 200)
    normals = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(200)])
    frames[:, :3, 2], frames[:, :3, 3] = normals, 0.03 * normals
    frames[:, 2, 3] = 0.0173
    heights = heights_of_solid(frames, solid(tessellated(round_part.surface, 60, 40)))
    sagitta = 0.03 * (1.0 - np.cos(np.pi / 120.0))
    assert -2.0 * sagitta < heights.min() < -0.4 * sagitta
    assert heights.max() < 1e-9


def test_a_solid_winds_once_about_its_inside_only():
    ring = trimesh.creation.annulus(0.01, 0.02, 0.03, sections=512)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.03, 0.03, (200, 3))
    r = np.hypot(points[:, 0], points[:, 1])
    inside = (r > 0.01) & (r < 0.02) & (np.abs(points[:, 2]) < 0.015)
    found = [winding_number(solid(ring), point) for point in points]
    np.testing.assert_allclose(found, inside.astype(float), atol=0.05)


@pytest.mark.parametrize(("outward", "expected"), [(1.0, 0.0), (-1.0, 1.0)])
def test_a_surface_faces_outward_or_inward(outward, expected):
    ball = solid(trimesh.creation.icosphere(3, 0.03))
    surface = Patchwork((Face(sphere().surface, outward),))
    assert facing_inward(surface, ball) == expected


def test_a_bore_faces_outward_where_it_faces_its_axis():
    tube = solid(trimesh.creation.annulus(0.03, 0.036, 0.08, sections=128))
    bore = Patchwork((Face(cylinder(radius=0.03, length=0.03).surface, -1.0),))
    assert facing_inward(bore, tube) == 0.0
    assert facing_inward(Patchwork((Face(cylinder(0.03, 0.03).surface),)), tube) == 1.0


def test_what_is_thinner_than_the_looks_tells_nothing():
    leaf = solid(trimesh.creation.annulus(0.0299, 0.0301, 0.2, sections=256))
    assert facing_inward(MeshSurface(tessellated(cylinder(0.03, 0.03).surface)), leaf) == 0.0


def test_a_job_whose_surface_faces_into_its_solid_is_refused(tmp_path):
    told = "normals point into the solid at 100 % of the surface"
    ended = opl("check", write_job(tmp_path, {"workpiece.reversed_normal": True}))
    assert ended.status == 2
    assert f"workpiece.reversed_normal: {told}; set it to false" in ended.err
    path = write_job(tmp_path)
    content = json.loads((tmp_path / "surface.json").read_text())
    content["control_points_mm"] = content["control_points_mm"][::-1]
    content["weights"] = content["weights"][::-1]
    (tmp_path / "surface.json").write_text(json.dumps(content))
    ended = opl("check", path)
    assert ended.status == 2
    assert f"workpiece.reversed_normal: {told}; set it to true" in ended.err
