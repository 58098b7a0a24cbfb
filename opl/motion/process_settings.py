"""How a part is ground: feed, approach, free moves and home."""

from __future__ import annotations

from dataclasses import dataclass

from opl.geometry.frames import Array
from opl.motion.leads import LeadShape


@dataclass(frozen=True)
class ProcessSettings:
    """How fast the part moves, and how far off the wheel.

    Attributes:
        feed: Speed of the ground point along the surface in [m/s].
        approach_length: How far approach and retract lead off the wheel at the most, in [m].
        approach_turn: What their direction turns by in [rad]; 0 for straight along the contact
            normal.
        approach_run: How far the part moves on along the pass while it lifts off, in [m].
        approach_slow: How far from the contact both are slow, in [m].
        approach_speed: Largest speed of both where they are slow in [m/s]; but at least the feed.
        contact_speed: Largest speed of the contact position on the wheel in belt units per second:
            pivoting takes time even where the ground point hardly moves.
        max_dwell: Longest that the belt may stay on one spot beyond the time at the feed in [s].
        air_speed: Fraction of each joint's largest speed used for free moves, 0 to 1.
        home: Joint positions at the start and the end in [rad], shape (6,).
        home_between: Whether the part comes home between passes, so that each may be left out or
            repeated.
    """

    feed: float
    approach_length: float
    approach_turn: float
    approach_run: float
    approach_slow: float
    approach_speed: float
    contact_speed: float
    max_dwell: float
    air_speed: float
    home: Array
    home_between: bool = False

    def lead_shape(self, run: float | None = None) -> LeadShape:
        """Return the shape of approaches and retracts, with another run in [m] if one is given."""
        return LeadShape(
            self.approach_length,
            self.approach_turn,
            self.approach_run if run is None else run,
            self.approach_slow,
            self.feed,
            self.approach_speed,
        )
