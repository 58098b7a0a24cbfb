"""Meshes with fewer triangles, for pictures."""

from __future__ import annotations

import numpy as np

from opl.geometry.mesh import TriangleMesh

_HALVINGS = 12  # of the size of a cube


def thinned(mesh: TriangleMesh, most: int) -> TriangleMesh:
    """Return a mesh of so many triangles at the most, as near to the given one as cubes allow.

    Corners in the same cube become one, their mean; triangles left without an area go. The cubes
    are the smallest that are large enough. A mesh of few triangles stays as it is. What is thinned
    is good to look at only: it need not be closed, nor free of crossings.
    """
    if len(mesh.faces) <= most:
        return mesh
    size = float(np.ptp(mesh.vertices, axis=0).max())
    too_small, large_enough = 0.0, size
    for _ in range(_HALVINGS):
        cube = (too_small + large_enough) / 2.0
        if len(_merged(mesh, cube).faces) > most:
            too_small = cube
        else:
            large_enough = cube
    return _merged(mesh, large_enough)


def _merged(mesh: TriangleMesh, cube: float) -> TriangleMesh:
    cells = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / cube).astype(np.int64)
    _, owner, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    owner = owner.ravel()
    sums = np.stack([np.bincount(owner, weights=column) for column in mesh.vertices.T], axis=1)
    faces = owner[mesh.faces]
    a, b, c = faces.T
    kept = faces[(a != b) & (b != c) & (c != a)]
    return TriangleMesh(sums / counts[:, None], kept)
