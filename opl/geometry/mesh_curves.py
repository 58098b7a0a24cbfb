"""Where planes cut a triangle mesh: polylines, and curves along them with smooth normals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from opl.geometry.frames import Array, from_axes, in_mm
from opl.geometry.mesh import TriangleMesh

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

# a vertex nearer to the plane than this fraction of the mesh's size is moved off it
_ON_PLANE = 1e-9

# nodes of a curve that are nearer to each other are one [m]
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class MeshCurve:
    """A polyline on a mesh as a function of its arc length in [m].

    Attributes:
        arc_length: At its nodes, from 0, shape (k,).
        positions: Points in [m], (...,) to (..., 3).
        normals: Smooth normals at the nodes, not of unit length, shape (k, 3).
        tensors: Curvature at the nodes in [1/m], in workpiece axes, shape (k, 3, 3).
        plane_normal: Unit normal of the plane, shape (3,).
    """

    arc_length: Array
    positions: PPoly
    normals: Array
    tensors: Array
    plane_normal: Array

    @classmethod
    def through(
        cls, points: Array, normals: Array, tensors: Array, plane_normal: Array
    ) -> MeshCurve | None:
        """Return the curve through points in [m], shape (k, 3), directed along axis x.

        The other arguments are its attributes; None if it has no length.
        """
        from scipy.interpolate import PPoly

        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        kept = np.append(True, steps > _SAME)
        points, normals, tensors = points[kept], normals[kept], tensors[kept]
        if len(points) < 2:
            return None
        chords = np.diff(points, axis=0)
        x = np.cross(normals[1:] + normals[:-1], plane_normal)
        if np.sum(chords * x) < 0.0:
            points, normals, tensors = points[::-1], normals[::-1], tensors[::-1]
            chords = -chords[::-1]
        steps = np.linalg.norm(chords, axis=1)
        arc_length = np.append(0.0, np.cumsum(steps))
        c = np.stack([chords / steps[:, None], points[:-1]])
        return cls(arc_length, PPoly(c, arc_length), normals, tensors, plane_normal)

    @property
    def length(self) -> float:
        """Return the length in [m]."""
        return float(self.arc_length[-1])

    @property
    def breaks(self) -> Array:
        """Return no place: triangles do not show where the curvature of their surface jumps."""
        return np.empty(0)

    def frames(self, arc_length: Array) -> Array:
        """Return Ts_workpiece_cutter at arc lengths in [m], shape (k, 4, 4).

        Raises:
            ValueError: Where the plane touches the mesh rather than cuts it.
        """
        z = self._between(self.normals, arc_length)
        x = np.cross(z, self.plane_normal)
        points = self.positions(arc_length)
        touching = np.linalg.norm(x, axis=-1) < 1e-6 * np.linalg.norm(z, axis=-1)
        if touching.any():
            raise ValueError(
                f"the plane touches the mesh at {in_mm(points[touching][0])} and does not cut it "
                "there"
            )
        return from_axes(z, x, points)

    def bending(self, arc_length: Array) -> Array:
        """Return the curvature of the surface in [1/m] in axes x and y, shape (k, 2, 2)."""
        axes = self.frames(arc_length)[:, :3, :2]
        return np.swapaxes(axes, 1, 2) @ self._between(self.tensors, arc_length) @ axes

    def _between(self, values: Array, arc_length: Array) -> Array:
        before = np.clip(self.arc_length.searchsorted(arc_length, "right") - 1, 0, len(values) - 2)
        start, end = self.arc_length[before], self.arc_length[before + 1]
        s = ((arc_length - start) / (end - start)).reshape(-1, *[1] * (values.ndim - 1))
        return (1.0 - s) * values[before] + s * values[before + 1]


def plane_polylines(
    mesh: TriangleMesh, plane_normal: Array, offset: float
) -> list[tuple[np.ndarray, np.ndarray, Array]]:
    """Return the polylines in which a plane cuts a mesh.

    Args:
        mesh: The mesh.
        plane_normal: Unit normal n of the plane, shape (3,).
        offset: Distance of the plane from the origin along n in [m].

    Returns:
        For each polyline its nodes as points of edges: both vertices and the fraction of the
        distance between them, shapes (k,). A closed one ends with its first node.
    """
    heights = mesh.vertices @ plane_normal - offset
    scale = _ON_PLANE * float(np.ptp(mesh.vertices, axis=0).max(initial=0.0))
    # so every cut edge is cut in its inside, and each polyline is a chain of whole triangles
    heights = np.where(np.abs(heights) < scale, scale, heights)
    above = heights > 0.0
    edges = mesh.edges
    cut = above[edges[..., 0]] != above[edges[..., 1]]
    crossed = np.flatnonzero(cut.any(axis=1))  # each in two edges
    if not len(crossed):
        return []
    pairs = np.sort(edges[crossed][cut[crossed]].reshape(-1, 2, 2), axis=2)
    keys, index = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
    links = index.reshape(-1, 2)
    fraction = heights[keys[:, 0]] / (heights[keys[:, 0]] - heights[keys[:, 1]])
    return [
        (keys[chain, 0], keys[chain, 1], fraction[chain]) for chain in _chains(links, len(keys))
    ]


def _chains(links: np.ndarray, n: int) -> list[np.ndarray]:
    """Return the chains of nodes that links make, open ones first, in order of their nodes."""
    beside: list[list[int]] = [[] for _ in range(n)]
    for first, second in links.tolist():
        beside[first].append(second)
        beside[second].append(first)
    free = [len(others) for others in beside]
    chains = []
    ends = [node for node in range(n) if free[node] % 2 == 1]
    for start in [*ends, *range(n)]:
        if not free[start]:
            continue
        chain = [start]
        while free[chain[-1]]:
            node = chain[-1]
            following = beside[node].pop(0)
            beside[following].remove(node)
            free[node] -= 1
            free[following] -= 1
            chain.append(following)
        chains.append(np.array(chain))
    return chains
