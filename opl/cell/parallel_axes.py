"""Closed form for six-axis arms whose axes 2, 3 and 4 are parallel, as Universal Robots has them.

The arm, in the angles theta1 to theta6 of its drawing (offsets and signs of the maker come last).
With all of them zero it stands straight up, and the flange faces left.

    axes 5 and 6  o--  c5 to the flange, to the left along axis 6 (y); axis 5 is along z
    axis 4 (y)    o  c4 below where axes 5 and 6 meet
    axis 3 (y)    o  c3 below axis 4
    axis 2 (y)    o  c2 below axis 3; c1 above the base frame and a1 ahead of axis 1
    axis 1 (z)    |  b is how far axis 5 lies to the left of the plane of axis 1

So, with w where axes 5 and 6 meet,

    R_base_flange = Rz(theta1) Ry(theta2 + theta3 + theta4) Rz(theta5) Ry(theta6) Rx(-pi/2),
    w = p_base_flange - c5 z_flange.

That w lies b to the left of axis 1 fixes theta1; how far z_flange leaves the plane of the three
parallel axes fixes theta5, and its direction in that plane how the wrist is tilted. What is left is
the triangle of axes 2, 3 and 4. Two answers each at shoulder, wrist and elbow make eight
configurations. The derivation is our own; EAIK is the second opinion of the tests.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.triangle import bend_to, heading_to
from opl.geometry.frames import Array

# Below this sine of theta5, axis 6 is parallel to axes 2, 3 and 4. Taking it for parallel there
# turns the flange by no more than this in [rad]; above it, round-off leaves the tilt of the wrist
# uncertain by 1e-7 rad at most, which only an arm in line to less than that would miss.
_WRIST_TOLERANCE = 1e-9


@dataclass(frozen=True)
class ParallelAxesArm:
    """The geometry of a six-axis arm with three parallel axes in the middle.

    Attributes:
        a1: From axis 1 to axis 2, ahead, in [m].
        b: From the plane of axis 1 to axis 5, to the left, in [m].
        c1: From the base frame up to axis 2 in [m].
        c2: From axis 2 to axis 3 in [m].
        c3: From axis 3 to axis 4 in [m].
        c4: From axis 4 to where axes 5 and 6 meet, along axis 5, in [m].
        c5: From there to the flange face, along axis 6, in [m].
        offsets: Zero of each joint in [rad], six.
        signs: 1, or -1 where a joint counts against the drawing: q = (theta + offset) * sign, six.
    """

    a1: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    c5: float
    offsets: tuple[float, ...]
    signs: tuple[int, ...]

    @property
    def reach(self) -> float:
        """Farthest that the meeting of axes 5 and 6 can be from axis 1 in [m]."""
        return float(np.hypot(self.a1 + self.c2 + self.c3 + self.c4, self.b))

    def angles(self, x: Array, y: Array, z: Array, p: Array, near: Array) -> tuple[Array, ...]:
        """Return theta1 to theta6 that put the flange at poses.

        Args:
            x: Axes of the flange in the base frame, shape (3, n).
            y: As x.
            z: As x.
            p: Its origins in [m], shape (3, n).
            near: Angles of a configuration nearby in [rad], shape (6, n): theta6 where axis 6 is
                parallel to axes 2 to 4, which then share what the pose leaves free.

        Returns:
            Six arrays that broadcast to (2 flip, 2 back, 2 elbow, n), in [rad]; NaN out of reach.
        """
        w = p - self.c5 * z
        theta1, ahead = heading_to(w, self.b)
        cos1, sin1 = np.cos(theta1), np.sin(theta1)

        def in_plane(v: Array) -> Array:
            return np.asarray(cos1 * v[0] + sin1 * v[1])  # along the heading of the arm

        # z_flange is -sin5 e1 + cos5 y, with e1 = (cos tilt, -sin tilt) ahead and up
        z_ahead, z_up, z_left = in_plane(z), z[2], cos1 * z[1] - sin1 * z[0]
        sin5 = np.hypot(z_ahead, z_up)
        straight = sin5 < _WRIST_TOLERANCE
        length = np.where(straight, 1.0, sin5)
        flip = np.array([1.0, -1.0])[:, None, None, None]
        theta5 = flip * np.arctan2(np.where(straight, 0.0, sin5), z_left)
        cos_tilt, sin_tilt = -flip * z_ahead / length, flip * z_up / length
        # where z_flange leaves the tilt open: e3, along the last link, is -sin6 x - cos6 y
        e3 = -np.sin(near[5]) * x - np.cos(near[5]) * y
        cos_tilt = np.where(straight, e3[2], cos_tilt)
        sin_tilt = np.where(straight, in_plane(e3), sin_tilt)
        # theta6 is measured against that e3: near the straight wrist the tilt is hardly known, and
        # their sum comes out right only if both rest on the same
        sin6 = -(sin_tilt * in_plane(x) + cos_tilt * x[2])
        cos6 = -(sin_tilt * in_plane(y) + cos_tilt * y[2])
        forward = ahead - self.a1 - self.c4 * sin_tilt
        up = w[2] - self.c1 - self.c4 * cos_tilt
        theta2, theta3 = bend_to(forward, up, self.c2, self.c3)
        theta4 = np.arctan2(sin_tilt, cos_tilt) - theta2 - theta3
        return theta1, theta2, theta3, theta4, theta5, np.arctan2(sin6, cos6)

    def margins(self, theta: Array) -> Array:
        """Return the figures of `singularity_margins` for angles in [rad], shape (..., 6)."""
        tilt = np.cumsum(theta[..., 1:4], axis=-1)
        ahead = self.a1 + np.sin(tilt) @ np.array([self.c2, self.c3, self.c4])
        return np.stack(
            [
                np.abs(np.sin(theta[..., 4])),
                np.abs(np.sin(theta[..., 2])),
                np.abs(ahead) / (self.a1 + self.c2 + self.c3 + self.c4),
            ],
            axis=-1,
        )
