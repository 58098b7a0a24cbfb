"""Rotations as vectors and quaternions.

Most are SciPy's, which is loaded when one is first asked for: that takes longer than short commands
do.
"""

from __future__ import annotations

import math
from operator import itemgetter

import numpy as np

from opl.geometry.frames import Array, pose


def rotation_vector(R: Array) -> Array:
    """Return axis times angle in [rad] of rotations, shape (..., 3, 3), shape (..., 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def from_rotation_vector(turn: Array) -> Array:
    """Return the rotations of axis times angle in [rad], shape (n, 3) or (3,), as matrices."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(turn).as_matrix())


def turn_of_change(turn: Array) -> Array:
    """Return how a small change of a rotation vector turns the frame about its own axes.

    The right Jacobian of the exponential map (Solà et al., "A micro Lie theory", 2018, eq. 143).

    Args:
        turn: Axis times angle in [rad], shape (3,).

    Returns:
        Shape (3, 3).
    """
    angle = float(np.linalg.norm(turn))
    x, y, z = turn
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # (1 - cos a) / a^2 and (a - sin a) / a^3, by their series where those lose their digits
    if angle < 1e-3:
        first, second = 0.5 - angle**2 / 24.0, 1.0 / 6.0 - angle**2 / 120.0
    else:
        first = (1.0 - np.cos(angle)) / angle**2
        second = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) - first * cross + second * cross @ cross)


def quaternion(R: Array) -> Array:
    """Return the quaternion (x, y, z, w), w not negative, of a rotation of shape (3, 3)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    # four times the products of x, y, z, w with the largest of them: its sign is that of the whole
    trace = xx + yy + zz
    rows = (
        (xx, 1.0 - trace + 2.0 * xx, yx + xy, zx + xz, zy - yz),
        (yy, yx + xy, 1.0 - trace + 2.0 * yy, zy + yz, xz - zx),
        (zz, zx + xz, zy + yz, 1.0 - trace + 2.0 * zz, yx - xy),
        (trace, zy - yz, xz - zx, yx - xy, 1.0 + trace),
    )
    _, x, y, z, w = max(rows, key=itemgetter(0))
    length = math.copysign(math.sqrt(x * x + y * y + z * z + w * w), w)
    return np.array([x, y, z, w]) / length


def from_quaternion(xyzw: Array) -> Array:
    """Return the rotation of a quaternion (x, y, z, w) of any length but 0, shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat(xyzw).as_matrix())


def straight_between(T_a_start: Array, T_a_end: Array, fraction: Array) -> Array:
    """Return poses on the straight way between two: origin on a line, turned about one axis.

    Args:
        T_a_start: Pose at fraction 0, shape (4, 4), or one for each fraction, shape (n, 4, 4).
        T_a_end: Pose at fraction 1, of the same shape.
        fraction: Fractions of the way, shape (n,).

    Returns:
        Shape (n, 4, 4).
    """
    R, p = T_a_start[..., :3, :3], T_a_start[..., :3, 3]
    turn = rotation_vector(np.swapaxes(R, -1, -2) @ T_a_end[..., :3, :3])
    s = np.asarray(fraction)[:, None]
    return pose(R @ from_rotation_vector(s * turn), p + s * (T_a_end[..., :3, 3] - p))
