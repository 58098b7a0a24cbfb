"""Rotations as vectors and quaternions.

SciPy's; it is loaded when one is first asked for, since that takes longer than short commands do.
"""

from __future__ import annotations

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


def quaternion(R: Array) -> Array:
    """Return the quaternion (x, y, z, w), w not negative, of a rotation of shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_quat(canonical=True))


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
