"""The section ``passes`` of a job file: how the surface is cut."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from opl.errors import InputError
from opl.files.documents import Document
from opl.files.quantities import NotNegative, between
from opl.geometry.passes import MOST_ROWS, MachinedSurface, Order, Passes, PassKind
from opl.geometry.scallop import row_pitch
from opl.job.bodies import MM, Triple
from opl.job.source import Source


class PassesSection(Document):
    """How the surface is cut into rows of passes, and these into cutter points.

    The distance of the rows is given by exactly one of pitch_mm and scallop_height_mm.
    """

    model_config = ConfigDict(title="Passes")
    renamed: ClassVar[Mapping[str, str]] = {
        "scallop_mm": "scallop_height_mm",
        "bow_height_mm": "max_chord_error_mm",
        "largest_step_mm": "max_step_mm",
    }

    kind: Literal["sections", "along_u", "along_v"] = Field(
        default="sections",
        description="Passes lie where parallel planes cut the surface, or along the parameter u or "
        "v of a single NURBS face.",
    )
    plane_normal: Triple | None = Field(
        default=None,
        description="Normal of the planes in the workpiece frame, of any length; needed for "
        "`kind: sections`, and only there. A pass runs along outward normal x plane normal.",
    )
    pitch_mm: Annotated[float, between(0.01, 1000.0)] | None = Field(
        default=None, description="Distance of neighbouring rows."
    )
    scallop_height_mm: Annotated[float, between(1e-4, 10.0)] | None = Field(
        default=None,
        description="Or the height of the ridge that may be left between rows; for "
        "`kind: sections`.",
    )
    margin_mm: NotNegative = Field(
        default=0.0,
        description="Least distance of a row from both ends of the surface along plane_normal.",
    )
    end_margin_mm: NotNegative = Field(
        default=0.0, description="What is left out at both ends of an open pass."
    )
    rows: Annotated[int, between(1, MOST_ROWS)] | None = Field(
        default=None,
        description="Number of rows, in the middle of the surface; else as many as fit.",
    )
    repeats: Annotated[int, Field(ge=1, le=20)] = Field(
        default=1, description="How often all rows are ground."
    )
    shift_mm: NotNegative = Field(
        default=0.0, description="How far each repeat is shifted across the rows."
    )
    max_chord_error_mm: Annotated[float, between(1e-4, 10.0)] = Field(
        description="Largest distance of the surface curve from the chord between two cutter "
        "points (bow height)."
    )
    max_step_mm: Annotated[float, between(0.01, 1000.0)] = Field(
        description="Largest distance of neighbouring cutter points along a pass."
    )
    order: Literal["one_way", "zigzag", "both", "shortest"] = Field(
        default="one_way",
        description="Order and direction of the passes: all in one direction, every second one "
        "backwards, each forwards and back, or whatever makes the free moves shortest: in time, "
        "home included, reckoned with the contact in the middle of the wheel before the search; "
        "of up to 10 passes none is shorter.",
    )

    @model_validator(mode="after")
    def _fits(self) -> PassesSection:
        if (self.pitch_mm is None) == (self.scallop_height_mm is None):
            raise ValueError(
                "needs either pitch_mm or scallop_height_mm, the height left between rows"
            )
        if (self.kind == "sections") != (self.plane_normal is not None):
            raise ValueError("plane_normal goes with kind: sections, and only there")
        if self.kind != "sections" and self.scallop_height_mm is not None:
            raise ValueError("scallop_height_mm goes with kind: sections, and only there")
        return self

    def in_si(self, source: Source, surface: MachinedSurface, wheel_radius: float) -> Passes:
        """Return how the surface is cut.

        Args:
            source: The job file or mapping.
            surface: The surface to be ground; a pitch from a scallop height depends on it.
            wheel_radius: Radius of the wheel in [m].

        Raises:
            InputError: If there is no pitch that keeps the scallop height.
        """
        normal = np.array(self.plane_normal or [0.0, 0.0, 0.0])
        if self.pitch_mm is not None:
            pitch = self.pitch_mm * MM
        else:
            if not normal.any():
                raise InputError(source.at("passes.plane_normal"), "must not be zero")
            height = (self.scallop_height_mm or 0.0) * MM
            try:
                pitch = row_pitch(surface, normal, height, wheel_radius)
            except ValueError as error:
                where = source.at("passes.scallop_height_mm")
                raise InputError(where, f"{error}; give pitch_mm instead") from error
        return Passes(
            plane_normal=normal,
            pitch=pitch,
            max_bow_height=self.max_chord_error_mm * MM,
            largest_step=self.max_step_mm * MM,
            margin=self.margin_mm * MM,
            rows=self.rows,
            order=Order(self.order),
            kind=PassKind(self.kind),
            end_margin=self.end_margin_mm * MM,
            repeats=self.repeats,
            shift=self.shift_mm * MM,
        )
