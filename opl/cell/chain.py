"""Flange poses of many configurations in one call.

The arithmetic is that of pinocchio, step by step and in its order of additions, so poses are the
same to the last digit: by compiled code, and by numpy until any compiled code is loaded, which
takes as long as hundreds of calls.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count

import numpy as np
from numpy.typing import NDArray

from opl.files.kernels import kernel, kernels_are_loaded
from opl.geometry.frames import Array

ANY_AXIS = 3  # a joint that turns about another axis than x, y or z of its frame
FEW = 200  # calls


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints one after the other, from a frame that does not move to one on the last of them.

    Attributes:
        Ts_before_joint: Pose of each joint at angle 0 in the frame of the one before, (j, 4, 4).
        axis: Number of the axis that each joint turns about, `ANY_AXIS` if it is none, shape (j,).
        directions: Unit axis of each joint in its own frame, shape (j, 3).
        T_world_base: The frame that does not move, shape (4, 4).
        T_joint_flange: The one on the last joint, shape (4, 4).
    """

    Ts_before_joint: Array
    axis: NDArray[np.int64]
    directions: Array
    T_world_base: Array
    T_joint_flange: Array
    _calls: Iterator[int] = field(default_factory=count, repr=False)

    def poses(self, q: Array) -> Array:
        """Return the flange in the base frame, (n, 4, 4), at configurations in [rad], (n, j)."""
        arrays = self.Ts_before_joint, self.axis, self.directions
        ends = self.T_world_base, self.T_joint_flange
        if kernels_are_loaded() or next(self._calls) >= FEW:
            Ts_base_flange = np.zeros((len(q), 4, 4))
            # compiled for arrays that can be written to
            _poses(np.array(q, dtype=float, order="C"), *arrays, *ends, Ts_base_flange)
            return Ts_base_flange
        # cosines of numpy may differ in the last digit from those of the C library
        c, s = (np.array([[turn(angle) for angle in row] for row in q.T]) for turn in (_cos, _sin))
        room, found = np.zeros((3, 4, 4, len(q))), np.zeros((4, 4, len(q)))
        _pose.plain(c, s, *arrays, *ends, room, found)
        return np.ascontiguousarray(np.moveaxis(found, -1, 0))


def _cos(angle: float) -> float:
    return math.cos(angle) if math.isfinite(angle) else math.nan


def _sin(angle: float) -> float:
    return math.sin(angle) if math.isfinite(angle) else math.nan


@kernel()
def product(A, B, C):  # type: ignore[no-untyped-def]
    """Set C to A B, poses all, with the additions in the order of pinocchio."""
    for j in range(3):
        for i in range(2):
            C[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
        C[2, j] = A[2, 0] * B[0, j] + (A[2, 1] * B[1, j] + A[2, 2] * B[2, j])
    for i in range(2):
        C[i, 3] = A[i, 3] + (A[i, 0] * B[0, 3] + A[i, 1] * B[1, 3] + A[i, 2] * B[2, 3])
    C[2, 3] = A[2, 3] + (A[2, 0] * B[0, 3] + (A[2, 1] * B[1, 3] + A[2, 2] * B[2, 3]))


@kernel()
def _turned_about(T, axis, c, s, C):  # type: ignore[no-untyped-def]
    """Set C to a pose turned about its axis of that number: one column is a cross product."""
    mixed, other, crossed = (1, 2, 2) if axis == 0 else (2, 0, 0) if axis == 1 else (0, 1, 1)
    for i in range(3):
        C[i, axis], C[i, 3] = T[i, axis], T[i, 3]
        C[i, mixed] = c * T[i, mixed] + s * T[i, other]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        C[i, crossed] = C[j, axis] * C[k, mixed] - C[k, axis] * C[j, mixed]


@kernel()
def _turn(direction, c, s, T):  # type: ignore[no-untyped-def]
    """Set the rotation of a pose to the turn about a unit vector."""
    x, y, z = direction
    sx, sy, sz = s * x, s * y, s * z
    dx, dy, dz = (1.0 - c) * x, (1.0 - c) * y, (1.0 - c) * z
    T[0, 0], T[1, 1], T[2, 2] = dx * x + c, dy * y + c, dz * z + c
    T[0, 1], T[1, 0] = dx * y - sz, dx * y + sz
    T[0, 2], T[2, 0] = dx * z + sy, dx * z - sy
    T[1, 2], T[2, 1] = dy * z - sx, dy * z + sx


@kernel(makes_arrays=True)
def _pose(c, s, before_joint, axis, directions, base, flange, room, found):  # type: ignore[no-untyped-def]
    """Set the pose of the flange in the base frame, of cosines and sines of the joints."""
    placed, moved, turn = room[0], room[1], room[2]
    for k in range(len(axis)):
        if axis[k] == ANY_AXIS:
            _turn(directions[k], c[k], s[k], turn)
            product(before_joint[k], turn, moved)
        else:
            _turned_about(before_joint[k], axis[k], c[k], s[k], moved)
        if k == 0:
            placed[:] = moved
        else:
            product(placed.copy(), moved, placed)
    product(placed, flange, moved)
    for i in range(3):
        for j in range(3):
            found[i, j] = (
                base[0, i] * moved[0, j] + base[1, i] * moved[1, j] + base[2, i] * moved[2, j]
            )
        found[i, 3] = (
            base[0, i] * (moved[0, 3] - base[0, 3])
            + base[1, i] * (moved[1, 3] - base[1, 3])
            + base[2, i] * (moved[2, 3] - base[2, 3])
        )
    found[3, 3] = 1.0


@kernel(
    "void(float64[:,::1],float64[:,:,::1],int64[::1],float64[:,::1],float64[:,:],float64[:,:],"
    "float64[:,:,::1])",
    early=True,
    makes_arrays=True,
)
def _poses(q, before_joint, axis, directions, base, flange, found):  # type: ignore[no-untyped-def]
    """Set the poses of the flange in the base frame, see `Chain.poses`."""
    room = np.zeros((3, 4, 4))
    for n in range(len(q)):
        c, s = np.cos(q[n]), np.sin(q[n])
        _pose(c, s, before_joint, axis, directions, base, flange, room, found[n])
