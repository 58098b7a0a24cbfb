"""The section ``process`` of a job file: how fast the robot moves, where it starts and ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import ConfigDict, Field

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files.documents import Document
from opl.files.quantities import Positive, between
from opl.geometry.frames import Array
from opl.job import keys
from opl.job.bodies import MM, Six
from opl.job.source import Source
from opl.motion.process_settings import ProcessSettings

SixPositive = Annotated[list[Positive], Field(min_length=6, max_length=6)]


class ProcessSection(Document):
    """How fast the robot moves, and where it starts and ends."""

    model_config = ConfigDict(title="Process")
    renamed: ClassVar[Mapping[str, str]] = {
        "air_speed_percent": "free_move_speed_percent",
        "contact_speed": "max_contact_speed",
    }

    feed_mm_s: Annotated[float, between(0.01, 10_000.0)] = Field(
        description="Speed of the ground point along the surface of the part."
    )
    home_deg: Six | None = Field(
        default=None,
        description="Joint positions at the start and the end of the program; given here or in the "
        "cell file.",
    )
    approach_mm: Annotated[float, between(0.01, 2000.0)] = Field(
        default=50.0,
        description="Longest that approach and retract lead off the wheel; they end where the "
        "straight free move from there is proven free. They must get the part clear of the wheel.",
    )
    approach_turn_deg: Annotated[float, Field(ge=0.0, le=90.0)] = Field(
        default=0.0,
        description="0 for an approach straight along the contact normal; else the angle of an arc "
        "along the belt, from -y to +y of the contact frame.",
    )
    approach_run_mm: Annotated[float, between(1.0, 1000.0)] = Field(
        default=5.0,
        description="How far the part moves on along the pass while it lifts off the wheel, in "
        "feed, on a quarter of a circle of this radius; likewise before it touches. Half or a "
        "quarter of it where that is not free. The belt never sees a stop.",
    )
    approach_slow_mm: Annotated[float, between(0.01, 2000.0)] = Field(
        default=10.0,
        description="Within this way of the contact approach_mm_s is kept; farther off the leads "
        "are as fast as free moves.",
    )
    approach_mm_s: Annotated[float, between(0.01, 10_000.0)] = Field(
        default=50.0,
        description="Largest speed of approach and retract near the contact; the feed if that is "
        "more. The belt is met and left at the feed.",
    )
    free_move_speed_percent: Annotated[float, Field(gt=0.0, le=100.0)] = Field(
        default=10.0,
        description="Speed of free moves, from and to home and between passes: part of each "
        "joint's largest speed.",
    )
    max_contact_speed: Positive = Field(
        default=40.0,
        description="Largest speed of the contact position on the wheel.",
        json_schema_extra={"unit": "mm/s or deg/s"},
    )
    max_dwell_s: Positive = Field(
        default=3.0,
        description="Longest time that the belt may stay on one spot beyond the time at the feed.",
    )
    max_acceleration_deg_s2: SixPositive | None = Field(
        default=None,
        description="Largest acceleration of each joint; else the robot's own, which is assumed.",
    )

    def robot_as_limited(self, robot: Robot) -> Robot:
        """Return the robot with the joint accelerations that the job names, if it does."""
        if self.max_acceleration_deg_s2 is None:
            return robot
        limits = np.deg2rad(self.max_acceleration_deg_s2)
        return replace(robot, max_acceleration=limits, acceleration_assumed=False)

    def in_si(self, home: Array, home_between: bool) -> ProcessSettings:
        """Return the section's values; home in [rad], shape (6,)."""
        return ProcessSettings(
            feed=self.feed_mm_s * MM,
            approach_length=self.approach_mm * MM,
            approach_turn=float(np.deg2rad(self.approach_turn_deg)),
            approach_run=self.approach_run_mm * MM,
            approach_slow=self.approach_slow_mm * MM,
            approach_speed=self.approach_mm_s * MM,
            air_speed=self.free_move_speed_percent / 100.0,
            contact_speed=self.max_contact_speed,
            max_dwell=self.max_dwell_s,
            home=home,
            home_between=home_between,
        )


def check_leads(source: Source, process: ProcessSettings, from_wheel: float) -> None:
    """Refuse leads that end where no free move may begin, wherever a pass does.

    Args:
        source: The job file.
        process: What it sets.
        from_wheel: Distance that the part keeps from the wheel on free moves in [m].

    Raises:
        InputError: If they are too short.
    """
    farthest = process.lead_shape().farthest
    if farthest < from_wheel:
        kept, length = from_wheel / MM, process.approach_length / MM
        raise InputError(
            source.at(keys.PROCESS_APPROACH),
            f"must lead the part as far off the wheel as free moves keep it, {kept:g} mm "
            f"({keys.CLEARANCE}, or pair_clearances of the cell); {length:g} mm lead it "
            f"{farthest / MM:.2g} mm off at the most",
        )
