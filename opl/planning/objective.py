"""Weighted sums of what paths are compared by, as an objective."""

from __future__ import annotations

from dataclasses import dataclass

from opl.motion.figures import Figures


@dataclass(frozen=True)
class ObjectiveWeights:
    """What an objective charges.

    Attributes:
        joint_range: For each radian of the joint range sum.
        travel: For each radian that a joint turns on the wheel.
        time: For each second on the wheel.
    """

    joint_range: float
    travel: float
    time: float

    def value(self, figures: Figures) -> float:
        """Return the weighted sum of a path's figures."""
        return (
            self.joint_range * figures.joint_range_sum
            + self.travel * figures.joint_travel
            + self.time * figures.seconds
        )


@dataclass(frozen=True)
class WeightedValue:
    """What is known of the least weighted sum.

    Attributes:
        value: Of the path found.
        lower_bound: No path through the cutter points at the field's contact positions has less.
    """

    value: float
    lower_bound: float

    @property
    def gap(self) -> float:
        """Fraction by which the path may miss the least."""
        return 1.0 - self.lower_bound / self.value if self.value > 0.0 else 0.0
