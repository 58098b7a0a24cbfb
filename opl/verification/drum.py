"""The wheel as a plain cylinder, written out from its axis, apart from `ContactWheel`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array


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
