"""The ways between ground cutter points: what lies between two touches, and which touch it bears.

Where the surface is flat, several configurations in a row touch the same cutter point, each at
another contact position. Which of them grinds it is told by the configurations around: they have to
lie on the way to it, or on the way from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.between import place_between
from opl.verification.contact import Touches


@dataclass(frozen=True, eq=False)
class Way:
    """Configurations between two touches.

    Attributes:
        configurations: Their indices, shape (n,).
        place: Fractional cutter points, shape (n,).
        contact_position: t, shape (n,).
        apart: Distances from the contact model in [m], shape (n,).
    """

    configurations: NDArray[np.intp]
    place: Array
    contact_position: Array
    apart: Array

    @property
    def farthest(self) -> float:
        """The largest distance from the contact model in [m]."""
        return float(self.apart.max(initial=0.0))


class Ways:
    """The ways of one motion, each found once.

    Args:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is at each configuration, shape (n, 4, 4).
        duration: Time of the move that ends at each configuration in [s], shape (n,).
        touches: Which cutter points are touched; their configurations are indices of those.
    """

    def __init__(
        self,
        wheel: ContactWheel,
        points: CutterPoints,
        Ts_contact0_workpiece: Array,
        duration: Array,
        touches: Touches,
    ) -> None:
        self._wheel = wheel
        self._points = points
        self._Ts = Ts_contact0_workpiece
        self._duration = duration
        self._touches = touches
        self._found: dict[tuple[int, int], Way] = {}

    def between(self, before: int, after: int) -> Way:
        """Return the way from one touch to another, by their indices."""
        if (before, after) not in self._found:
            self._found[before, after] = self._way(before, after)
        return self._found[before, after]

    def settled(self, ground: NDArray[np.intp], allowed: float) -> NDArray[np.intp]:
        """Return chosen touches, other ones of the same cutter points where those bear better.

        Args:
            ground: Indices of the chosen touches, in order.
            allowed: Farthest in [m] that a configuration between should be from the contact model.
        """
        chosen: NDArray[np.intp] = ground.copy()
        for m in range(1, len(chosen)):
            if not self._goes_on(chosen, m) or self._farthest(chosen, m) <= allowed:
                continue
            for end in (m, m - 1):
                for touch in self._instead(chosen, end):
                    tried = chosen.copy()
                    tried[end] = touch
                    if self._around(tried, end) < self._around(chosen, end):
                        chosen = tried
        return chosen

    def _way(self, before: int, after: int) -> Way:
        touches = self._touches
        first, last = int(touches.configuration[before]), int(touches.configuration[after])
        configurations = np.arange(first + 1, last)
        if not len(configurations):
            return Way(configurations, *np.empty((3, 0)))
        found = place_between(
            self._wheel,
            self._points,
            self._Ts[configurations],
            self._duration[first + 1 : last + 1],
            (int(touches.point[before]), int(touches.point[after])),
            (float(touches.contact_position[before]), float(touches.contact_position[after])),
        )
        return Way(configurations, *found)

    def _goes_on(self, chosen: NDArray[np.intp], m: int) -> bool:
        """Return whether a touch is on the same pass as the one before it."""
        pass_index = self._points.pass_index[self._touches.point[chosen[m - 1 : m + 1]]]
        return bool(pass_index[0] == pass_index[1])

    def _farthest(self, chosen: NDArray[np.intp], m: int) -> float:
        return self.between(int(chosen[m - 1]), int(chosen[m])).farthest

    def _around(self, chosen: NDArray[np.intp], m: int) -> float:
        """Return how far a touch and the ways to and from it are off the contact model."""
        ways = [k for k in (m, m + 1) if 0 < k < len(chosen) and self._goes_on(chosen, k)]
        own = float(self._touches.distance[chosen[m]])
        return max([own, *(self._farthest(chosen, k) for k in ways)])

    def _instead(self, chosen: NDArray[np.intp], m: int) -> NDArray[np.intp]:
        """Return the other touches of a cutter point between its neighbours."""
        configuration = self._touches.configuration
        after = configuration[chosen[m - 1]] if m else -1
        before = configuration[chosen[m + 1]] if m + 1 < len(chosen) else len(self._Ts)
        same = self._touches.point == self._touches.point[chosen[m]]
        return np.flatnonzero(same & (configuration > after) & (configuration < before))
