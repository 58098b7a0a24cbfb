"""Inverse kinematics in closed form: all configurations of an arm that reach a pose, in batch.

Two families of arms have one here: those with a spherical wrist, and those with three parallel
axes. Each has two answers at shoulder, elbow and wrist: eight configurations, in slots
``4 * flip + 2 * back + elbow`` that keep their meaning along a path, for a slot is left only
through a singularity.
"""

from __future__ import annotations

import numpy as np

from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.spherical_wrist import SphericalWristArm
from opl.geometry.frames import Array

N_IK_BRANCHES = 8

Arm = SphericalWristArm | ParallelAxesArm


def inverse_kinematics(arm: Arm, Ts_base_flange: Array, near: Array | None = None) -> Array:
    """Return all configurations that bring the flange to poses, limits not regarded.

    Args:
        arm: The geometry.
        Ts_base_flange: Shape (..., 4, 4).
        near: Joint positions in [rad] of one configuration nearby, shape (6,), or one a pose, shape
            (..., 6); zeros by default. It matters only where the pose leaves a joint free: joint 4
            of a straight spherical wrist, joint 6 of an arm with four parallel axes. That joint
            keeps its position, and the others follow from it.

    Returns:
        Joint positions in (-pi, pi] [rad], shape (..., 8, 6). Slots without a configuration are NaN
        in all six joints. Where two slots fall together (stretched arm, straight wrist, wrist
        centre on axis 1) both are given.
    """
    shape = np.shape(Ts_base_flange)[:-2]
    nearby = np.broadcast_to(np.zeros(6) if near is None else near, (*shape, 6)).reshape(-1, 6)
    q = arm.solutions(np.reshape(Ts_base_flange, (-1, 4, 4)), nearby)
    return q.reshape(*shape, N_IK_BRANCHES, 6)


def singularity_margins(arm: Arm, q: Array) -> Array:
    """Return how far configurations are from wrist, elbow and shoulder singularity.

    The Jacobian loses rank where one of the three is zero; its determinant is proportional to their
    product.

    Args:
        arm: The arm.
        q: Joint positions in [rad], shape (..., 6).

    Returns:
        |sin theta5|; |sin| of the angle between upper arm and the line on to the wrist centre, or
        to axis 4 of an arm with three parallel axes; how far the wrist centre, or the meeting of
        axes 5 and 6, is ahead of or behind axis 1, as a fraction of the reach; shape (..., 3).
    """
    return arm.margins(q * np.array(arm.signs) - np.array(arm.offsets))


def ik_branch_name(slot: int) -> str:
    """Return what a slot means, in words.

    Front: the wrist centre lies ahead of axis 1, in the plane of the arm. Elbow up: axis 3 lies
    above the line from axis 2 to the wrist centre (behind that line, where the wrist is between
    axes 1 and 2). No flip: theta5 is not negative; B of a Motoman arm counts in the other direction
    and is not positive, so that the hand bows down where R is zero.
    """
    flip, back, elbow = slot // 4, slot // 2 % 2, slot % 2
    return ", ".join(
        [
            "back" if back else "front",
            # the same bend of axis 3 points to the other side once the arm reaches over backwards
            "elbow down" if elbow != back else "elbow up",
            "flip" if flip else "no flip",
        ]
    )
