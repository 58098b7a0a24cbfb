"""The smooth regions of a triangle mesh: what a person calls its faces."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh


def face_normals(mesh: TriangleMesh) -> tuple[Array, Array]:
    """Return the unit normal and the area in [m^2] of each triangle, shapes (m, 3) and (m,)."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    return normals / lengths[:, None], 0.5 * lengths


def neighbours(mesh: TriangleMesh) -> np.ndarray:
    """Return the pairs of triangles that share an edge, shape (k, 2)."""
    edges = np.sort(mesh.edges.reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(mesh.faces)), 3)
    order = np.lexsort(edges.T[::-1])
    edges, owner = edges[order], owner[order]
    same = (edges[1:] == edges[:-1]).all(axis=1)
    # where three triangles meet the first pairs are as good as any
    return np.stack([owner[:-1][same], owner[1:][same]], axis=1)


def smooth_regions(mesh: TriangleMesh, crease: float) -> np.ndarray:
    """Return the region of each triangle, 0, 1, ..., the largest area first, shape (m,).

    Neighbours belong together unless their normals differ by more than ``crease`` [rad]. All
    triangles must have areas.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    normals, areas = face_normals(mesh)
    pairs = neighbours(mesh)
    cosine = np.sum(normals[pairs[:, 0]] * normals[pairs[:, 1]], axis=1)
    first, second = pairs[cosine >= np.cos(crease)].T
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(len(areas), len(areas)))
    count, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels, weights=areas, minlength=count)
    # equal areas in the order of their first triangle, whatever their last digits are
    rank = np.empty(count, dtype=np.int64)
    rank[np.argsort(-np.round(sizes / sizes.max(), 6), kind="stable")] = np.arange(count)
    return np.asarray(rank[labels])
