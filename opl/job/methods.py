"""How the path of a job is searched, as a value: the method, and what it keeps small."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from opl.planning.settings import Interpolation, ObjectiveWeights, OptimalSettings, Start


class Method(str, Enum):
    """How the path is searched."""

    RECURSIVE = "recursive"  # the paper's
    OPTIMAL = "optimal"  # the best there is, with proof


class Objective(str, Enum):
    """What the optimal method keeps small."""

    RANGE = "range"  # joint range sum; inside its box the smoothest motion
    TRAVEL = "travel"  # joint travel
    TIME = "time"  # time on the wheel
    WEIGHTED = "weighted"  # a weighted sum of the three


@dataclass(frozen=True)
class Search:
    """How the path is searched.

    Attributes:
        method: The search.
        objective: What the optimal method keeps small.
        objective_weights: What the weighted objective charges.
        start: Start node of the recursive method.
        n_contact_positions: M, the number of values of t.
        max_contact_error: Largest distance of the ground point from the wheel's surface in [m].
        interpolation: How the path between nodes is filled in.
        optimal: What is wanted of the optimal method.
    """

    method: Method
    objective: Objective
    objective_weights: ObjectiveWeights
    start: Start
    n_contact_positions: int
    max_contact_error: float
    interpolation: Interpolation
    optimal: OptimalSettings

    @property
    def requested_weights(self) -> ObjectiveWeights | None:
        """The weights of the objective, if it is a weighted sum."""
        return self.objective_weights if self.objective is Objective.WEIGHTED else None

    @property
    def counts_ranges(self) -> bool:
        """Whether the joint range sum is among what the method keeps small."""
        if self.method is Method.RECURSIVE or self.objective is Objective.RANGE:
            return True
        return self.objective is Objective.WEIGHTED and self.objective_weights.joint_range > 0.0
