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

from opl.cell.many_poses import POSES, either, principal_angle, root, solve_poses
from opl.files.kernels import kernel, prange
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

    def solutions(self, Ts_base_flange: Array, near: Array) -> Array:
        """Return all configurations that put the flange at poses, as `solve_poses` does.

        Args:
            Ts_base_flange: Shape (n, 4, 4).
            near: Configurations nearby in [rad], shape (n, 6): joint 4 of the straight wrist.
        """
        forearm, forearm_tilt = np.hypot(self.a2, self.c3), np.arctan2(self.a2, self.c3)
        sizes = np.array([self.a1, self.b, self.c1, self.c2, self.c4, forearm, forearm_tilt])
        theta4_free = near[:, 3] * self.signs[3] - self.offsets[3]
        kernels = _solve.plain, _solve_few, _solve_all
        return solve_poses(*kernels, Ts_base_flange, theta4_free, sizes, self.offsets, self.signs)

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


@kernel()
def _solve(  # type: ignore[no-untyped-def]
    x0, y0, z0, p0, x1, y1, z1, p1, x2, y2, z2, p2, theta4_free, sizes, offsets, signs, q
):
    """Set all configurations of a pose, (8, 6), or of n poses given as arrays, (8, 6, n).

    Columns and origin of the pose are given row by row.

    The position of the wrist centre fixes theta1 to theta3. Along e1, e2, e3, the columns of
    Rz(theta1) Ry(theta2 + theta3), the flange axis z has the coordinates (cos theta4 sin theta5,
    sin theta4 sin theta5, cos theta5). Axis 5 points along -sin theta4 e1 + cos theta4 e2, and its
    coordinates along x and y are sin theta6 and cos theta6. Theta6 is measured against that axis 5,
    not found from z: near the straight wrist theta4 is hardly known, and their sum comes out right
    only if both rest on the same theta4.

    Turning axis 4 by half a turn and bending the wrist to the other side gives the same axes. A
    straight wrist has no other side; both slots then keep ``theta4_free``.
    """
    a1, b, c1, c2, c4 = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    forearm, forearm_tilt = sizes[5], sizes[6]
    w0, w1, w2 = p0 - c4 * z0, p1 - c4 * z1, p2 - c4 * z2
    in_front = root(w0 * w0 + w1 * w1 - b * b, b * b)
    heading = np.arctan2(w1, w0)
    cos4_free, sin4_free = np.cos(theta4_free), np.sin(theta4_free)
    for back in range(2):
        ahead = in_front * (1.0 - 2.0 * back)
        theta1 = heading - np.arctan2(b, ahead)
        forward, up = ahead - a1, w2 - c1
        # law of cosines; the bend is the angle between upper arm and forearm, 0 when in line
        apart = forward * forward + up * up
        cos_bend = (apart - c2 * c2 - forearm * forearm) / (2.0 * c2 * forearm)
        sin_bend = root(1.0 - cos_bend * cos_bend, 2.0)
        bend = np.arctan2(sin_bend, cos_bend)
        # the end stands off the upper arm by the angle that the bent forearm subtends
        to_end = np.arctan2(forward, up)
        subtended = np.arctan2(forearm * sin_bend, c2 + forearm * cos_bend)
        cos1, sin1 = np.cos(theta1), np.sin(theta1)
        # along the heading of the arm, and to the left of it
        x_ahead, y_ahead = cos1 * x0 + sin1 * x1, cos1 * y0 + sin1 * y1
        z_ahead = cos1 * z0 + sin1 * z1
        x_left, y_left = cos1 * x1 - sin1 * x0, cos1 * y1 - sin1 * y0
        z_left = cos1 * z1 - sin1 * z0
        turned1 = principal_angle((theta1 + offsets[0]) * signs[0])
        for elbow in range(2):
            side = 1.0 - 2.0 * elbow
            theta2 = to_end - side * subtended
            theta3 = side * bend - forearm_tilt
            tilt = theta2 + theta3
            cos_tilt, sin_tilt = np.cos(tilt), np.sin(tilt)
            z_along = cos_tilt * z_ahead - sin_tilt * z2
            sin5 = np.sqrt(z_along * z_along + z_left * z_left)
            straight = sin5 < _WRIST_TOLERANCE
            sin5 = either(straight, 0.0, sin5)
            length = either(straight, 1.0, sin5)
            cos4 = either(straight, cos4_free, z_along / length)
            sin4 = either(straight, sin4_free, z_left / length)
            sin6 = cos4 * x_left - sin4 * (cos_tilt * x_ahead - sin_tilt * x2)
            cos6 = cos4 * y_left - sin4 * (cos_tilt * y_ahead - sin_tilt * y2)
            theta4, theta6 = np.arctan2(sin4, cos4), np.arctan2(sin6, cos6)
            theta5 = np.arctan2(sin5, sin_tilt * z_ahead + cos_tilt * z2)
            half_turn = either(straight, 0.0, np.pi)
            # an elbow out of reach takes the configuration with it
            missing = np.isnan(theta2)
            turned2 = principal_angle((theta2 + offsets[1]) * signs[1])
            turned3 = principal_angle((theta3 + offsets[2]) * signs[2])
            for flip in range(2):
                slot = 4 * flip + 2 * back + elbow
                turned4 = principal_angle((theta4 + flip * half_turn + offsets[3]) * signs[3])
                turned5 = principal_angle(((1.0 - 2.0 * flip) * theta5 + offsets[4]) * signs[4])
                turned6 = principal_angle((theta6 + flip * half_turn + offsets[5]) * signs[5])
                q[slot, 0] = either(missing, np.nan, turned1)
                q[slot, 1] = either(missing, np.nan, turned2)
                q[slot, 2] = either(missing, np.nan, turned3)
                q[slot, 3] = either(missing, np.nan, turned4)
                q[slot, 4] = either(missing, np.nan, turned5)
                q[slot, 5] = either(missing, np.nan, turned6)


@kernel()
def _solve_one(T, theta4_free, sizes, offsets, signs, q):  # type: ignore[no-untyped-def]
    """Set all configurations of a pose."""
    _solve(
        T[0, 0], T[0, 1], T[0, 2], T[0, 3], T[1, 0], T[1, 1], T[1, 2], T[1, 3],
        T[2, 0], T[2, 1], T[2, 2], T[2, 3], theta4_free, sizes, offsets, signs, q,
    )  # fmt: skip


@kernel(POSES, early=True)
def _solve_few(Ts, theta4_free, sizes, offsets, signs, q):  # type: ignore[no-untyped-def]
    for n in range(len(Ts)):
        _solve_one(Ts[n], theta4_free[n], sizes, offsets, signs, q[n])


@kernel(POSES, threads=True, early=True)
def _solve_all(Ts, theta4_free, sizes, offsets, signs, q):  # type: ignore[no-untyped-def]
    for n in prange(len(Ts)):
        _solve_one(Ts[n], theta4_free[n], sizes, offsets, signs, q[n])
