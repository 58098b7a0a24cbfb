"""Speeds of the digits a controller takes, and the time that moves take at them.

A controller takes speeds of few digits: at slow feed the last digit of VJ is several percent of the
speed. What rounding adds to one move is therefore taken from the moves that follow, so that a pass
keeps its time although no single move does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array

# A move makes up for the rounding of those before it by at most this factor of its own time.
MOST_CORRECTION = 2.0


@dataclass(frozen=True)
class SpeedRange:
    """The values of one kind of speed that a controller takes.

    Attributes:
        lowest: Smallest value.
        highest: Largest value.
        decimals: Digits it is written with behind the point.
    """

    lowest: float
    highest: float
    decimals: int

    def text(self, value: float) -> str:
        """Return a value as written; one out of range becomes the nearest in range."""
        return f"{min(max(value, self.lowest), self.highest):.{self.decimals}f}"

    def keeping_time(self, distance: float, time: float) -> float:
        """Return the value at which a distance takes a time most nearly.

        Args:
            distance: Time [s] of the move at speed 1, in the unit of the value times [s].
            time: Wanted time in [s].
        """
        digits = 10**self.decimals
        exact = distance / time * digits if time > 0.0 else math.inf
        lowest, highest = round(self.lowest * digits), round(self.highest * digits)
        below = math.floor(min(max(exact, lowest), highest))
        candidates = [min(max(n, lowest), highest) / digits for n in (below, below + 1)]
        nearest: float = min(candidates, key=lambda value: abs(distance / value - time))
        return nearest


def speeds_keeping_time(
    distances: Sequence[float],
    times: Sequence[float],
    ranges: Sequence[SpeedRange],
    chained: Sequence[bool],
) -> Array:
    """Return speeds, rounded as written, at which chains of moves keep their time.

    Args:
        distances: Of each move, in the unit of its range times [s].
        times: Wanted time of each move in [s].
        ranges: The speeds each move may have.
        chained: Whether a move makes up for what rounding did to the one before.
    """
    speeds = np.empty(len(distances))
    late = 0.0
    moves = zip(distances, times, ranges, chained, strict=True)
    for k, (distance, time, allowed, follows) in enumerate(moves):
        late = late if follows else 0.0
        aim = min(max(time - late, time / MOST_CORRECTION), time * MOST_CORRECTION)
        speeds[k] = allowed.keeping_time(distance, aim)
        late += distance / speeds[k] - time
    return speeds
