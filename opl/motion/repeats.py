"""Configurations that repeat the one before: the part stands still, and a program names it once.

On the wheel that happens where a straight part lies along the flat: the contact slides over both
while the robot rests. The time that this takes goes to the move that follows, or where a pass ends
there to the move before: each so gets slower, never faster.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import SAME_CONFIGURATION
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion, TimedMotion

SHORTER = 0.02  # than at the feed, as a fraction, that the moves of a pass on the wheel may be


@dataclass(frozen=True)
class ShortPass:
    """A pass whose moves on the wheel take less time than its way at the feed.

    Attributes:
        pass_index: Which, counted from 0.
        takes: Time of its moves on the wheel in [s].
        at_feed: That of its way along the surface at the feed in [s].
    """

    pass_index: int
    takes: float
    at_feed: float


def repeats(motion: Motion) -> list[NDArray[np.intp]]:
    """Return the indices of all configurations, those together that repeat the first of them."""
    q, firsts = motion.q, [0]
    for i in range(1, len(q)):
        if np.abs(q[i] - q[firsts[-1]]).max() > SAME_CONFIGURATION:
            firsts.append(i)
    return np.split(np.arange(len(q)), firsts[1:])


def named_of(grinding: NDArray[np.bool_], group: NDArray[np.intp]) -> int:
    """Return which of a group as of `repeats` a program names: the time until there is its move's.

    The first; the last where a pass ends there that was not begun there. `grinding` is that of the
    motion.
    """
    ends_pass = grinding[group].all() and not grinding[group[-1] + 1]
    return int(group[-1] if ends_pass else group[0])


def named_once(motion: Motion) -> Motion:
    """Return a motion whose written configurations on the wheel do not repeat one another."""
    positions = motion.positions
    named = motion.take(positions)
    written = motion.written.copy()
    grinding = named.grinding
    for group in repeats(named):
        written[positions[group[grinding[group]]]] = False
        written[positions[named_of(grinding, group)]] = True
    return replace(motion, written=written)


def short_passes(timed: TimedMotion, points: CutterPoints, feed: float) -> Iterator[ShortPass]:
    """Yield passes that move too little: the part rests where they begin or end, for no time.

    Args:
        timed: A motion over all of the points.
        points: The cutter points.
        feed: Of the ground point in [m/s].
    """
    for index in range(points.n_passes):
        takes = float(
            timed.duration[timed.motion.grinding & (timed.motion.pass_index == index)].sum()
        )
        at_feed = float(points.arc_length[points.pass_index == index].max()) / feed
        if takes < at_feed * (1.0 - SHORTER):
            yield ShortPass(index, takes, at_feed)
