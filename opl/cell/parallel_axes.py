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

from opl.cell.many_poses import POSES, either, principal_angle, root, solve_poses
from opl.cell.triangle import STRETCH_TOLERANCE
from opl.files.kernels import kernel, prange
from opl.geometry.frames import Array

# Below this sine of theta5, axis 6 is parallel to axes 2, 3 and 4. Taking it for parallel there
# turns the flange by no more than this in [rad].
_WRIST_TOLERANCE = 1e-9
# What round-off adds to the pose; above the sine, it leaves the tilt of the wrist uncertain by this
# over the sine, which an arm in line has to be forgiven.
_ROUND_OFF = 4.0 * np.finfo(float).eps


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

    def solutions(self, Ts_base_flange: Array, near: Array) -> Array:
        """Return all configurations that put the flange at poses, as `solve_poses` does.

        Args:
            Ts_base_flange: Shape (n, 4, 4).
            near: Configurations nearby in [rad], shape (n, 6): joint 6 where axis 6 is parallel to
                axes 2 to 4, which then share what the pose leaves free.
        """
        sizes = np.array([self.a1, self.b, self.c1, self.c2, self.c3, self.c4, self.c5])
        theta6_free = near[:, 5] * self.signs[5] - self.offsets[5]
        kernels = _solve.plain, _solve_few, _solve_all
        return solve_poses(*kernels, Ts_base_flange, theta6_free, sizes, self.offsets, self.signs)

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


@kernel()
def _solve(  # type: ignore[no-untyped-def]
    x0, y0, z0, p0, x1, y1, z1, p1, x2, y2, z2, p2, theta6_free, sizes, offsets, signs, q
):
    """Set all configurations of a pose, (8, 6), or of n poses given as arrays, (8, 6, n).

    Columns and origin of the pose are given row by row.

    The flange axis z is -sin5 e1 + cos5 y in the plane of the arm, with e1 = (cos tilt, -sin tilt)
    ahead and up. Theta6 is measured against e3 = (sin tilt, cos tilt), along the last link: near
    the straight wrist the tilt is hardly known, and their sum comes out right only if both rest on
    the same. Where z leaves the tilt open, e3 is -sin6 x - cos6 y with ``theta6_free``.
    """
    a1, b, c1, c2, c3 = sizes[0], sizes[1], sizes[2], sizes[3], sizes[4]
    c4, c5 = sizes[5], sizes[6]
    w0, w1, w2 = p0 - c5 * z0, p1 - c5 * z1, p2 - c5 * z2
    in_front = root(w0 * w0 + w1 * w1 - b * b, b * b)
    heading = np.arctan2(w1, w0)
    cos6_free, sin6_free = np.cos(theta6_free), np.sin(theta6_free)
    for back in range(2):
        ahead = in_front * (1.0 - 2.0 * back)
        theta1 = heading - np.arctan2(b, ahead)
        cos1, sin1 = np.cos(theta1), np.sin(theta1)
        # along the heading of the arm, and to the left of it
        x_ahead, y_ahead = cos1 * x0 + sin1 * x1, cos1 * y0 + sin1 * y1
        z_ahead, z_left = cos1 * z0 + sin1 * z1, cos1 * z1 - sin1 * z0
        sin5 = np.sqrt(z_ahead * z_ahead + z2 * z2)
        straight = sin5 < _WRIST_TOLERANCE
        sin5 = either(straight, 0.0, sin5)
        length = either(straight, 1.0, sin5)
        cos_free = -sin6_free * x2 - cos6_free * y2
        sin_free = -sin6_free * x_ahead - cos6_free * y_ahead
        turned1 = principal_angle((theta1 + offsets[0]) * signs[0])
        for flip in range(2):
            side = 1.0 - 2.0 * flip
            theta5 = side * np.arctan2(sin5, z_left)
            cos_tilt = either(straight, cos_free, -side * z_ahead / length)
            sin_tilt = either(straight, sin_free, side * z2 / length)
            sin6 = -(sin_tilt * x_ahead + cos_tilt * x2)
            cos6 = -(sin_tilt * y_ahead + cos_tilt * y2)
            forward, up = ahead - a1 - c4 * sin_tilt, w2 - c1 - c4 * cos_tilt
            # law of cosines; the bend is the angle between the two long links, 0 when in line
            apart = forward * forward + up * up
            cos_bend = (apart - c2 * c2 - c3 * c3) / (2.0 * c2 * c3)
            uncertain = c4 * (c2 + c3) / (c2 * c3) * _ROUND_OFF / length
            sin_bend = root(1.0 - cos_bend * cos_bend, 2.0 + 2.0 * uncertain / STRETCH_TOLERANCE)
            bend = np.arctan2(sin_bend, cos_bend)
            to_end = np.arctan2(forward, up)
            subtended = np.arctan2(c3 * sin_bend, c2 + c3 * cos_bend)
            tilt = np.arctan2(sin_tilt, cos_tilt)
            turned5 = principal_angle((theta5 + offsets[4]) * signs[4])
            turned6 = principal_angle((np.arctan2(sin6, cos6) + offsets[5]) * signs[5])
            for elbow in range(2):
                slot, other = 4 * flip + 2 * back + elbow, 1.0 - 2.0 * elbow
                theta2, theta3 = to_end - other * subtended, other * bend
                # an elbow out of reach takes the configuration with it
                missing = np.isnan(theta2)
                turned2 = principal_angle((theta2 + offsets[1]) * signs[1])
                turned3 = principal_angle((theta3 + offsets[2]) * signs[2])
                turned4 = principal_angle((tilt - theta2 - theta3 + offsets[3]) * signs[3])
                q[slot, 0] = either(missing, np.nan, turned1)
                q[slot, 1] = either(missing, np.nan, turned2)
                q[slot, 2] = either(missing, np.nan, turned3)
                q[slot, 3] = either(missing, np.nan, turned4)
                q[slot, 4] = either(missing, np.nan, turned5)
                q[slot, 5] = either(missing, np.nan, turned6)


@kernel()
def _solve_one(T, theta6_free, sizes, offsets, signs, q):  # type: ignore[no-untyped-def]
    """Set all configurations of a pose."""
    _solve(
        T[0, 0], T[0, 1], T[0, 2], T[0, 3], T[1, 0], T[1, 1], T[1, 2], T[1, 3],
        T[2, 0], T[2, 1], T[2, 2], T[2, 3], theta6_free, sizes, offsets, signs, q,
    )  # fmt: skip


@kernel(POSES)
def _solve_few(Ts, theta6_free, sizes, offsets, signs, q):  # type: ignore[no-untyped-def]
    for n in range(len(Ts)):
        _solve_one(Ts[n], theta6_free[n], sizes, offsets, signs, q[n])


@kernel(POSES, threads=True)
def _solve_all(Ts, theta6_free, sizes, offsets, signs, q):  # type: ignore[no-untyped-def]
    for n in prange(len(Ts)):
        _solve_one(Ts[n], theta6_free[n], sizes, offsets, signs, q[n])
