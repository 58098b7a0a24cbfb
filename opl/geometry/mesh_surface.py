"""A machined surface made of triangles.

Cutter points lie on the triangles themselves: they are as exact as the mesh. Normals are those of
the smooth surface that the triangles stand for: at a corner the mean of the triangles around it,
weighted with angle and area, and in between interpolated. They differ from the true ones by no more
than neighbouring triangles differ from each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from opl.geometry.coverage import AreaSamples
from opl.geometry.curves import SurfaceCurve
from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh, load_triangles
from opl.geometry.mesh_curves import MeshCurve, plane_polylines
from opl.geometry.patchwork import across_rows, in_order
from opl.geometry.regions import face_normals, smooth_regions


@dataclass(frozen=True, eq=False)
class MeshSurface:
    """Triangles without creases, counter-clockwise seen from outside.

    Attributes:
        mesh: The triangles; all have an area.
    """

    mesh: TriangleMesh

    @cached_property
    def normals(self) -> Array:
        """Unit normals at the vertices, shape (n, 3)."""
        faces, n = self.mesh.faces, len(self.mesh.vertices)
        flat, areas = face_normals(self.mesh)
        corners = self.mesh.triangles
        total = np.zeros((n, 3))
        for k in range(3):
            a = corners[:, (k + 1) % 3] - corners[:, k]
            b = corners[:, (k + 2) % 3] - corners[:, k]
            angle = np.arctan2(2.0 * areas, np.sum(a * b, axis=1))
            np.add.at(total, faces[:, k], (angle * areas)[:, None] * flat)
        return _mirrored_to_border(_unit(total), self.mesh)

    @cached_property
    def bending(self) -> Array:
        """Curvature tensors in [1/m] at the vertices, in workpiece axes, shape (n, 3, 3).

        Of each triangle the tensor is the least-squares answer to how the normals change along its
        edges; a vertex has the mean of those around it (Rusinkiewicz, Estimating Curvatures and
        Their Derivatives on Triangle Meshes, 2004).
        """
        faces, n = self.mesh.faces, len(self.mesh.vertices)
        flat, areas = face_normals(self.mesh)
        corners, normals = self.mesh.triangles, self.normals[faces]
        edges = np.roll(corners, -1, axis=1) - corners
        x = edges[:, 0] / np.linalg.norm(edges[:, 0], axis=1, keepdims=True)
        axes = np.stack([x, np.cross(flat, x)], axis=1)  # (m, 2, 3)
        e = np.einsum("fki,fai->fka", edges, axes)
        dn = np.einsum("fki,fai->fka", np.roll(normals, -1, axis=1) - normals, axes)
        # unknowns L, M, N: [e0 e1 0; 0 e0 e1] [L M N] = dn
        A = np.zeros((len(faces), 6, 3))
        A[:, 0::2, 0], A[:, 0::2, 1] = e[:, :, 0], e[:, :, 1]
        A[:, 1::2, 1], A[:, 1::2, 2] = e[:, :, 0], e[:, :, 1]
        L, M, N = np.einsum("fij,fj->if", np.linalg.pinv(A), dn.reshape(-1, 6))
        form = np.stack([np.stack([L, M], -1), np.stack([M, N], -1)], -2)
        tensors = np.einsum("fai,fab,fbj->fij", axes, form, axes)
        total, weight = np.zeros((n, 3, 3)), np.zeros(n)
        for k in range(3):
            np.add.at(total, faces[:, k], areas[:, None, None] * tensors)
            np.add.at(weight, faces[:, k], areas)
        return total / np.where(weight > 0.0, weight, 1.0)[:, None, None]

    @cached_property
    def facet_error(self) -> float:
        """About how far in [m] triangles lie off the smooth surface through their corners.

        An edge of length l whose ends' normals differ by an angle is the chord of an arc of about
        l angle / 8 height; the triangle's middle may lie a third further away.
        """
        faces = self.mesh.faces
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        vertices, normals = self.mesh.vertices[ends], self.normals[ends]
        along = vertices[:, 1] - vertices[:, 0]
        turned = np.abs(np.sum((normals[:, 1] - normals[:, 0]) * along, axis=1))
        return float(turned.max(initial=0.0) / 8.0 * 4.0 / 3.0)

    def extent_along(self, direction: Array) -> tuple[float, float]:
        """Return the least and the largest d . p in [m]; see `Patchwork.extent_along`."""
        heights = self.mesh.vertices[np.unique(self.mesh.faces)] @ direction
        return float(heights.min()), float(heights.max())

    def curves(
        self, plane_normal: Array, offset: float, tolerance: float
    ) -> Sequence[SurfaceCurve]:
        """Return the curves in which a plane cuts the mesh; see `Patchwork.curves`."""
        chains = plane_polylines(self.mesh, plane_normal, offset)
        curves = [
            MeshCurve.through(
                (1.0 - s)[:, None] * self.mesh.vertices[a] + s[:, None] * self.mesh.vertices[b],
                (1.0 - s)[:, None] * self.normals[a] + s[:, None] * self.normals[b],
                (1.0 - s)[:, None, None] * self.bending[a] + s[:, None, None] * self.bending[b],
                plane_normal,
            )
            for a, b, s in chains
        ]
        return in_order([curve for curve in curves if curve is not None])

    def area_samples(self, spacing: float) -> AreaSamples:
        """Return points that stand for the area around them, at most ``spacing`` [m] apart."""
        flat, areas = face_normals(self.mesh)
        corners = self.mesh.triangles
        longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
        cuts = np.clip(np.ceil(longest / spacing), 1, 200).astype(int)
        parts = []
        for n in np.unique(cuts):
            here = cuts == n
            weights = _middles(int(n))
            points = np.einsum("kc,fci->fki", weights, corners[here]).reshape(-1, 3)
            parts.append(
                AreaSamples(
                    points,
                    np.repeat(flat[here], n * n, axis=0),
                    np.repeat(areas[here] / (n * n), n * n),
                    np.full((len(points), 2), np.nan),
                )
            )
        return AreaSamples.joined(parts)

    def curvature_across(self, spacing: float, direction: Array) -> tuple[Array, Array]:
        """Return curvature in [1/m] and slope across rows; see `Patchwork.curvature_across`."""
        used = np.unique(self.mesh.faces)
        cut, slope, _, y = across_rows(self.normals[used], direction)
        return np.einsum("ki,kij,kj->k", y, self.bending[used][cut], y), slope


def load_mesh_surface(
    path: Path, unit: Literal["mm", "m"], crease: float, ids: Sequence[int] | None
) -> MeshSurface:
    """Read triangles to be ground.

    Args:
        path: An STL, PLY or OBJ file.
        unit: What one unit of the file is.
        crease: Angle in [rad] between neighbouring triangles that ends a region.
        ids: Regions to be ground, counted from 1, the largest area first; None for all.

    Raises:
        InputError: If the file cannot be used.
        ValueError: If there is no region of an id.
    """
    mesh = load_triangles(path, unit)
    if ids is None:
        return MeshSurface(mesh)
    labels = smooth_regions(mesh, crease)
    count = int(labels.max()) + 1
    for number in ids:
        if number > count:
            raise ValueError(f"no face {number}; {path.name} has 1 to {count}")
    chosen = np.isin(labels, np.array(ids) - 1)
    return MeshSurface(_part(mesh, chosen))


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0))


def _mirrored_to_border(normals: Array, mesh: TriangleMesh) -> Array:
    """Return normals that are better at the border, where there are triangles on one side only.

    The normals at both ends of an arc are mirror images in the plane halfway between; so those of
    the border follow from their neighbours inside.
    """
    edges = np.sort(mesh.edges.reshape(-1, 2), axis=1)
    ends, counts = np.unique(edges, axis=0, return_counts=True)
    border = np.zeros(len(normals), dtype=bool)
    border[ends[counts == 1]] = True
    inward = np.concatenate([ends, ends[:, ::-1]])
    inward = inward[border[inward[:, 0]] & ~border[inward[:, 1]]]
    outer, inner = inward.T
    along = mesh.vertices[inner] - mesh.vertices[outer]
    square = np.sum(along**2, axis=1)
    mirrored = (
        normals[inner] - (2.0 * np.sum(normals[inner] * along, axis=1) / square)[:, None] * along
    )
    total = np.zeros_like(normals)
    np.add.at(total, outer, mirrored / square[:, None])
    found = np.zeros(len(normals), dtype=bool)
    found[outer] = True
    return np.where(found[:, None], _unit(total), normals)


def _part(mesh: TriangleMesh, chosen: np.ndarray) -> TriangleMesh:
    used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    return TriangleMesh(mesh.vertices[used], faces.reshape(-1, 3))


def _middles(n: int) -> Array:
    """Return the middles of the n^2 triangles into which one is cut, in its corners' weights."""
    up = [(3 * i + 1, 3 * j + 1) for i in range(n) for j in range(n - i)]
    down = [(3 * i + 2, 3 * j + 2) for i in range(n - 1) for j in range(n - 1 - i)]
    uv = np.array(up + down, dtype=np.float64) / (3.0 * n)
    return np.column_stack([1.0 - uv.sum(axis=1), uv])
