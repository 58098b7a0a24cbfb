"""Meshes thinned for pictures, and the height of ridges."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from opl.geometry.mesh import TriangleMesh
from opl.geometry.scallop import ridge_height, scallop_pitch
from opl.geometry.thinning import thinned


def ball(subdivisions):
    sphere = trimesh.creation.icosphere(subdivisions, radius=0.1)
    return TriangleMesh(sphere.vertices, sphere.faces)


def test_a_small_mesh_stays_as_it_is():
    mesh = ball(2)
    assert thinned(mesh, len(mesh.faces)) is mesh


@pytest.mark.parametrize("most", [40, 500, 3000])
def test_a_large_mesh_keeps_its_shape_with_few_triangles(most):
    mesh = ball(5)
    few = thinned(mesh, most)
    assert most / 4 < len(few.faces) <= most
    size = np.ptp(few.vertices, axis=0)
    assert (size > 0.15).all() and (size <= 0.2 + 1e-12).all()
    normals = np.cross(*(few.triangles[:, k] - few.triangles[:, 0] for k in (1, 2)))
    # cubes may turn a triangle over here and there, not the shape
    outward = np.einsum("ij,ij->i", normals, few.triangles.mean(axis=1)) > 0.0
    assert outward.mean() > 0.95


# nearer to flat the angle between two rows has few digits left
CURVED = st.floats(-6.0, 200.0).filter(lambda curvature: abs(curvature) > 0.01)


@given(CURVED, st.floats(1e-6, 2e-4), st.floats(0.02, 0.15))
def test_rows_at_the_pitch_of_a_height_leave_ridges_of_that_height(curvature, height, radius):
    pitch = float(scallop_pitch(np.array(curvature), height, radius))
    assert ridge_height(np.array(curvature), pitch, radius) == pytest.approx(height, rel=1e-4)


def test_ridges_on_a_plane_and_in_a_hollow_that_the_wheel_fills():
    plane, filled = ridge_height(np.array([0.0, -20.0]), 0.02, 0.05)
    assert plane == pytest.approx(0.05 - np.sqrt(0.05**2 - 0.01**2), rel=1e-12)
    assert filled == 0.0
