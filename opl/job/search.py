"""The search and process sections of a job file: how the path is sought, how fast it is run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from opl.cell.robot import Robot
from opl.documents import Document
from opl.field.path import Interpolation
from opl.geometry.frames import Array
from opl.motion.process import ProcessSettings
from opl.planning.box_search import OptimalSettings
from opl.planning.costs import Costs
from opl.planning.objective import ObjectiveWeights
from opl.planning.starts import Start

MM = 1e-3
MAX_JOINT_STEP = np.deg2rad(15.0)  # between adjacent nodes; more is a jump through a singularity

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Six = Annotated[list[float], Field(min_length=6, max_length=6)]
SixPositive = Annotated[list[Positive], Field(min_length=6, max_length=6)]
SixNotNegative = Annotated[list[NotNegative], Field(min_length=6, max_length=6)]


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


class WeightsSection(Document):
    """What a track is charged for, in radians of joint travel."""

    joints: SixNotNegative = Field(default=[1.0] * 6)
    contact: NotNegative = 0.01
    limits: NotNegative = 0.05
    singularities: NotNegative = 0.05
    push_away_mm: NotNegative = 10.0
    push_away: NotNegative = 0.02


class ObjectiveWeightsSection(Document):
    """What the weighted objective charges: per radian of range sum and of travel, per second."""

    range: NotNegative = 1.0
    travel: NotNegative = 0.1
    time: NotNegative = 0.0

    @model_validator(mode="after")
    def _not_nothing(self) -> ObjectiveWeightsSection:
        if self.range == self.travel == self.time == 0.0:
            raise ValueError("needs at least one of range, travel and time above 0")
        return self


class SearchSection(Document):
    """How the path is sought."""

    method: Literal["recursive", "optimal"] = "optimal"
    objective: Literal["range", "travel", "time", "weighted"] = "range"
    objective_weights: ObjectiveWeightsSection = ObjectiveWeightsSection()
    start: Literal["best", "nearest"] = "best"
    contact_positions: Annotated[int, Field(ge=2)]
    max_contact_step: Positive
    max_contact_error_mm: Positive = 0.1
    max_contact_change: Positive = 100.0
    widen_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 0.1
    seconds: Positive = 60.0
    refine_tolerance_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 0.1
    weights: WeightsSection = WeightsSection()

    def in_si(self, bow_height_mm: float) -> Search:
        """Return the section's values; the bow height is part of the contact error allowed."""
        weights = self.weights
        costs = Costs(
            joint_weights=np.array(weights.joints),
            contact_weight=weights.contact,
            time_weight=0.0,
            limit_weight=weights.limits,
            singularity_weight=weights.singularities,
            push_away=weights.push_away_mm * MM,
            push_weight=weights.push_away,
        )
        return Search(
            method=Method(self.method),
            objective=Objective(self.objective),
            objective_weights=ObjectiveWeights(
                self.objective_weights.range,
                self.objective_weights.travel,
                self.objective_weights.time,
            ),
            start=Start(self.start),
            n_contact_positions=self.contact_positions,
            max_contact_error=self.max_contact_error_mm * MM,
            interpolation=Interpolation(
                self.max_contact_step,
                (self.max_contact_error_mm - bow_height_mm) * MM,
                float(MAX_JOINT_STEP),
            ),
            optimal=OptimalSettings(
                widen=self.widen_percent / 100.0,
                max_contact_change=self.max_contact_change,
                costs=costs,
                seconds=self.seconds,
                tolerance=self.refine_tolerance_percent / 100.0,
            ),
        )


class ProcessSection(Document):
    """How fast the robot moves, and where it starts and ends."""

    feed_mm_s: Positive
    home_deg: Six | None = None  # else the cell file says it
    approach_mm: Positive = 50.0
    approach_turn_deg: Annotated[float, Field(ge=0.0, le=90.0)] = 0.0  # 0: straight
    approach_mm_s: Positive = 50.0
    air_speed_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 10.0
    contact_speed: Positive = 40.0
    max_dwell_s: Positive = 3.0
    max_acceleration_deg_s2: SixPositive | None = None

    def robot_as_limited(self, robot: Robot) -> Robot:
        """Return the robot with the joint accelerations that the job names, if it does."""
        if self.max_acceleration_deg_s2 is None:
            return robot
        limits = np.deg2rad(self.max_acceleration_deg_s2)
        return replace(robot, max_acceleration=limits, acceleration_assumed=False)

    def in_si(self, home: Array) -> ProcessSettings:
        """Return the section's values; home in [rad], shape (6,)."""
        return ProcessSettings(
            feed=self.feed_mm_s * MM,
            approach_length=self.approach_mm * MM,
            approach_turn=float(np.deg2rad(self.approach_turn_deg)),
            approach_speed=self.approach_mm_s * MM,
            air_speed=self.air_speed_percent / 100.0,
            contact_speed=self.contact_speed,
            max_dwell=self.max_dwell_s,
            home=home,
        )


@dataclass(frozen=True)
class Search:
    """How the path is sought.

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
    def weights_asked(self) -> ObjectiveWeights | None:
        """The weights of the objective, if it is a weighted sum."""
        return self.objective_weights if self.objective is Objective.WEIGHTED else None
