"""Triangle meshes, and reading them: solids, and triangles that enclose nothing."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from opl.errors import InputError
from opl.geometry.crossings import crossing_triangles
from opl.geometry.frames import Array, in_mm, read_only
from opl.geometry.mesh_file import read_triangles

_METRES = {"mm": 1e-3, "m": 1.0}

# a closed mesh with less than this fraction of the volume of its bounding cube is flat
_FLAT_VOLUME = 1e-9

# a triangle with less than this fraction of the square of its longest edge has no area
_FLAT_AREA = 1e-12


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface made of triangles, counter-clockwise seen from outside. Arrays are read-only.

    Attributes:
        vertices: Corners in [m], shape (n, 3).
        faces: Indices of the three corners of each triangle, shape (m, 3).

    Raises:
        ValueError: If shapes, values or indices are not those of a mesh.
    """

    vertices: Array
    faces: NDArray[np.int64]

    def __post_init__(self) -> None:
        vertices, faces = read_only(self.vertices), read_only(self.faces, np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise ValueError(f"vertices: must be finite, of shape (n, 3), got {vertices.shape}")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"faces: must have shape (m, 3), got {faces.shape}")
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError(f"faces: indices must lie between 0 and {len(vertices) - 1}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @property
    def triangles(self) -> Array:
        """Return the corners of each triangle in [m], shape (m, 3, 3)."""
        return self.vertices[self.faces]

    @property
    def edges(self) -> NDArray[np.int64]:
        """Return the vertices at both ends of the three edges of each triangle, shape (m, 3, 2)."""
        return self.faces[:, [[0, 1], [1, 2], [2, 0]]]

    @property
    def is_closed(self) -> bool:
        """Return whether every edge belongs to an even number of triangles: there is an inside."""
        return bool((self.count_edges()[1] % 2 == 0).all())

    @property
    def faces_one_way(self) -> bool:
        """Return whether no two neighbouring triangles face opposite sides."""
        directed = self.edges.reshape(-1, 2) @ (len(self.vertices), 1)  # a number for each
        return len(np.unique(directed)) == len(directed)

    @property
    def volume(self) -> float:
        """Return the enclosed volume in [m^3], negative if the triangles face inwards."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return float(np.sum(np.cross(a, b) * c) / 6.0)

    @property
    def centre_of_volume(self) -> Array:
        """Return the centre of gravity of the enclosed volume in [m], shape (3,)."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        parts = np.sum(np.cross(a, b) * c, axis=1)  # six times a tetrahedron from the origin
        return np.asarray(parts @ (a + b + c) / 4.0 / parts.sum())

    def count_edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the vertices at both ends of each edge, shape (e, 2), and its triangles, (e,)."""
        edges = np.sort(self.edges.reshape(-1, 2), axis=1)
        # numbers are sorted many times as fast as pairs of them
        own, counts = np.unique(edges @ (len(self.vertices), 1), return_counts=True)
        return np.stack(np.divmod(own, len(self.vertices)), axis=1), counts


def winding_number(mesh: TriangleMesh, point: Array) -> float:
    """Return how often a surface winds around a point: 1 in a solid, 0 outside, a part if open.

    It is the sum of the solid angles of its triangles (Van Oosterom and Strackee, The Solid Angle
    of a Plane Triangle, 1983), over that of a whole sphere. The point is in [m], shape (3,).
    """
    corners = (mesh.vertices - point).T
    lengths = np.sqrt(np.square(corners).sum(axis=0))
    a, b, c = mesh.faces.T
    # a coordinate at a time: rows of three numbers take several times as long
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[:, a], corners[:, b], corners[:, c]
    la, lb, lc = lengths[a], lengths[b], lengths[c]
    volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    ab, bc, ca = (
        ax * bx + ay * by + az * bz,
        bx * cx + by * cy + bz * cz,
        cx * ax + cy * ay + cz * az,
    )
    angles = 2.0 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angles.sum() / (4.0 * np.pi))


def box_corners(points: Array) -> Array:
    """Return the corners of the box around points in [m], along the axes, shape (8, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray(np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T)


def load_mesh(path: Path, unit: Literal["mm", "m"]) -> TriangleMesh:
    """Read a closed solid from an STL, PLY or OBJ file.

    Corners at the same place become one vertex. A solid whose triangles all face inwards is turned
    inside out.

    Args:
        path: The file.
        unit: What one unit of the file is; mesh files do not state it.

    Raises:
        InputError: If the file cannot be read, has no triangles, or if they do not enclose a
            volume or cross each other.
    """
    corners, faces = read_triangles(path)
    solid = TriangleMesh(_METRES[unit] * corners, faces)
    edges, counts = solid.count_edges()
    if (counts != 2).any():
        raise InputError(str(path), f"is not closed: {_open_edges(solid, edges[counts != 2])}")
    if not solid.faces_one_way:
        raise InputError(str(path), "has neighbouring triangles that face opposite sides")
    if abs(solid.volume) <= _FLAT_VOLUME * np.ptp(solid.vertices, axis=0).max() ** 3:
        raise InputError(str(path), "encloses no volume")
    crossing = crossing_triangles(solid.triangles)
    if len(crossing):
        raise InputError(str(path), f"crosses itself: {_crossing(solid, crossing)}")
    return solid if solid.volume > 0.0 else TriangleMesh(solid.vertices, solid.faces[:, ::-1])


def load_triangles(path: Path, unit: Literal["mm", "m"]) -> TriangleMesh:
    """Read triangles, which need not enclose anything; arguments as of `load_mesh`.

    Corners at the same place become one vertex; triangles without area are left out.

    Raises:
        InputError: If the file cannot be read, has no triangles with an area, or if neighbouring
            triangles face opposite sides.
    """
    mesh = load_shell(path, unit)
    if not mesh.faces_one_way:
        raise InputError(str(path), "has neighbouring triangles that face opposite sides")
    return mesh


def load_shell(path: Path, unit: Literal["mm", "m"]) -> TriangleMesh:
    """Read triangles that may be open, cross and face either side; arguments as of `load_mesh`.

    Corners at the same place become one vertex; triangles without area are left out.

    Raises:
        InputError: If the file cannot be read or has no triangles with an area.
    """
    corners, faces = read_triangles(path)
    a, b, c = np.moveaxis(corners[faces], 1, 0)
    longest = np.linalg.norm(np.stack([b - a, c - b, a - c]), axis=2).max(axis=0)
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    flat = twice_area <= _FLAT_AREA * longest**2
    if flat.all():
        raise InputError(str(path), "holds no triangle with an area")
    return TriangleMesh(_METRES[unit] * corners, faces[~flat])


def _open_edges(solid: TriangleMesh, wrong: NDArray[np.int64]) -> str:
    """Return where a mesh is open, given the vertices of edges that are not those of two."""
    return (
        f"{len(wrong)} edges are not those of two triangles, one of them near "
        f"{in_mm(solid.vertices[wrong[0]].mean(axis=0))}; a solid without holes is needed"
    )


def _crossing(solid: TriangleMesh, pairs: NDArray[np.int64]) -> str:
    """Return which triangles of a solid cross each other, and where the first ones do."""
    one, other = solid.triangles[pairs[0]]
    # the middle of what their boxes share
    low = np.maximum(one.min(axis=0), other.min(axis=0))
    high = np.minimum(one.max(axis=0), other.max(axis=0))
    more = f", and {len(pairs) - 1} more pairs" if len(pairs) > 1 else ""
    return (
        f"triangles {pairs[0, 0] + 1} and {pairs[0, 1] + 1} of {len(solid.faces)} near "
        f"{in_mm(0.5 * (low + high))}{more}; a solid with an inside is needed, so unite its "
        "bodies before it is exported"
    )
