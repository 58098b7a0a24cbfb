"""How far a posture is from the three singularities of an arm."""

from __future__ import annotations

import numpy as np

from opl.cell.inverse_kinematics import Arm
from opl.geometry.frames import Array


def singularity_margins(arm: Arm, q: Array) -> Array:
    """Return how far postures are from wrist, elbow and shoulder singularity.

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
