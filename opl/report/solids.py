"""Solids as triangles for pictures: primitives meshed, pieces joined, large meshes thinned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array, transform
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Box, Cylinder
from opl.geometry.thinning import thinned

MOST_TRIANGLES = 12_000  # of a drawn mesh
SIDES, SIDES_OF_LARGE, LARGE = 32, 96, 0.08  # of a drawn cylinder; [m] radius of a large one


def triangles(bodies: Sequence[Body]) -> tuple[Array, np.ndarray]:
    """Return the corners (n, 3) in [m] and triangles (k, 3) of bodies in one frame, seen as one."""
    corners, faces, count = list[Array](), list[np.ndarray](), 0
    for body in bodies:
        own, sides = _mesh(body.shape)
        corners.append(transform(body.T_parent_body, own))
        faces.append(sides + count)
        count += len(own)
    return np.concatenate(corners), np.concatenate(faces)


def is_thinned(body: Body) -> bool:
    """Return whether a body is drawn with fewer triangles than it is proven with."""
    return isinstance(body.shape, TriangleMesh) and len(body.shape.faces) > MOST_TRIANGLES


def _mesh(shape: Box | Cylinder | TriangleMesh) -> tuple[Array, np.ndarray]:
    if isinstance(shape, TriangleMesh):
        mesh = thinned(shape, MOST_TRIANGLES)
        return mesh.vertices, mesh.faces
    if isinstance(shape, Box):
        x, y, z = shape.size
        return _prism(np.array([[x, y], [-x, y], [-x, -y], [x, -y]]) / 2.0, z)
    sides = SIDES_OF_LARGE if shape.radius > LARGE else SIDES
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return _prism(shape.radius * around, shape.length)


def _prism(outline: Array, length: float) -> tuple[Array, np.ndarray]:
    """Return a prism along z, centred; its convex outline, shape (n, 2), runs counterclockwise."""
    n = len(outline)
    ends = [np.column_stack([outline, np.full(n, z)]) for z in (-length / 2.0, length / 2.0)]
    here = np.arange(n)
    after = np.roll(here, -1)
    sides = np.stack([here, after, after + n, here, after + n, here + n], axis=1).reshape(-1, 3)
    fan = np.stack([np.zeros(n - 2, dtype=int), here[1:-1], here[2:]], axis=1)
    return np.concatenate(ends), np.concatenate([sides, fan[:, ::-1], fan + n])
