"""How a part is ground: feed, approach, free moves and home."""

from __future__ import annotations

from dataclasses import dataclass

from opl.geometry.frames import Array


@dataclass(frozen=True)
class ProcessSettings:
    """How fast the part moves, and how far off the wheel.

    Attributes:
        feed: Speed of the ground point along the surface in [m/s].
        approach_length: Length of approach and retract in [m].
        approach_turn: What their direction turns by in [rad]; 0 for straight along the contact
            normal.
        approach_speed: Speed of both in [m/s].
        contact_speed: Largest speed of the contact position on the wheel in belt units per second:
            pivoting takes time even where the ground point hardly moves.
        max_dwell: Longest that the belt may stay on one spot beyond the time at the feed in [s].
        air_speed: Fraction of each joint's largest speed used for free moves, 0 to 1.
        home: Joint positions at the start and the end in [rad], shape (6,).
    """

    feed: float
    approach_length: float
    approach_turn: float
    approach_speed: float
    contact_speed: float
    max_dwell: float
    air_speed: float
    home: Array
