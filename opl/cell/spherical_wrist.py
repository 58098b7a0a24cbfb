"""Closed form for six-axis arms with a spherical wrist.

The arm, in the angles theta1 to theta6 of its drawing (offsets and signs of the maker come last).
With all of them zero it stands straight up: links along z, every joint axis along y or z.

    flange        |  c4 above the wrist centre
    wrist centre  o  axes 4 (z), 5 (y) and 6 (z) meet; c3 above axis 3 and a2 ahead of it
    axis 3 (y)    o  c2 above axis 2
    axis 2 (y)    o  c1 above the base frame and a1 ahead of axis 1
    axis 1 (z)    |  b is how far the wrist centre lies to the left of the plane of axis 1

So, with p the wrist centre,

    R_base_flange = Rz(theta1) Ry(theta2 + theta3) Rz(theta4) Ry(theta5) Rz(theta6),
    p = p_base_flange - c4 z_flange.

The position of p fixes theta1 to theta3 in a triangle; the orientation left over fixes theta4 to
theta6. Two answers each at shoulder, elbow and wrist make eight configurations, in slots
``4 * flip + 2 * back + elbow`` that keep their meaning along a path. The parameters are those of
Brandstoetter, Angerer and Hofbaur (2014); the derivation beside the code is our own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.triangle import bend_to, heading_to
from opl.geometry.frames import Array

# Below this sine of theta5, axes 4 and 6 are one axis. Taking the wrist for straight there turns
# the flange by no more than this in [rad]; just above it theta4 still stands out of round-off.
_WRIST_TOLERANCE = 1e-12


@dataclass(frozen=True)
class SphericalWristArm:
    """The geometry of a six-axis arm whose last three axes meet in the wrist centre.

    Attributes:
        a1: From axis 1 to axis 2, ahead, in [m].
        a2: From axis 3 to the forearm axis, ahead, in [m]; negative where the forearm, once
            level, lies above axis 3.
        b: From the plane of axis 1 to the wrist centre, to the left, in [m].
        c1: From the base frame up to axis 2 in [m].
        c2: From axis 2 to axis 3 in [m].
        c3: From axis 3 to the wrist centre, along the forearm axis, in [m].
        c4: From the wrist centre to the flange face in [m].
        offsets: Zero of each joint in [rad], six.
        signs: 1, or -1 where a joint counts against the drawing: q = (theta + offset) * sign, six.
    """

    a1: float
    a2: float
    b: float
    c1: float
    c2: float
    c3: float
    c4: float
    offsets: tuple[float, ...]
    signs: tuple[int, ...]

    @property
    def reach(self) -> float:
        """Farthest that the wrist centre can be from axis 1 in [m]."""
        return float(np.hypot(self.a1 + self.c2 + np.hypot(self.a2, self.c3), self.b))

    def angles(self, x: Array, y: Array, z: Array, p: Array, near: Array) -> tuple[Array, ...]:
        """Return theta1 to theta6 that put the flange at poses.

        Args:
            x: Axes of the flange in the base frame, shape (3, n).
            y: As x.
            z: As x.
            p: Its origins in [m], shape (3, n).
            near: Angles of a configuration nearby in [rad], shape (6, n): theta4 of the straight
                wrist.

        Returns:
            Six arrays that broadcast to (2 flip, 2 back, 2 elbow, n), in [rad]; NaN out of reach.
        """
        wrist = p - self.c4 * z
        theta1, ahead = heading_to(wrist, self.b)
        forearm, forearm_tilt = np.hypot(self.a2, self.c3), np.arctan2(self.a2, self.c3)
        theta2, bend = bend_to(ahead - self.a1, wrist[2] - self.c1, self.c2, forearm)
        theta3 = bend - forearm_tilt
        theta4, theta5, theta6, half_turn = _orientation(theta1, theta2 + theta3, x, y, z, near[3])
        return (
            theta1,
            theta2,
            theta3,
            np.stack([theta4, theta4 + half_turn]),
            np.stack([theta5, -theta5]),
            np.stack([theta6, theta6 + half_turn]),
        )

    def margins(self, theta: Array) -> Array:
        """Return the figures of `singularity_margins` for angles in [rad], shape (..., 6)."""
        forearm, bend = np.hypot(self.a2, self.c3), np.arctan2(self.a2, self.c3)
        ahead = (
            self.a1
            + self.c2 * np.sin(theta[..., 1])
            + forearm * np.sin(theta[..., 1] + theta[..., 2] + bend)
        )
        return np.stack(
            [
                np.abs(np.sin(theta[..., 4])),
                np.abs(np.sin(theta[..., 2] + bend)),
                np.abs(ahead) / (self.a1 + self.c2 + forearm),
            ],
            axis=-1,
        )


def _orientation(
    theta1: Array, tilt: Array, x: Array, y: Array, z: Array, theta4_free: Array
) -> tuple[Array, Array, Array, Array]:
    """Return theta4, theta5 and theta6 that give the flange its axes x, y, z.

    Along e1, e2, e3, the columns of Rz(theta1) Ry(tilt), the flange axis z has the coordinates
    (cos theta4 sin theta5, sin theta4 sin theta5, cos theta5). Axis 5 points along
    -sin theta4 e1 + cos theta4 e2, and its coordinates along x and y are sin theta6 and cos theta6.
    Theta6 is measured against that axis 5, not found from z: near the straight wrist theta4 is
    hardly known, and their sum comes out right only if both rest on the same theta4.

    Turning axis 4 by half a turn and bending the wrist to the other side gives the same axes. A
    straight wrist has no other side; both slots then keep theta4_free.

    Args:
        theta1: Angle of axis 1 in [rad], shape (2 back, 1, n).
        tilt: theta2 + theta3 in [rad], shape (2 back, 2 elbow, n).
        x: Axes in the base frame, shape (3, n).
        y: As x.
        z: As x.
        theta4_free: Of the straight wrist in [rad], shape (n,).

    Returns:
        theta4, theta5 >= 0, theta6, and what to add to theta4 and theta6 where theta5 turns
        negative: pi, or 0 for a straight wrist. All in [rad], shape (2 back, 2 elbow, n).
    """
    cos1, sin1, cos_tilt, sin_tilt = np.cos(theta1), np.sin(theta1), np.cos(tilt), np.sin(tilt)

    def in_plane(v: Array) -> Array:
        return np.asarray(cos1 * v[0] + sin1 * v[1])  # along the heading of the arm

    def along_e1(v: Array) -> Array:
        return np.asarray(cos_tilt * in_plane(v) - sin_tilt * v[2])

    def along_e2(v: Array) -> Array:
        return np.asarray(cos1 * v[1] - sin1 * v[0])

    def along_e3(v: Array) -> Array:
        return np.asarray(sin_tilt * in_plane(v) + cos_tilt * v[2])

    z1, z2 = along_e1(z), along_e2(z)
    sin5 = np.sqrt(z1**2 + z2**2)
    straight = sin5 < _WRIST_TOLERANCE
    sin5 = np.where(straight, 0.0, sin5)
    length = np.where(straight, 1.0, sin5)
    cos4 = np.where(straight, np.cos(theta4_free), z1 / length)
    sin4 = np.where(straight, np.sin(theta4_free), z2 / length)
    sin6 = cos4 * along_e2(x) - sin4 * along_e1(x)
    cos6 = cos4 * along_e2(y) - sin4 * along_e1(y)
    return (
        np.arctan2(sin4, cos4),
        np.arctan2(sin5, along_e3(z)),
        np.arctan2(sin6, cos6),
        np.where(straight, 0.0, np.pi),
    )
