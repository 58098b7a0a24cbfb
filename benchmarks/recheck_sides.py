"""On which side of its barriers a pass stays, for `benchmarks.recheck`.

A barrier is a contact position on which the part is surely too deep in the wheel from one place of
a pass to another. As a pass goes on and never back, it stays above it all the way, or below.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, islice, pairwise

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import Array
from benchmarks.recheck_arms import Flags
from benchmarks.recheck_depth import Wheel
from benchmarks.recheck_pass import Passes

ANY = -1  # all bits: whatever side the pass stays on
ABOVE = sum(1 << 2 * k for k in range(31))  # of every barrier
MOST = 31  # barriers that there are bits for; more are not used
HALVINGS = 12  # of the way between two cutter points
FIRST = 3  # triangles that are tried before the way is halved

Chain = list[tuple[float, float]]


class Sides:
    """Sides as bits: of each barrier one for what is above it or before or after, one for below.

    Args:
        barriers: First and last place, and contact position of each.
        passes: Its passes.
        wheel: Its wheel.

    Raises:
        ValueError: If a barrier is none, as far as can be shown.
    """

    def __init__(self, barriers: Sequence[Sequence[float]], passes: Passes, wheel: Wheel) -> None:
        self.barriers = [tuple(map(float, one)) for one in barriers[:MOST]]
        self._passes, self._wheel = passes, wheel
        for first, last, t in self.barriers:
            passes.require_one(first, last)
            stops = [first, *np.arange(np.floor(first) + 1.0, np.ceil(last)).tolist(), last]
            if not all(self._is_shut(a, b, t) for a, b in pairwise(stops)):
                raise ValueError(f"places {first:g} to {last:g} are not shut at {t:g}")

    def of(self, first: Array, last: Array, low: Array, high: Array) -> NDArray[np.int64]:
        """Return on which sides cells may be, that go over places and contact positions."""
        out = np.full(np.broadcast(first, last, low, high).shape, ANY, dtype=np.int64)
        for k, (start, end, t) in enumerate(self.barriers):
            within = (start <= first) & (last <= end)
            out[within & (high <= t)] &= ~(1 << 2 * k)
            out[within & (low >= t)] &= ~(2 << 2 * k)
        return out

    def meetings(self) -> list[Chain]:
        """Return walls where two barriers of a pass meet: between them nothing may be left."""
        places = {
            max(one[0], other[0])
            for one, other in combinations(self.barriers, 2)
            if max(one[0], other[0]) <= min(one[1], other[1])
        }
        last = self._wheel.last
        return [[(place, -last), (place, last)] for place in sorted(places)]

    def _is_shut(self, first: float, last: float, t: float, halvings: int = HALVINGS) -> bool:
        """Return whether the part is surely too deep between two places on a contact position."""
        cutter = self._passes.in_cutter(self._wheel.triangles, (first + last) / 2.0)
        deep = False
        most = FIRST if halvings > 0 else None
        for triangle, weights in islice(self._wheel.deep_points(cutter, t), most):
            deep = True
            points = weights @ self._wheel.triangles[triangle]
            if self._wheel.surely_too_deep(self._passes.seen(points, first, last), t, t):
                return True
        if not deep or halvings == 0:
            return False
        middle = (first + last) / 2.0
        parts: Sequence[tuple[float, float]] = ((first, middle), (middle, last))
        return all(self._is_shut(*part, t, halvings - 1) for part in parts)


def fitting(sides: NDArray[np.int64], others: NDArray[np.int64] | int) -> Flags:
    """Return which sides leave one of each barrier that the others leave as well."""
    both = sides & others
    return np.asarray(((both | both >> 1) & ABOVE) == ABOVE)


def left_open(sides: NDArray[np.int64]) -> tuple[int, int] | None:
    """Return both sides of a barrier that part cells, each as what it leaves; None if none does.

    Args:
        sides: Of cells of a wall, or of several, shape (n,).
    """
    for k in range(MOST):
        above, below = 1 << 2 * k, 2 << 2 * k
        if not ((sides & above).all() or (sides & below).all()):
            return ~below, ~above
    return None
