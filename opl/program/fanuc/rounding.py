"""The configurations that a FANUC program can express, and how FANUC counts axis 3.

FANUC counts J3 from the horizontal; opl, as robot descriptions do, from the upper arm.
"""

from __future__ import annotations

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.program.digits import within
from opl.program.settings import ProgramSettings

DECIMALS = 3


def to_fanuc(q: Array) -> Array:
    """Return joint positions as FANUC counts them, shape (..., 6): J3 from the horizontal."""
    turned = np.array(q, dtype=float)
    turned[..., 2] -= turned[..., 1]
    return turned


def from_fanuc(axes: Array) -> Array:
    """Return the joint positions of axes as FANUC counts them, shape (..., 6)."""
    q = np.array(axes, dtype=float)
    q[..., 2] += q[..., 1]
    return q


def rounded(q: Array, robot: Robot, settings: ProgramSettings) -> Array:
    """Return the configurations nearest to some that a program can express, shape (n, 6).

    Raises:
        UnsafeError: If one is beyond the limits.
    """
    axes = np.rad2deg(to_fanuc(q))
    lower = np.broadcast_to(np.rad2deg(robot.lower), axes.shape).copy()
    upper = np.broadcast_to(np.rad2deg(robot.upper), axes.shape).copy()
    # the limits of J3 are those of the joint, seen from where J2 is
    axes[..., 1] = within(axes[..., 1], lower[..., 1], upper[..., 1], DECIMALS)
    lower[..., 2] -= axes[..., 1]
    upper[..., 2] -= axes[..., 1]
    return from_fanuc(np.deg2rad(within(axes, lower, upper, DECIMALS)))
