"""Whether a surface and the solid behind it can be one part: sizes, places and their outsides."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh, winding_number
from opl.geometry.passes import MachinedSurface, bounding_box, longest_side

SMALLEST, LARGEST = 1e-3, 5.0  # [m] size of a part
_FACTOR = 50.0  # between surface and solid; units differ by 1000 or 25.4

# places looked at, and how far in front of the surface and behind it [m]
_LOOKS = 24
_DEPTH = 1e-3

_REACH = 2e-3  # [m] within which triangles of the solid are sought around a cutter point
_AT_ONCE = 1 << 17  # pairs of a cutter point and a triangle

# the surface is sampled about this often across its longest side, to choose the places from
_SAMPLES = 12


class SizeError(ValueError):
    """A surface or a solid has a size or a place that it cannot have.

    Attributes:
        of: Which of them is to blame.
    """

    def __init__(self, of: Literal["part", "surface"], message: str) -> None:
        super().__init__(message)
        self.of = of


def check_sizes(surface: MachinedSurface, part: TriangleMesh) -> None:
    """Refuse sizes that no part has, and a surface that is not on its solid.

    Raises:
        SizeError: If something is too small, too large, or elsewhere.
    """
    own = bounding_box(surface)
    solid = np.array([part.vertices.min(axis=0), part.vertices.max(axis=0)])
    boxes: dict[Literal["part", "surface"], Array] = {"part": solid, "surface": own}
    for of, box in boxes.items():
        size = _size(box)
        if not SMALLEST <= size <= LARGEST:
            raise SizeError(
                of,
                f"is {1e3 * size:g} mm long; a part is {1e3 * SMALLEST:g} to "
                f"{1e3 * LARGEST:g} mm; is the unit right?",
            )
    ratio = _size(own) / _size(solid)
    if not 1.0 / _FACTOR <= ratio <= _FACTOR:
        raise SizeError(
            "surface",
            f"is {1e3 * _size(own):g} mm long, the solid in the mesh "
            f"{1e3 * _size(solid):g} mm; is the unit of one of them wrong?",
        )
    gap = np.maximum(own[0] - solid[1], solid[0] - own[1]).max()
    if gap > 0.05 * _size(solid):
        raise SizeError(
            "surface",
            f"lies {1e3 * gap:.4g} mm away from the solid in the mesh; both must be in "
            "the workpiece frame",
        )


def facing_inward(surface: MachinedSurface, part: TriangleMesh) -> float:
    """Return the part of a surface whose normals point into the solid, 0 to 1.

    Places where the solid lies on both sides of the surface or on neither do not count: it is
    thinner there than the looks are deep, or stands off the surface.
    """
    samples = surface.area_samples(longest_side(surface) / _SAMPLES)
    some = np.linspace(0, len(samples.points) - 1, _LOOKS).astype(int)
    points, normals = samples.points[some], samples.normals[some]
    ahead, behind = (
        np.array([winding_number(part, p) for p in points + side * _DEPTH * normals]) > 0.5
        for side in (1.0, -1.0)
    )
    decided = np.count_nonzero(ahead != behind)
    return np.count_nonzero(ahead & ~behind) / decided if decided else 0.0


def heights_of_solid(Ts_workpiece_cutter: Array, part: TriangleMesh) -> Array:
    """Return how far off cutter points the nearest triangles of the solid lie.

    Args:
        Ts_workpiece_cutter: The cutter frames, shape (n, 4, 4).
        part: The solid.

    Returns:
        In [m], negative where they lie below the surface, -inf where there are none within 2 mm,
        shape (n,).
    """
    triangles = part.triangles
    low, high = triangles.min(axis=1).T - _REACH, triangles.max(axis=1).T + _REACH
    heights = np.full(len(Ts_workpiece_cutter), -np.inf)
    at_once = max(1, _AT_ONCE // max(len(triangles), 1))
    for first in range(0, len(heights), at_once):
        Ts = Ts_workpiece_cutter[first : first + at_once]
        near = np.ones((len(Ts), len(triangles)), dtype=bool)
        for k in range(3):
            near &= (low[k] <= Ts[:, k, 3, None]) & (high[k] >= Ts[:, k, 3, None])
        point, triangle = np.nonzero(near)
        places, of = _nearest_to_origin(triangles[triangle] - Ts[point, None, :3, 3])
        away = np.linalg.norm(places, axis=1)
        order = np.lexsort((away, point[of]))  # of each point, the nearest first
        own, begun = np.unique(point[of][order], return_index=True)
        nearest = order[begun]
        found = np.copysign(away[nearest], (places[nearest] * Ts[own, :3, 2]).sum(axis=1))
        heights[first + own] = np.where(away[nearest] < _REACH, found, -np.inf)
    return heights


def _nearest_to_origin(triangles: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return points of triangles, shape (m, 3, 3), one of each nearest to the origin.

    That of each side, and where a triangle is right below or above the origin that of its inside.

    Returns:
        They, shape (k, 3), and which triangles they are of, shape (k,).
    """
    sides = np.roll(triangles, -1, axis=1) - triangles
    squares = np.maximum(np.square(sides).sum(axis=2), np.finfo(float).tiny)
    share = np.clip(-(triangles * sides).sum(axis=2) / squares, 0.0, 1.0)
    on_sides = triangles + share[..., None] * sides
    normals = np.cross(sides[:, 0], sides[:, 1])
    flat = np.flatnonzero(np.square(normals).sum(axis=1) > 0.0)
    along = (triangles[flat, 0] * normals[flat]).sum(axis=1)
    feet = (along / np.square(normals[flat]).sum(axis=1))[:, None] * normals[flat]
    left_of = np.cross(sides[flat], feet[:, None] - triangles[flat]) @ normals[flat, :, None]
    inside = (left_of[..., 0] >= 0.0).all(axis=1)
    of = np.concatenate([np.repeat(np.arange(len(triangles)), 3), flat[inside]])
    return np.concatenate([on_sides.reshape(-1, 3), feet[inside]]), of


def _size(box: Array) -> float:
    return float(np.ptp(box, axis=0).max())
