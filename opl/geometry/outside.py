"""Whether a surface and the solid behind it agree on what is outside."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh
from opl.geometry.passes import MachinedSurface

# places looked at, and how far in front of the surface and behind it [m]
_LOOKS = 24
_DEPTH = 1e-3

# the surface is sampled about this often across its longest side, to choose the places from
_SAMPLES = 12


def facing_inward(surface: MachinedSurface, part: TriangleMesh) -> float:
    """Return the part of a surface whose normals point into the solid, 0 to 1.

    Places where the solid lies on both sides of the surface or on neither tell nothing: it is
    thinner there than the looks are deep, or stands off the surface.
    """
    size = max(float(np.ptp(surface.extent_along(axis))) for axis in np.eye(3))
    samples = surface.area_samples(size / _SAMPLES)
    some = np.linspace(0, len(samples.points) - 1, _LOOKS).astype(int)
    points, normals = samples.points[some], samples.normals[some]
    ahead, behind = (
        np.array([winding_number(part, p) for p in points + side * _DEPTH * normals]) > 0.5
        for side in (1.0, -1.0)
    )
    told = np.count_nonzero(ahead != behind)
    return np.count_nonzero(ahead & ~behind) / told if told else 0.0


def winding_number(part: TriangleMesh, point: Array) -> float:
    """Return how often a solid winds about a point: 1 inside, 0 outside.

    It is the sum of the solid angles under which the triangles are seen (Van Oosterom and Strackee,
    The Solid Angle of a Plane Triangle, 1983), over that of a whole sphere.

    Args:
        part: The solid.
        point: In [m], shape (3,).
    """
    a, b, c = np.moveaxis(part.triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = np.sum(a * np.cross(b, c), axis=1)
    ab, bc, ca = (np.sum(p * q, axis=1) for p, q in ((a, b), (b, c), (c, a)))
    angles = 2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angles.sum() / (4.0 * np.pi))
