"""The triangle of an arm's two long links: both ways to bring its far end to a place."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array

# A cosine this far beyond 1 is taken for round-off of an arm in line. A stretched arm then misses
# the pose by less than 1e-9 of its length, a folded MH24 by 10 nm.
STRETCH_TOLERANCE = 1e-9


def bend_to(forward: Array, up: Array, upper_arm: float, forearm: float) -> tuple[Array, Array]:
    """Return how the upper arm tilts from upright, and the forearm from the upper arm.

    Args:
        forward: Where the far end shall be, ahead of axis 2, in [m], shape (..., 1, n).
        up: And above it.
        upper_arm: From axis 2 to axis 3 in [m].
        forearm: From axis 3 to the far end in [m].

    Returns:
        Tilt and bend in [rad], shape (..., 2 elbows, n), NaN out of reach; the first elbow is the
        one with the bend that is not negative.
    """
    # law of cosines; the bend is the angle between upper arm and forearm, 0 when in line
    cos_bend = (forward**2 + up**2 - upper_arm**2 - forearm**2) / (2.0 * upper_arm * forearm)
    sin_bend = np.sqrt(from_zero(1.0 - cos_bend**2, 2.0))
    sin_bend = np.concatenate([sin_bend, -sin_bend], axis=-2)  # the two elbows
    bend = np.arctan2(sin_bend, cos_bend)
    # seen from axis 2, the end stands off the upper arm by the angle that the bent forearm subtends
    tilt = np.arctan2(forward, up) - np.arctan2(forearm * sin_bend, upper_arm + forearm * cos_bend)
    return tilt, bend


def from_zero(value: Array, scale: float) -> Array:
    """Return values with those below 0 by round-off as 0, and the others below 0 as NaN."""
    return np.where(value < -STRETCH_TOLERANCE * scale, np.nan, np.maximum(value, 0.0))
