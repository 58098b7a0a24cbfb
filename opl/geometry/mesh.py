"""Triangle meshes of solids: reading them, and points that cover their surface."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from opl.errors import InputError
from opl.geometry.frames import Array

_METRES = {"mm": 1e-3, "m": 1.0}
_SUFFIXES = (".stl", ".ply", ".obj")

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
        vertices = np.array(self.vertices, dtype=float)
        faces = np.array(self.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise ValueError(f"vertices: must be finite, of shape (n, 3), got {vertices.shape}")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"faces: must have shape (m, 3), got {faces.shape}")
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise ValueError(f"faces: indices must lie between 0 and {len(vertices) - 1}")
        for name, array in (("vertices", vertices), ("faces", faces)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def triangles(self) -> Array:
        """Return the corners of each triangle in [m], shape (m, 3, 3)."""
        return self.vertices[self.faces]

    @property
    def volume(self) -> float:
        """Return the enclosed volume in [m^3], negative if the triangles face inwards."""
        a, b, c = np.moveaxis(self.triangles, 1, 0)
        return float(np.sum(np.cross(a, b) * c) / 6.0)


def load_mesh(path: Path, unit: Literal["mm", "m"]) -> TriangleMesh:
    """Read a closed solid from an STL, PLY or OBJ file.

    Corners at the same place become one vertex. A solid whose triangles all face inwards is turned
    inside out.

    Args:
        path: The file.
        unit: What one unit of the file is; mesh files do not say.

    Raises:
        InputError: If the file cannot be read, has no triangles, or if they do not enclose a
            volume.
    """
    mesh = _read(path)
    if not mesh.is_watertight:
        raise InputError(str(path), "is not closed: a solid without holes is needed")
    if not mesh.is_winding_consistent:
        raise InputError(str(path), "has neighbouring triangles that face opposite sides")
    solid = TriangleMesh(_METRES[unit] * np.asarray(mesh.vertices), np.asarray(mesh.faces))
    if abs(solid.volume) <= _FLAT_VOLUME * np.ptp(solid.vertices, axis=0).max() ** 3:
        raise InputError(str(path), "encloses no volume")
    return solid if solid.volume > 0.0 else TriangleMesh(solid.vertices, solid.faces[:, ::-1])


def load_triangles(path: Path, unit: Literal["mm", "m"]) -> TriangleMesh:
    """Read triangles, which need not enclose anything, from an STL, PLY or OBJ file.

    Corners at the same place become one vertex; triangles without area are left out.

    Args:
        path: The file.
        unit: What one unit of the file is; mesh files do not say.

    Raises:
        InputError: If the file cannot be read, has no triangles with an area, or if neighbouring
            triangles face opposite sides.
    """
    mesh = _read(path)
    a, b, c = np.moveaxis(np.asarray(mesh.triangles), 1, 0)
    longest = np.linalg.norm(np.stack([b - a, c - b, a - c]), axis=2).max(axis=0)
    twice_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    flat = twice_area <= _FLAT_AREA * longest**2
    if flat.all():
        raise InputError(str(path), "holds no triangle with an area")
    faces = np.asarray(mesh.faces)[~flat]
    directed = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    if len(np.unique(directed, axis=0)) < len(directed):
        raise InputError(str(path), "has neighbouring triangles that face opposite sides")
    return TriangleMesh(_METRES[unit] * np.asarray(mesh.vertices), faces)


def _read(path: Path) -> trimesh.Trimesh:
    """Return what a file holds, in its own unit, corners at the same place merged."""
    if path.suffix.lower() not in _SUFFIXES:
        raise InputError(str(path), f"must be one of {', '.join(_SUFFIXES)}")
    try:
        with path.open("rb") as file:
            mesh = trimesh.load_mesh(file, file_type=path.suffix.lower()[1:])
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error
    # trimesh lets whatever its parsers stumble over through: ValueError, KeyError, struct.error ...
    except Exception as error:
        raise InputError(str(path), f"is not a mesh: {error}") from error
    if mesh.is_empty:
        raise InputError(str(path), "holds no triangles")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(str(path), "has corners that are not finite")
    return mesh


def surface_samples(mesh: TriangleMesh, spacing: float) -> Array:
    """Return points that cover the surface of a mesh, the same ones every time.

    Triangles are halved across their longest edge until no point of any is further than ``spacing``
    from its nearest corner (see `_covering_radius`); the samples are all their corners. Hence every
    point of the surface has a sample within ``spacing``, and a clearance measured at the samples
    is at most ``spacing`` larger than that of the whole surface.

    Args:
        mesh: The surface.
        spacing: Largest distance in [m] of a point of the surface from its nearest sample.

    Returns:
        The samples in [m], in lexicographic order, shape (k, 3).

    Raises:
        ValueError: If ``spacing`` is not positive.
    """
    if not spacing > 0.0:
        raise ValueError(f"spacing: must be positive, got {spacing:g}")
    triangles = mesh.triangles
    samples = []
    while len(triangles):
        covered = _covering_radius(triangles) <= spacing
        samples.append(triangles[covered].reshape(-1, 3))
        triangles = _halved(triangles[~covered])
    if not samples:
        return np.empty((0, 3))
    # neighbours halve a shared edge at bitwise the same point, so equal corners are found exactly
    corners = np.concatenate(samples)
    corners = corners[np.lexsort(corners.T[::-1])]  # np.unique along an axis is far slower
    return corners[np.append(True, (corners[1:] != corners[:-1]).any(axis=1))]


def _edges(triangles: Array) -> Array:
    """Return the lengths of the edges opposite each corner, shape (m, 3)."""
    return np.linalg.norm(np.roll(triangles, -1, axis=1) - np.roll(triangles, 1, axis=1), axis=2)


def _covering_radius(triangles: Array) -> Array:
    """Return the largest distance of a point of each triangle from its nearest corner, shape (m,).

    In an acute triangle that point is the centre of the circumscribed circle. In an obtuse one the
    circle's centre lies outside, and the point is where the perpendicular bisector of a short edge
    meets the longest: at c / (2 cos B) from B, and at b / (2 cos C) from C. The first is at most
    a / sqrt(3), the second at most a / 2, which holds where a sliver leaves no digits.
    """
    c, b, a = np.sort(_edges(triangles), axis=1).T
    ac_cos_B = 0.5 * (a * a + c * c - b * b)
    ab_cos_C = 0.5 * (a * a + b * b - c * c)
    bc_cos_A = 0.5 * (b * b + c * c - a * a)
    with np.errstate(divide="ignore", invalid="ignore"):
        acute = a * b * c / (2.0 * np.sqrt((b * c) ** 2 - bc_cos_A**2))
        obtuse = 0.5 * a * np.fmax(c * c / ac_cos_B, b * b / ab_cos_C)
    # fmin passes over nan
    return np.where(bc_cos_A > 0.0, np.fmin(acute, a / np.sqrt(3.0)), np.fmin(obtuse, 0.5 * a))


def _halved(triangles: Array) -> Array:
    """Return two triangles for each, split at the middle of its longest edge, shape (2 m, 3, 3)."""
    longest = np.argmax(_edges(triangles), axis=1)
    order = (longest[:, None] + np.arange(3)) % 3
    apex, left, right = np.moveaxis(np.take_along_axis(triangles, order[..., None], 1), 1, 0)
    middle = 0.5 * (left + right)
    return np.concatenate(
        [np.stack([apex, left, middle], axis=1), np.stack([apex, middle, right], axis=1)]
    )
