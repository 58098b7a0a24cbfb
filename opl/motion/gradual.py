"""Speeds that change gradually: from move to move by a factor of `SPEED_RATIO` at the most.

The speed of a move is that of the ground point along the surface; of a lead that of the part. Only
the faster of two neighbours is slowed. A slow move shorter than `STEP_TIME` slows its neighbours
the less the shorter it is: what lasts a few milliseconds no controller shows, and a micrometre
would make it slow or fast. A speed below a fifth of the feed counts as that. Where the contact
pivots so fast over the wheel that the ground point hardly moves, its speed says nothing of how fast
the part moves: it is neither slowed nor slows others, and the belt dwells there no longer than it
must.

Times change continuously with ways and wanted times, so that a motion that was recognised to a
micrometre has the times of the one that was planned.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array

# Speeds of neighbouring moves differ by this factor at the most: nobody hears or sees a step of it,
# and from the feed to ten times the feed it takes nine moves.
SPEED_RATIO = 1.3
STEP_TIME = 0.04  # [s] that a step of this factor takes at the least
LEAST_COUNTED = 0.2  # of the feed: slower speeds count as this
# Of the feed: a ground point that pivots at this speed counts whole, and the less the slower, down
# to nothing at `LEAST_COUNTED`.
COUNTED_WHOLE = 0.4
# what is planned is a little less, for the digits that a controller takes
PLANNED_RATIO = 1.28


def gradual(distance: Array, seconds: Array, counts: Array, feed: float) -> Array:
    """Return the times of moves in [s], shape (n,), the faster of two neighbours slowed.

    Args:
        distance: Of each move in [m], shape (n,).
        seconds: Times that it takes at the least in [s], shape (n,).
        counts: How much its speed counts, 0 to 1, as `counted` gives it, shape (n,).
        feed: The feed in [m/s].
    """
    speed = _counted_speed(distance, seconds, feed)
    lasts = (seconds[:-1] + seconds[1:]) / 2.0
    steps = np.log(PLANNED_RATIO) * np.minimum(lasts / STEP_TIME, 1.0)
    rise = np.concatenate([[0.0], np.cumsum(steps)])
    limit = speed + _leeway(seconds, counts)
    upwards = np.minimum.accumulate(limit - rise) + rise
    downwards = np.minimum.accumulate((limit + rise)[::-1])[::-1] - rise
    slowest = np.minimum(speed, np.minimum(upwards, downwards))
    return np.asarray(seconds * np.exp(counts * (speed - slowest)))


def largest_ratio(distance: Array, seconds: Array, counts: Array, feed: float) -> float:
    """Return the largest ratio of the speeds of neighbours that count whole, 1 without any.

    A slow move that is short counts as for `gradual`; shapes and units as there.
    """
    speed, leeway = _counted_speed(distance, seconds, feed), _leeway(seconds, counts)
    slower = speed[1:] < speed[:-1]
    change = np.abs(np.diff(speed)) - np.where(slower, leeway[1:], leeway[:-1])
    whole = (counts[1:] >= 1.0) & (counts[:-1] >= 1.0)
    return float(np.exp(change[whole].max(initial=0.0)))


def counted(distance: Array, least: Array, feed: float) -> Array:
    """Return how much the speeds of moves on the wheel count, 0 to 1, shape (n,).

    Args:
        distance: Of the ground point along the surface in [m], shape (n,).
        least: Time that the move takes at the feed, or at the largest speed of the contact over the
            wheel, in [s], shape (n,).
        feed: The feed in [m/s].
    """
    at_feed = least * feed
    share = np.divide(distance, at_feed, out=np.ones_like(distance), where=at_feed > 0.0)
    known = np.log([LEAST_COUNTED, COUNTED_WHOLE])
    return np.interp(np.log(np.maximum(share, LEAST_COUNTED)), known, [0.0, 1.0])


def _counted_speed(distance: Array, seconds: Array, feed: float) -> Array:
    """Return the logarithms of the speeds, as they count."""
    return np.asarray(np.log(np.maximum(distance / seconds, LEAST_COUNTED * feed)))


def _leeway(seconds: Array, counts: Array) -> Array:
    """Return by how much more than a step neighbours may be faster, as a logarithm, shape (n,)."""
    less = np.minimum(seconds / STEP_TIME, 1.0) * counts
    return np.asarray(-np.log(LEAST_COUNTED) * (1.0 - less))
