"""Meshes in PyBullet that are not the part: compounds of their triangles.

Bullet makes a mesh a convex hull unless a flag keeps it concave, and between two concave meshes it
finds no contact whatever. A compound of triangles, each a convex body of its own, has neither
fault.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from threading import Lock

import numpy as np

from opl.geometry.frames import Array
from opl.verification.engine import SCALE, BulletClient, pybullet

RAY = np.array([0.2748, 0.5913, 0.7582])  # not along any edge of a likely mesh


def triangle_body(client: BulletClient, triangles: Array) -> int:
    """Add a body without mass and return Bullet's number of it.

    Bullet makes one convex shape for each object of an OBJ file; here each triangle is an object.
    Their corners are in [m], shape (n, 3, 3).
    """
    lines = []
    for number, corners in enumerate(SCALE * triangles):
        lines += ["v {:.9g} {:.9g} {:.9g}".format(*corner) for corner in corners]
        lines += [f"o t{number}", "f {} {} {}".format(*range(3 * number + 1, 3 * number + 4))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "triangles.obj"
        path.write_text("\n".join(lines) + "\n", encoding="ascii")
        shape = client.createCollisionShape(pybullet.GEOM_MESH, fileName=str(path))
        # the body reads the file once more
        return int(client.createMultiBody(baseMass=0.0, baseCollisionShapeIndex=shape))


# PyBullet never lets go of a list that it was given: the same ones are filled again and again
_CORNERS: list[list[float]] = []
_GIVEN: list[list[float]] = []
_NUMBERS: list[int] = []
_FILLED = Lock()


def concave_shape(client: BulletClient, corners: Array) -> int:
    """Add triangles as they are; return Bullet's number of their shape.

    Their corners are in [m], shape (3 n, 3).
    """
    n = len(corners)
    with _FILLED:
        _CORNERS.extend([] for _ in range(n - len(_CORNERS)))
        _GIVEN[:] = _CORNERS[:n]
        for row, corner in zip(_GIVEN, (SCALE * corners).tolist(), strict=True):
            row[:] = corner
        _NUMBERS[:] = range(n)
        shape = client.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=_GIVEN,
            indices=_NUMBERS,
            flags=pybullet.GEOM_FORCE_CONCAVE_TRIMESH,
        )
    return int(shape)


def is_inside(triangles: Array, p: Array) -> bool:
    """Return whether a ray from a point crosses a closed surface an odd number of times.

    The corners of its triangles are in [m], shape (n, 3, 3), and so is the point, shape (3,).
    """
    a, b, c = (triangles[:, k] - p for k in range(3))
    sides = [np.sign(np.cross(one, other) @ RAY) for one, other in ((a, b), (b, c), (c, a))]
    through = (sides[0] == sides[1]) & (sides[1] == sides[2])
    normal = np.cross(b - a, c - a)
    ahead = np.einsum("ij,ij->i", normal, a) * (normal @ RAY) > 0.0
    return bool(np.count_nonzero(through & ahead) % 2)
