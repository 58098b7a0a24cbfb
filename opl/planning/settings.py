"""What searches are set to, without what they are made of: jobs are read with no search at hand."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from opl.geometry.frames import Array

if TYPE_CHECKING:
    from opl.motion.figures import Figures


@dataclass(frozen=True)
class Interpolation:
    """Which nodes are joined, and how the path between them is filled in.

    Attributes:
        max_contact_step: Largest difference of t between adjacent configurations, delta T.
        max_contact_change: Largest difference of t between neighbouring cutter points in belt
            units.
        max_contact_error: Largest distance of the ground point from where it should touch the
            wheel, in the middle between two configurations, in [m]. More are put in to keep it.
        max_joint_step: Largest change of a joint between adjacent configurations in [rad].
    """

    max_contact_step: float
    max_contact_change: float
    max_contact_error: float
    max_joint_step: float


class Start(str, Enum):
    """Where the search starts in the first column."""

    BEST = "best"  # every start node is tried, the one with the least joint range sum is kept
    NEAREST = "nearest"  # Node_1 of the paper: nearest to home


@dataclass(frozen=True)
class CostWeights:
    """Prices, all in the same unit as joint travel with weight 1, [rad].

    Attributes:
        joint_weights: For each radian that a joint turns, shape (6,).
        contact_weight: For each belt unit that t moves on the wheel: the belt dwells meanwhile.
        time_weight: For each second on the wheel.
        limit_weight: For a node at a joint limit; falls to 0 at `NEAR_LIMIT` from it.
        singularity_weight: For a node in a singularity; falls to 0 at `NEAR_SINGULARITY`.
        push_away: Nodes that keep less than this beyond the required clearance from everything but
            the wheel are charged, in [m]; 0 charges none.
        push_weight: For such a node.
    """

    joint_weights: Array
    contact_weight: float
    time_weight: float
    limit_weight: float
    singularity_weight: float
    push_away: float
    push_weight: float


@dataclass(frozen=True)
class ObjectiveWeights:
    """Prices of a radian of joint range sum, a radian of joint travel, a second on the wheel."""

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


# of the widening
PROOF_SHARE, ROOM_SHARE, MISSED = 0.9, 0.4, 0.05


@dataclass(frozen=True)
class OptimalSettings:
    """What is wanted of the optimal method.

    Attributes:
        widen: Fraction by which the joint range sum may exceed the lower bound for the sake of a
            smoother track.
        costs: What a track is charged for inside the box.
        max_subproblems: How much is tried, in units of work.
    """

    widen: float
    costs: CostWeights
    max_subproblems: int

    @property
    def gap(self) -> float:
        """Fraction by which the bound may stay below the path."""
        return PROOF_SHARE * self.widen

    def missed(self, size: float) -> float:
        """Return what a box of a size in [rad] may miss a cutter point by and still hold it."""
        return MISSED * self.widen * size

    def room(self, size: float) -> float:
        """Return how much larger than its box of a size in [rad] a path may be."""
        return ROOM_SHARE * self.widen * size
