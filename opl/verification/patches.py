"""The surface of the part in patches, and how near each can be to the wheel, a plain cylinder.

The cylinder is written out from its axis, apart from `ContactWheel`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array, transform

MOST = 50  # triangles in a patch


@dataclass(frozen=True, eq=False)
class Drum:
    """A cylinder about z of its own frame.

    Attributes:
        T_base_drum: Its pose, the origin in the middle, shape (4, 4).
        radius: In [m].
        width: In [m].
    """

    T_base_drum: Array
    radius: float
    width: float

    def distances(self, p_base: Array) -> tuple[Array, Array]:
        """Return signed distances of points in [m] and the directions in which they grow.

        The points are in the base frame in [m], shape (n, 3).

        Returns:
            Distances, negative inside, shape (n,); unit vectors, shape (n, 3).
        """
        axis = self.T_base_drum[:3, 2]
        from_middle = p_base - self.T_base_drum[:3, 3]
        along = from_middle @ axis
        radial = from_middle - along[:, None] * axis
        away = np.linalg.norm(radial, axis=1)
        beside, beyond = np.abs(along) - self.width / 2.0, away - self.radius
        # parts of the shortest motion out: along the axis, and away from it
        sideways, outward = np.maximum(beside, 0.0), np.maximum(beyond, 0.0)
        inside = (beside <= 0.0) & (beyond <= 0.0)
        sideways = np.where(inside, beside > beyond, sideways)
        outward = np.where(inside, beside <= beyond, outward)
        norm = np.hypot(sideways, outward)
        distance = np.where(inside, np.maximum(beside, beyond), norm)
        side = np.where(along < 0.0, -1.0, 1.0)
        direction = (sideways / norm * side)[:, None] * axis
        direction = direction + (outward / norm / np.maximum(away, 1e-12))[:, None] * radial
        return distance, direction


@dataclass(frozen=True, eq=False)
class Patches:
    """Triangles that lie together.

    Attributes:
        triangles: Corners of those of each patch in [m], p arrays of shape (m, 3, 3).
        axes: Along the edges of a box around each patch, thin where the patch is flat: unit
            vectors as columns, shape (p, 3, 3).
        middle: Middle of the box in [m], shape (p, 3).
        half: Half its edges in [m], shape (p, 3).
        corners: Those of its triangles, each once, from the middle, p arrays of shape (c, 3).
    """

    triangles: tuple[Array, ...]
    axes: Array
    middle: Array
    half: Array
    corners: tuple[Array, ...]

    @classmethod
    def of(cls, triangles: Array) -> Patches:
        """Return the patches of triangles, shape (m, 3, 3)."""
        patches = tuple(_halved(triangles))
        corners = [np.unique(patch.reshape(-1, 3), axis=0) for patch in patches]
        spreads = [one - one.mean(axis=0) for one in corners]
        _, axes = np.linalg.eigh([spread.T @ spread for spread in spreads])
        along = [one @ its for one, its in zip(corners, axes, strict=True)]
        low = np.array([one.min(axis=0) for one in along])
        high = np.array([one.max(axis=0) for one in along])
        middle = np.einsum("pik,pk->pi", axes, (low + high) / 2.0)
        around = tuple(one - its for one, its in zip(corners, middle, strict=True))
        return cls(patches, axes, middle, (high - low) / 2.0, around)

    def from_box(self, low: Array, high: Array, T_base_workpiece: Array) -> Array:
        """Return lower bounds of the distance of patches from a box along the base frame, (p,).

        In [m], 0 where they may touch it. The box is given by its lowest and highest coordinates,
        shape (3,), the pose of the part has shape (4, 4).
        """
        middle = transform(T_base_workpiece, self.middle)
        along = np.abs(T_base_workpiece[:3, :3] @ self.axes)
        reach = np.einsum("pik,pk->pi", along, self.half)
        between = np.maximum(np.maximum(low - middle, middle - high) - reach, 0.0)
        return np.asarray(np.linalg.norm(between, axis=1))

    def beside(self, drum: Drum, T_base_workpiece: Array) -> Beside:
        """Return how near the patches can be to the wheel in a pose of the part, shape (4, 4)."""
        distance, outward = drum.distances(transform(T_base_workpiece, self.middle))
        return Beside(self, distance, outward @ T_base_workpiece[:3, :3])


@dataclass(frozen=True, eq=False)
class Beside:
    """Lower bounds of the distance of patches from the wheel in [m].

    The signed distance to a cylinder is convex: nothing of a patch is nearer than the plane that
    touches it in the middle says. That bounds Bullet's penetration depth as well, the shortest
    motion out of the wheel: one is along the normal of that plane.

    Attributes:
        patches: The patches.
        distance: Of the middle of each in [m], shape (p,).
        outward: In which direction it grows, in the workpiece frame, shape (p, 3).
    """

    patches: Patches
    distance: Array
    outward: Array

    def of_boxes(self) -> Array:
        """Return a bound of each patch by the box around it, shape (p,)."""
        along = np.abs(np.einsum("pi,pik->pk", self.outward, self.patches.axes))
        return np.asarray(self.distance - (along * self.patches.half).sum(axis=1))

    def of_corners(self, k: int) -> float:
        """Return a bound of one patch by its triangles, no less than that of its box."""
        return float(self.distance[k] + (self.patches.corners[k] @ self.outward[k]).min())


def _halved(triangles: Array) -> Iterator[Array]:
    """Halve triangles across their longest side until there are few enough."""
    if len(triangles) <= MOST:
        yield triangles
        return
    middle = triangles.mean(axis=1)
    order = middle[:, np.ptp(middle, axis=0).argmax()].argsort(kind="stable")
    for half in np.array_split(order, 2):
        yield from _halved(triangles[half])
