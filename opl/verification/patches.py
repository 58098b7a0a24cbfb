"""The surface of the part in patches, and how near to the wheel each can be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array, transform
from opl.verification.drum import Drum

MOST = 50  # triangles in a patch


@dataclass(frozen=True, eq=False)
class Patches:
    """Triangles that lie together.

    Attributes:
        triangles: Corners of those of each patch in [m], p arrays of shape (m, 3, 3).
        middle: Middle of the box around each patch in [m], shape (p, 3).
        half: Half its edges in [m], shape (p, 3).
    """

    triangles: tuple[Array, ...]
    middle: Array
    half: Array

    @classmethod
    def of(cls, triangles: Array) -> Patches:
        """Return the patches of triangles, shape (m, 3, 3)."""
        patches = tuple(_halved(triangles))
        low = np.array([patch.min(axis=(0, 1)) for patch in patches])
        high = np.array([patch.max(axis=(0, 1)) for patch in patches])
        return cls(patches, (low + high) / 2.0, (high - low) / 2.0)

    def least_distances(self, drum: Drum, T_base_workpiece: Array) -> Array:
        """Return a lower bound of the distance of each patch from the wheel in [m], shape (p,).

        The signed distance to a cylinder is convex: nothing of a patch is nearer than the plane
        that touches it in the middle says. That bounds Bullet's penetration depth as well, the
        shortest motion out of the wheel: one is along the normal of that plane.
        """
        distance, outward = drum.distances(transform(T_base_workpiece, self.middle))
        reach = (np.abs(outward @ T_base_workpiece[:3, :3]) * self.half).sum(axis=1)
        return np.asarray(distance - reach)


def _halved(triangles: Array) -> Iterator[Array]:
    """Halve triangles across their longest side until there are few enough."""
    if len(triangles) <= MOST:
        yield triangles
        return
    middle = triangles.mean(axis=1)
    order = middle[:, np.ptp(middle, axis=0).argmax()].argsort(kind="stable")
    for half in np.array_split(order, 2):
        yield from _halved(triangles[half])
