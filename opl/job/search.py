"""The section ``search`` of a job file: how the path is searched."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from opl.files.documents import Document
from opl.files.quantities import NotNegative, between
from opl.job.bodies import MM
from opl.job.methods import Method, Objective, Search
from opl.planning.settings import (
    CostWeights,
    Interpolation,
    ObjectiveWeights,
    OptimalSettings,
    Start,
)

# contact positions are in mm on the wheel's flat and in degrees of roll about its edges
_BeltUnits = Annotated[float, Field(ge=0.05, le=10_000.0, json_schema_extra={"unit": "mm or deg"})]
MAX_JOINT_STEP = np.deg2rad(15.0)  # between adjacent nodes; more is a jump through a singularity

SixNotNegative = Annotated[list[NotNegative], Field(min_length=6, max_length=6)]


class WeightsSection(Document):
    """Costs of a path inside the box of least joint range sum, in radians of joint travel."""

    model_config = ConfigDict(title="Cost weights")
    renamed: ClassVar[Mapping[str, str]] = {
        "push_away_mm": "extra_clearance_mm",
        "push_away": "extra_clearance",
    }

    joints: SixNotNegative = Field(
        default=[1.0] * 6, description="Cost of each radian that a joint turns, by joint."
    )
    contact: NotNegative = Field(
        default=0.01,
        description="Cost of each mm or degree that the contact position moves on the wheel.",
    )
    limits: NotNegative = Field(
        default=0.05,
        description="Cost of a node at a joint limit; falls to 0 at 10 degrees from it.",
    )
    singularities: NotNegative = Field(
        default=0.05, description="Cost of a node in a singularity; falls to 0 away from it."
    )
    extra_clearance_mm: NotNegative = Field(
        default=10.0,
        description="A node with less clearance than this beyond the required one is charged; 0 "
        "charges none.",
    )
    extra_clearance: NotNegative = Field(
        default=0.02, description="Cost of a node with less extra clearance than that."
    )


class ObjectiveWeightsSection(Document):
    """Weights of the objective `weighted`; at least one must be above 0."""

    model_config = ConfigDict(title="Objective weights")

    range: NotNegative = Field(
        default=1.0, description="Weight of each radian of the joint range sum."
    )
    travel: NotNegative = Field(
        default=0.1, description="Weight of each radian that a joint turns on the wheel."
    )
    time: NotNegative = Field(default=0.0, description="Weight of each second on the wheel.")

    @model_validator(mode="after")
    def _not_nothing(self) -> ObjectiveWeightsSection:
        if self.range == self.travel == self.time == 0.0:
            raise ValueError("needs at least one of range, travel and time above 0")
        return self


class SearchSection(Document):
    """How the path is searched.

    A contact position says where on the wheel a point is ground: in mm across the flat, then in
    degrees of roll about the edge.
    """

    model_config = ConfigDict(title="Search")
    renamed: ClassVar[Mapping[str, str]] = {
        "widen_percent": "range_tolerance_percent",
    }
    retired: ClassVar[Mapping[str, str]] = {
        "refine_tolerance_percent": "the search finds contact positions between the given ones",
        "seconds": "the search is bounded by counted work, see max_subproblems",
        "time_limit_s": "the search is bounded by counted work, see max_subproblems",
    }

    method: Literal["recursive", "optimal"] = Field(
        default="optimal",
        description="`optimal` finds the best path there is, with a proven bound; `recursive` is "
        "the search of Zhang et al. (2019).",
    )
    objective: Literal["range", "travel", "time", "weighted"] = Field(
        default="range",
        description="What the optimal method makes small: the joint range sum, the joint travel, "
        "the time on the wheel, or a weighted sum of the three.",
    )
    objective_weights: ObjectiveWeightsSection = Field(
        default=ObjectiveWeightsSection(), description="Weights of the objective `weighted`."
    )
    start: Literal["best", "nearest"] = Field(
        default="best",
        description="Start node of the recursive method: the best of all, or the one nearest to "
        "home.",
    )
    contact_positions: Annotated[int, between(2, 2000)] = Field(
        description="Number of contact positions that each cutter point may have on the wheel, "
        "evenly spaced."
    )
    max_contact_step: _BeltUnits = Field(
        description="Largest change of the contact position between neighbouring positions of the "
        "path; more positions are put in between to keep it.",
    )
    max_contact_error_mm: Annotated[float, between(0.001, 10.0)] = Field(
        default=0.1,
        description="Largest distance of the ground point from where it touches the wheel, between "
        "two positions of the path as well; larger than passes.max_chord_error_mm, which is part "
        "of it.",
    )
    max_contact_change: _BeltUnits = Field(
        default=10_000.0,
        description="Largest change of the contact position between neighbouring cutter points; "
        "between places of a path that are nearer to each other, in proportion. The lower bound is "
        "that of paths without this limit; the default hardly limits. How long one spot is "
        "ground, process.max_dwell_s limits.",
    )
    range_tolerance_percent: Annotated[float, Field(gt=0.0, le=100.0)] = Field(
        default=0.1,
        description="How far the joint range sum may exceed its lower bound for the sake of a "
        "smoother path.",
    )
    max_subproblems: Annotated[int, between(1, 10_000_000)] = Field(
        default=13000,
        description="Work that the proof of the least joint range sum may take at the most, in "
        "units of one to three milliseconds on two slow cores. It is counted, not measured: "
        "numbers in linear programs, postures sampled and held against a box, distances, collision "
        "queries, motions checked.",
    )
    weights: WeightsSection = Field(
        default=WeightsSection(),
        description="Costs of a path where the joint range sum leaves a choice.",
    )

    def in_si(self, chord_error_mm: float) -> Search:
        """Return the section's values; the chord error is part of the contact error allowed."""
        weights = self.weights
        costs = CostWeights(
            joint_weights=np.array(weights.joints),
            contact_weight=weights.contact,
            time_weight=0.0,
            limit_weight=weights.limits,
            singularity_weight=weights.singularities,
            push_away=weights.extra_clearance_mm * MM,
            push_weight=weights.extra_clearance,
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
                self.max_contact_change,
                (self.max_contact_error_mm - chord_error_mm) * MM,
                float(MAX_JOINT_STEP),
            ),
            optimal=OptimalSettings(
                widen=self.range_tolerance_percent / 100.0,
                costs=costs,
                max_subproblems=self.max_subproblems,
            ),
        )
