"""The surface of the part in patches, and how near each can be to the wheel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array, transform
from opl.verification.drum import Drum, out_of_drum

MOST = 50  # triangles in a patch


@kernel(
    "void(float64[:,::1],float64[:,::1],float64[:,:,::1],float64[:,::1],float64[:,::1],float64,"
    "float64,float64[::1],float64[:,::1],float64[::1])",
    early=True,
)
def _beside_drum(  # type: ignore[no-untyped-def]
    T, middle, axes, half, T_base_drum, radius, width, distance, outward, boxes
):
    """Do `Patches.beside` for patches whose part is at T in the base frame."""
    for k in range(len(middle)):
        p, q, r = middle[k]
        x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
        y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
        z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
        away, x, y, z = out_of_drum(x, y, z, T_base_drum, radius, width)
        distance[k] = boxes[k] = away
        for i in range(3):
            outward[k, i] = x * T[0, i] + y * T[1, i] + z * T[2, i]
        for edge in range(3):
            along = 0.0
            for i in range(3):
                along += outward[k, i] * axes[k, i, edge]
            boxes[k] -= abs(along) * half[k, edge]


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
        count = len(self.middle)
        distance, outward, boxes = np.empty(count), np.empty((count, 3)), np.empty(count)
        given = T_base_workpiece, self.middle, self.axes, self.half
        wheel = drum.T_base_drum, drum.radius, drum.width
        _beside_drum(*given, *wheel, distance, outward, boxes)
        return Beside(self, drum, drum.T_drum_base @ T_base_workpiece, distance, outward, boxes)


@dataclass(frozen=True, eq=False)
class Beside:
    """Lower bounds of the distance of patches from the wheel in [m].

    The signed distance to a cylinder is convex: nothing of a patch is nearer than the plane that
    touches it in the middle says. That bounds Bullet's penetration depth as well, the shortest
    motion out of the wheel: one is along the normal of that plane.

    Attributes:
        patches: The patches.
        drum: The wheel.
        T_drum_workpiece: Where the part is in its frame, shape (4, 4).
        distance: Of the middle of each in [m], shape (p,).
        outward: In which direction it grows, in the workpiece frame, shape (p, 3).
        boxes: Bounds by the boxes around the patches, shape (p,).
    """

    patches: Patches
    drum: Drum
    T_drum_workpiece: Array
    distance: Array
    outward: Array
    boxes: Array

    def of_corners(self, k: int) -> float:
        """Return a bound of one patch by its triangles, no less than that of its box."""
        return float(self.distance[k] + (self.patches.corners[k] @ self.outward[k]).min())

    def is_beyond(self, k: int, within: float) -> bool:
        """Return whether one patch is certainly farther away than some distance in [m]."""
        return self.drum.are_beyond(self.patches.triangles[k], self.T_drum_workpiece, within)


def _halved(triangles: Array) -> Iterator[Array]:
    """Halve triangles across their longest side until there are few enough."""
    if len(triangles) <= MOST:
        yield triangles
        return
    middle = triangles.mean(axis=1)
    order = middle[:, np.ptp(middle, axis=0).argmax()].argsort(kind="stable")
    for half in np.array_split(order, 2):
        yield from _halved(triangles[half])
