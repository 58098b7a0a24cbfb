"""How far a posture is from the three singularities of an arm with a spherical wrist."""

from __future__ import annotations

import numpy as np

from opl.cell.inverse import SphericalWristArm
from opl.geometry.frames import Array


def singularity_margins(arm: SphericalWristArm, q: Array) -> Array:
    """Return how far postures are from wrist, elbow and shoulder singularity.

    The Jacobian loses rank where one of the three is zero; its determinant is proportional to their
    product.

    Args:
        arm: The arm.
        q: Joint positions in [rad], shape (..., 6).

    Returns:
        |sin theta5|; |sin| of the angle between upper arm and the line from axis 3 to the wrist
        centre; distance of the wrist centre from axis 1 as a fraction of the reach; (..., 3).
    """
    theta = q * np.array(arm.signs) - np.array(arm.offsets)
    forearm = np.hypot(arm.a2, arm.c3)
    bend = np.arctan2(arm.a2, arm.c3)
    ahead = (
        arm.a1
        + arm.c2 * np.sin(theta[..., 1])
        + forearm * np.sin(theta[..., 1] + theta[..., 2] + bend)
    )
    return np.stack(
        [
            np.abs(np.sin(theta[..., 4])),
            np.abs(np.sin(theta[..., 2] + bend)),
            np.hypot(ahead, arm.b) / (arm.a1 + arm.c2 + forearm),
        ],
        axis=-1,
    )
