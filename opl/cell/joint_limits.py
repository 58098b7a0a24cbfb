"""Limits that a cell adds to those of the joints, such as for the dress pack.

The robot keeps its own ranges, because its controller distinguishes full turns by them. A cell
narrows the range of a joint, or of a sum of joints: the hose along the forearm does not care which
of two axes winds it up, R + T together may turn only so far. Such a limit is linear in the joints,
so where both ends of a linear joint move keep it, the whole move does.

The planner uses these; the replay computes its own sums.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array, read_only

# [rad] configurations are rounded to what a program can express before they are proven; pulses and
# digits are finer than this, for each joint in the sum
ROUNDING = np.deg2rad(0.01)


@dataclass(frozen=True, eq=False)
class JointLimit:
    """A range that a joint, or a weighted sum of joints, must stay in, beside the robot's own.

    Attributes:
        name: What messages call it, such as ``R`` or ``R+T``.
        coefficients: Weight of each joint, shape (6,).
        lower: Smallest sum in [rad].
        upper: Largest sum in [rad].
    """

    name: str
    coefficients: Array
    lower: float
    upper: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", read_only(self.coefficients))

    def holds(self, q: Array) -> np.ndarray:
        """Return which ``q``, shape (..., 6) in [rad], keep it; none with NaN; shape (...)."""
        total = q @ self.coefficients
        margin = ROUNDING * np.abs(self.coefficients).sum()
        return np.asarray((total >= self.lower + margin) & (total <= self.upper - margin))
