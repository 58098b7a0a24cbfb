"""Speeds that change gradually: from move to move by a factor of `SPEED_RATIO` at the most.

The speed of a move is that of the ground point along the surface; of a lead that of the part. Only
the faster of two neighbours is slowed. Where the contact moves over the wheel and the ground point
hardly moves, its speed says nothing; below a fifth of the feed it counts as that.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array

# Speeds of neighbouring moves differ by this factor at the most: nobody hears or sees a step of it,
# and from the feed to ten times the feed it takes nine moves.
SPEED_RATIO = 1.3
COUNTS = 0.2  # of the feed: slower speeds count as this
# what is planned is a little less, for the digits that a controller takes
PLANNED_RATIO = 1.28


def gradual(distance: Array, seconds: Array, feed: float) -> Array:
    """Return the times of moves in [s], shape (n,), the faster of two neighbours slowed.

    Args:
        distance: Of each move in [m], shape (n,).
        seconds: Times that it takes at the least in [s], shape (n,).
        feed: The feed in [m/s].
    """
    speed = np.log(np.maximum(distance / seconds, COUNTS * feed))
    rise = np.arange(len(speed)) * np.log(PLANNED_RATIO)
    upwards = np.minimum.accumulate(speed - rise) + rise
    downwards = (np.minimum.accumulate((speed + rise)[::-1]))[::-1] - rise
    return np.asarray(np.maximum(seconds, distance / np.exp(np.minimum(upwards, downwards))))


def largest_ratio(distance: Array, seconds: Array, feed: float) -> float:
    """Return the largest ratio of the speeds of neighbouring moves, as they count; 1 for one."""
    speed = np.log(np.maximum(distance / seconds, COUNTS * feed))
    return float(np.exp(np.abs(np.diff(speed)).max(initial=0.0)))
