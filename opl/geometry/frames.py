"""Poses as 4x4 matrices.

``T_a_b`` is the pose of frame b in frame a: it maps coordinates in b to coordinates in a. A stack
of poses is ``Ts_a_b``. Every function takes and returns arrays of shape (..., 4, 4), lengths in
[m].
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def read_only(values: ArrayLike, dtype: type = float) -> NDArray[Any]:
    """Return a copy of an array that cannot be written to."""
    copy: NDArray[Any] = np.array(values, dtype=dtype)
    copy.setflags(write=False)
    return copy


def in_mm(point: Array) -> str:
    """Return a point in [m], shape (3,), as messages give it."""
    x, y, z = 1e3 * point + 0.0  # no negative zero
    return f"({x:.4g}, {y:.4g}, {z:.4g}) mm"


class NotARotationError(ValueError):
    """A matrix given as a pose is too far from one.

    Args:
        distance: Largest entry of the difference to the nearest proper pose.
    """

    def __init__(self, distance: float) -> None:
        super().__init__(f"is {distance:.4g} away from a rotation")
        self.distance = distance


def inverse(T_a_b: Array) -> Array:
    """Return T_b_a, the inverse of a pose. Shape (..., 4, 4)."""
    R_b_a = np.swapaxes(T_a_b[..., :3, :3], -1, -2)
    T_b_a = np.zeros_like(T_a_b)
    T_b_a[..., :3, :3] = R_b_a
    T_b_a[..., :3, 3] = -np.einsum("...ij,...j->...i", R_b_a, T_a_b[..., :3, 3])
    T_b_a[..., 3, 3] = 1.0
    return T_b_a


def transform(T_a_b: Array, p_b: Array) -> Array:
    """Return points given in frame b, shape (..., 3), in coordinates of frame a."""
    return np.asarray(np.einsum("...ij,...j->...i", T_a_b[..., :3, :3], p_b) + T_a_b[..., :3, 3])


def pose(R: Array, p: Array) -> Array:
    """Return the pose of rotation R, shape (..., 3, 3), and origin p [m], shape (..., 3)."""
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], p.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def from_axes(z: Array, x: Array, p: Array) -> Array:
    """Return right-handed poses with axis z exact and axis x as near to ``x`` as z allows.

    Args:
        z: Axis z, need not have unit length, shape (..., 3).
        x: Wanted axis x, not parallel to z, shape (..., 3).
        p: Origins in [m], shape (..., 3).
    """
    z = z / np.linalg.norm(z, axis=-1, keepdims=True)
    x = x - np.sum(x * z, axis=-1, keepdims=True) * z
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return pose(np.stack([x, np.cross(z, x), z], axis=-1), p)


def nearest_pose(matrix: Array, tolerance: float = 0.02) -> Array:
    """Return the proper pose nearest to a rounded 4x4 matrix.

    Calibrated matrices are printed with few digits; their rotation is made proper by the polar
    decomposition (singular value decomposition).

    Args:
        matrix: A single matrix, shape (4, 4), origin in [m].
        tolerance: Largest change of an entry that is still taken for rounding.

    Raises:
        NotARotationError: If an entry would change by more than ``tolerance``, if the matrix
            mirrors, or if its last row is not (0, 0, 0, 1).
    """
    u, _, vt = np.linalg.svd(matrix[:3, :3])
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    distance = max(
        float(np.abs(matrix[:3, :3] - R).max()),
        float(np.abs(matrix[3] - [0.0, 0.0, 0.0, 1.0]).max()),
    )
    if distance > tolerance:
        raise NotARotationError(distance)
    return pose(R, matrix[:3, 3])


def rotation_angle(T_a_b: Array, T_a_c: Array) -> Array:
    """Return the angle in [rad] of the rotation between two poses, shape (...)."""
    difference = T_a_b[..., :3, :3] - T_a_c[..., :3, :3]
    # |R_b - R_c| = 2 sqrt(2) sin(angle / 2): well conditioned where arccos of the trace is not
    chord = np.linalg.norm(difference, axis=(-2, -1)) / (2.0 * np.sqrt(2.0))
    return np.asarray(2.0 * np.arcsin(np.clip(chord, 0.0, 1.0)))


def interpolate(T_a_b: Array, T_a_c: Array, fraction: Array) -> Array:
    """Return the poses between two poses as the intermediate nodes of the paper take them.

    Origin, axis z and axis x are interpolated linearly, then made orthonormal again. The fraction,
    shape (...), is 0 at T_a_b and 1 at T_a_c.
    """
    s = np.asarray(fraction)[..., None]
    z, x, p = ((1.0 - s) * T_a_b[..., :3, k] + s * T_a_c[..., :3, k] for k in (2, 0, 3))
    return from_axes(z, x, p)


def roll_pitch_yaw(T_a_b: Array) -> Array:
    """Return fixed-axis angles (Rx, Ry, Rz) in [rad], R = Rz Ry Rx, shape (..., 3).

    At Ry = +-90 degrees, Rx is 0 by choice: the two other angles turn about the same axis.
    """
    R = T_a_b[..., :3, :3]
    cos_pitch = np.hypot(R[..., 0, 0], R[..., 1, 0])
    locked = cos_pitch < 1e-9
    roll = np.where(locked, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    pitch = np.arctan2(-R[..., 2, 0], cos_pitch)
    yaw = np.where(
        locked,
        np.arctan2(-R[..., 0, 1], R[..., 1, 1]),
        np.arctan2(R[..., 1, 0], R[..., 0, 0]),
    )
    return np.stack([roll, pitch, yaw], axis=-1)


def from_roll_pitch_yaw(angles: Array, p: Array) -> Array:
    """Return the pose of angles (Rx, Ry, Rz) in [rad], R = Rz Ry Rx, and origin p in [m]."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(angles), np.sin(angles)
    R_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    R_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    R_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return pose(R_z @ R_y @ R_x, np.asarray(p))
