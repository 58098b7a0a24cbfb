"""Solids and meshes as coal knows them."""

from __future__ import annotations

import coal
import numpy as np

from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Box, Cylinder


def coal_solid(body: Body) -> coal.CollisionGeometry:
    """Return a body as coal knows it, in its own frame."""
    if isinstance(body.shape, Box):
        return coal.Box(*body.shape.size)
    if isinstance(body.shape, Cylinder):
        return coal.Cylinder(body.shape.radius, body.shape.length)
    return coal_mesh(body.shape)


def coal_mesh(mesh: TriangleMesh) -> coal.CollisionGeometry:
    """Return a mesh as coal knows it."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.faces), len(mesh.vertices))
    model.addVertices(np.asarray(mesh.vertices))
    model.addTriangles(np.asarray(mesh.faces, dtype=np.int32))
    model.endModel()
    return model
