"""Solids as the viewer gets them: triangles that enclose what is proven."""

import numpy as np
import pytest
import trimesh

from opl.geometry.frames import from_roll_pitch_yaw
from opl.geometry.shapes import Body, Box, Cylinder
from opl.report.solids import SIDES, triangles

BOX, CYLINDER = Box((0.2, 0.3, 0.5)), Cylinder(0.05, 0.4)


def mesh_of(*bodies):
    return trimesh.Trimesh(*triangles(bodies), process=False)


@pytest.mark.parametrize(
    ("shape", "volume"),
    [(BOX, 0.03), (CYLINDER, 0.5 * SIDES * np.sin(2 * np.pi / SIDES) * 0.05**2 * 0.4)],
)
def test_a_primitive_is_closed_faces_outward_and_has_its_volume(shape, volume):
    mesh = mesh_of(Body("one", shape, np.eye(4)))
    assert mesh.is_watertight and mesh.volume == pytest.approx(volume)


def test_pieces_of_a_body_are_one_mesh_where_they_stand():
    T = from_roll_pitch_yaw(np.array([0.3, -0.2, 1.0]), np.array([1.0, 2.0, 3.0]))
    mesh = mesh_of(Body("link", BOX, np.eye(4)), Body("link", CYLINDER, T))
    box, cylinder = mesh.split()
    assert np.allclose(box.extents, BOX.size) and np.allclose(cylinder.centroid, T[:3, 3])
    assert mesh.volume == pytest.approx(box.volume + cylinder.volume)
