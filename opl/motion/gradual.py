"""Speeds that change gradually: from move to move by a factor of `SPEED_RATIO` at the most.

The speed of a move is that of the ground point along the surface; of a lead that of the part. Only
the faster of two neighbours is slowed. Moves shorter than `STEP_TIME` change it by less, so that a
few longer moves can do what many short ones do. A speed below a fifth of the feed counts as that.
Where the contact pivots so fast over the wheel that the ground point hardly moves, its speed says
nothing and does not count at all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array

# Speeds of neighbouring moves differ by this factor at the most: nobody hears or sees a step of it,
# and from the feed to ten times the feed it takes nine moves.
SPEED_RATIO = 1.3
STEP_TIME = 0.04  # [s] that a step of this factor takes at the least
LEAST_COUNTED = 0.2  # of the feed: slower speeds count as this
# what is planned is a little less, for the digits that a controller takes
PLANNED_RATIO = 1.28


def gradual(distance: Array, seconds: Array, counts: NDArray[np.bool_], feed: float) -> Array:
    """Return the times of moves in [s], shape (n,), the faster of two neighbours slowed.

    Args:
        distance: Of each move in [m], shape (n,).
        seconds: Times that it takes at the least in [s], shape (n,).
        counts: Whether its speed counts, shape (n,); others are neither slowed nor slow others.
        feed: The feed in [m/s].
    """
    speed = np.where(counts, _counted(distance, seconds, feed), np.inf)
    lasts = (seconds[:-1] + seconds[1:]) / 2.0
    steps = np.log(PLANNED_RATIO) * np.minimum(lasts / STEP_TIME, 1.0)
    rise = np.concatenate([[0.0], np.cumsum(steps)])
    upwards = np.minimum.accumulate(speed - rise) + rise
    downwards = np.minimum.accumulate((speed + rise)[::-1])[::-1] - rise
    slowed = np.maximum(seconds, distance / np.exp(np.minimum(upwards, downwards)))
    return np.asarray(np.where(counts, slowed, seconds))


def largest_ratio(distance: Array, seconds: Array, counts: NDArray[np.bool_], feed: float) -> float:
    """Return the largest ratio of the speeds of neighbouring moves that count, 1 without any."""
    change = np.abs(np.diff(_counted(distance, seconds, feed)))
    return float(np.exp(change[counts[1:] & counts[:-1]].max(initial=0.0)))


def _counted(distance: Array, seconds: Array, feed: float) -> Array:
    """Return the logarithms of the speeds, as they count."""
    return np.asarray(np.log(np.maximum(distance / seconds, LEAST_COUNTED * feed)))
