"""How long each move of a motion takes: set speed on the wheel, or as fast as a joint may turn."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.motion import Motion, Stretch

LEAD_SPACING = 0.005  # [m] between postures along the normal: joint lines stay near it


@dataclass(frozen=True)
class Pace:
    """How fast, and how far off the wheel.

    Attributes:
        feed: Speed of the ground point along the surface in [m/s].
        approach_length: Length of approach and retract along the contact normal in [m].
        approach_speed: Speed along the contact normal in [m/s].
        contact_speed: Largest speed of the contact position on the wheel in belt units per second:
            pivoting takes time even where the ground point hardly moves.
        air_speed: Fraction of each joint's largest speed used for free moves, 0 to 1.
        home: Joint positions at the start and the end in [rad], shape (6,).
    """

    feed: float
    approach_length: float
    approach_speed: float
    contact_speed: float
    air_speed: float
    home: Array


def lead_count(pace: Pace) -> int:
    """Return into how many moves an approach or retract is cut."""
    return max(int(np.ceil(pace.approach_length / LEAD_SPACING)), 1)


def timed(motion: Motion, points: CutterPoints, pace: Pace, max_speed: Array) -> Motion:
    """Return a motion with the time of every move.

    The ground point passes along the surface at the feed, or slower where the contact position
    moves fast over the wheel; approach and retract run at their speed;
    on free moves the joint with the longest way runs at its share of its largest speed. A move that
    no joint could follow takes as long as the slowest joint needs.

    Args:
        motion: The motion; its durations are not looked at.
        points: Its cutter points.
        pace: The speeds.
        max_speed: Largest speed of each joint in [rad/s], shape (6,).
    """
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    fastest = (turned / max_speed).max(axis=1)
    arc = np.interp(motion.cutter_point, np.arange(len(points)), points.arc_length)
    along_surface = np.abs(np.diff(arc, prepend=np.nan)) / pace.feed
    over_wheel = np.abs(np.diff(motion.contact_position, prepend=np.nan)) / pace.contact_speed
    lead = pace.approach_length / lead_count(pace) / pace.approach_speed
    wanted = np.empty(len(motion))
    for move, stretch in enumerate(motion.stretch):
        if stretch in (Stretch.HOME, Stretch.LINK):
            wanted[move] = fastest[move] / pace.air_speed
        elif stretch in (Stretch.APPROACH, Stretch.RETRACT) or np.isnan(along_surface[move]):
            wanted[move] = lead  # the move onto the first cutter point of a pass ends the approach
        else:
            wanted[move] = max(along_surface[move], over_wheel[move])
    return replace(motion, duration=np.maximum(wanted, fastest))
