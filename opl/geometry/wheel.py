"""The belt wheel: where a part can touch it, and how far a point is from it.

Contact frame 0 sits in the middle of the wheel's width: z points into the wheel (from its front
towards its axis), x along its axle, y tangent to the rim. The contact frame is frame 0 moved to the
contact position t, which keeps the paper's belt unit everywhere: mm of slide on the flat, degrees
of roll about an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array, read_only

MM_PER_M = 1000.0


@dataclass(frozen=True)
class ContactWheel:
    """A cylinder that carries the belt, as calibrated in the robot's base frame.

    Attributes:
        width: Width of the flat in [m].
        radius: Radius with the belt on, in [m].
        max_roll: Largest roll about either edge in [rad].
        T_base_contact0: Pose of contact frame 0, shape (4, 4).
    """

    width: float
    radius: float
    max_roll: float
    T_base_contact0: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_contact0", read_only(self.T_base_contact0))

    @property
    def flat_end(self) -> float:
        """Contact position where the flat ends and the right edge begins, w/2 in belt units."""
        return self.width * MM_PER_M / 2.0

    @property
    def last_position(self) -> float:
        """Largest contact position, w/2 + D in belt units."""
        return self.flat_end + float(np.rad2deg(self.max_roll))

    def positions(self, count: int) -> Array:
        """Return ``count`` contact positions, evenly from -w/2-D to w/2+D, shape (count,)."""
        return np.linspace(-self.last_position, self.last_position, count)

    def T_contact0_contact(self, t: Array | float) -> Array:
        """Return the contact frame at contact position t (equations 6 to 13 of the paper).

        On the flat the frame slides by -t along x; past +-w/2 it rolls about the edge that it has
        reached, so the frame is continuous in t. Shape (...) gives (..., 4, 4).
        """
        t = np.asarray(t, dtype=float)
        slide = np.clip(t, -self.flat_end, self.flat_end)
        roll = np.deg2rad(t - slide)
        T = np.zeros((*t.shape, 4, 4))
        T[..., 0, 0] = T[..., 2, 2] = np.cos(roll)
        T[..., 0, 2] = np.sin(roll)
        T[..., 2, 0] = -np.sin(roll)
        T[..., 1, 1] = T[..., 3, 3] = 1.0
        T[..., 0, 3] = -slide / MM_PER_M
        return T

    def T_base_contact(self, t: Array | float) -> Array:
        """Return the contact frame at contact position t in the base frame, shape (..., 4, 4)."""
        return self.T_base_contact0 @ self.T_contact0_contact(t)

    def signed_distance(self, p_contact0: Array) -> Array:
        """Return the signed distance of points in contact frame 0, shape (..., 3), to the wheel.

        In [m], negative inside; exact for the finite cylinder of this width and radius.
        """
        beside = np.abs(p_contact0[..., 0]) - self.width / 2.0
        beyond = np.hypot(p_contact0[..., 1], p_contact0[..., 2] - self.radius) - self.radius
        outside = np.hypot(np.maximum(beside, 0.0), np.maximum(beyond, 0.0))
        return outside + np.minimum(np.maximum(beside, beyond), 0.0)
