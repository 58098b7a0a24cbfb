"""Contact segments: the configurations between two touches, placed on the surface.

A configuration alone does not always say where it grinds: in a hollow the part can lie on the flat
and on an edge of the wheel at once, and a flat face lies on the flat with all its points. What
counts is that there are places for all configurations of a segment that never go back, each within
the contact model; of those, the ones are taken that lie nearest to it and move evenly over the
wheel.

Where the surface is flat, several configurations in a row touch the same cutter point, each at
another contact position. Which of them grinds it follows from the segments before and after it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.contact import LEVER, Touches, contact_positions, misfit

TRIED = 48  # places tried first between two neighbouring cutter points
ROUNDS = 4  # of refining, each to a quarter
# [m] that one belt unit away from an even change of t counts for, move by move: on a flat part of
# the surface there is nothing else to choose places by
UNEVEN = 1e-5


@dataclass(frozen=True, eq=False)
class ContactSegment:
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


@dataclass(frozen=True, eq=False)
class ContactSegments:
    """The contact segments of one motion, each found once.

    Attributes:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is at each configuration, shape (n, 4, 4).
        duration: Time of the move that ends at each configuration in [s], shape (n,).
        touches: Which cutter points are touched; their configurations are indices of those.
    """

    wheel: ContactWheel
    points: CutterPoints
    Ts_contact0_workpiece: Array
    duration: Array
    touches: Touches
    _found: dict[tuple[int, int], ContactSegment] = field(default_factory=dict)

    def between(self, before: int, after: int) -> ContactSegment:
        """Return the segment from one touch to another, by their indices."""
        if (before, after) not in self._found:
            self._found[before, after] = self._between(before, after)
        return self._found[before, after]

    def _between(self, before: int, after: int) -> ContactSegment:
        touches = self.touches
        first, last = int(touches.configuration[before]), int(touches.configuration[after])
        configurations = np.arange(first + 1, last)
        if not len(configurations):
            return ContactSegment(configurations, *np.empty((3, 0)))
        found = place_between(
            self.wheel,
            self.points,
            self.Ts_contact0_workpiece[configurations],
            self.duration[first + 1 : last + 1],
            (int(touches.point[before]), int(touches.point[after])),
            (float(touches.contact_position[before]), float(touches.contact_position[after])),
        )
        return ContactSegment(configurations, *found)

    def settled(self, ground: NDArray[np.intp], allowed: float) -> NDArray[np.intp]:
        """Return chosen touches, other ones of the same cutter points where those fit better.

        `ground` are indices in order; a configuration between should be at most `allowed` in [m]
        off the contact model.
        """
        chosen: NDArray[np.intp] = ground.copy()
        for m in range(1, len(chosen)):
            if not self._goes_on(chosen, m) or self._farthest(chosen, m) <= allowed:
                continue
            for end in (m, m - 1):
                for touch in self._alternatives(chosen, end):
                    tried = chosen.copy()
                    tried[end] = touch
                    if self._around(tried, end) < self._around(chosen, end):
                        chosen = tried
        return chosen

    def _goes_on(self, chosen: NDArray[np.intp], m: int) -> bool:
        """Return whether a touch is on the same pass as the one before it."""
        pass_index = self.points.pass_index[self.touches.point[chosen[m - 1 : m + 1]]]
        return bool(pass_index[0] == pass_index[1])

    def _farthest(self, chosen: NDArray[np.intp], m: int) -> float:
        return self.between(int(chosen[m - 1]), int(chosen[m])).farthest

    def _around(self, chosen: NDArray[np.intp], m: int) -> float:
        """Return how far a touch and the segments on either side are off the contact model."""
        sides = [k for k in (m, m + 1) if 0 < k < len(chosen) and self._goes_on(chosen, k)]
        own = float(self.touches.distance[chosen[m]])
        return max([own, *(self._farthest(chosen, k) for k in sides)])

    def _alternatives(self, chosen: NDArray[np.intp], m: int) -> NDArray[np.intp]:
        """Return the other touches of a cutter point between its neighbours."""
        configuration, point = self.touches.configuration, self.touches.point
        after = configuration[chosen[m - 1]] if m else -1
        before = configuration[chosen[m + 1]] if m + 1 < len(chosen) else len(self.duration)
        same = point == point[chosen[m]]
        return np.flatnonzero(same & (configuration > after) & (configuration < before))


def place_between(
    wheel: ContactWheel,
    points: CutterPoints,
    Ts_contact0_workpiece: Array,
    duration: Array,
    ends: tuple[int, int],
    t_ends: tuple[float, float],
) -> tuple[Array, Array, Array]:
    """Place the configurations between two cutter points, none before the one ahead of it.

    Args:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is at each configuration, shape (n, 4, 4).
        duration: Times of the moves, the one onto the second cutter point as well, shape (n + 1,).
        ends: The cutter points that are ground before and after.
        t_ends: The contact positions there.

    Returns:
        Fractional cutter point, contact position, and distance from the contact model in [m], with
        what the part is turned counted along `LEVER`; each of shape (n,).
    """
    n, span = len(Ts_contact0_workpiece), ends[1] - ends[0]
    time = np.maximum(duration, 1e-9)
    even = np.diff(t_ends) * time / time.sum()  # change of t in each move
    width = 1.0 / TRIED
    tried = np.tile(ends[0] + np.arange(span * TRIED + 1) / TRIED, (n, 1))
    for _ in range(1 + ROUNDS):
        Ts = Ts_contact0_workpiece[:, None] @ points.frames_at(tried)
        t = contact_positions(wheel, Ts)
        distance, angle = misfit(wheel, Ts, t)
        apart = np.hypot(distance, LEVER * angle)
        chosen = np.arange(n), _in_order(tried, apart, t, even, t_ends)
        found = tried[chosen], t[chosen], apart[chosen]
        tried = np.clip(found[0][:, None] + np.linspace(-width, width, 9), *ends)
        width /= 4.0
    return found


def _in_order(
    tried: Array, apart: Array, t: Array, even: Array, t_ends: tuple[float, float]
) -> NDArray[np.intp]:
    """Choose one place for each configuration so that none goes back, shape (n,).

    Dynamic programming over the configurations; the sum of the squares of all misfits is least.
    Places, distances in [m] and contact positions have shape (n, k), even changes of t (n + 1,).
    """
    n = len(tried)
    came_from = np.zeros(tried.shape, dtype=np.intp)
    cost = np.square(apart[0]) + np.square(UNEVEN * (t[0] - t_ends[0] - even[0]))
    for k in range(1, n):
        total = cost + np.square(UNEVEN * (t[k][:, None] - t[k - 1] - even[k]))
        total[tried[k][:, None] < tried[k - 1]] = np.inf
        came_from[k] = total.argmin(axis=1)
        cost = np.take_along_axis(total, came_from[k][:, None], axis=1)[:, 0] + np.square(apart[k])
    last = cost + np.square(UNEVEN * (t_ends[1] - t[-1] - even[-1]))
    chosen = np.empty(n, dtype=np.intp)
    chosen[-1] = last.argmin()
    for k in range(n - 1, 0, -1):
        chosen[k - 1] = came_from[k][chosen[k]]
    return chosen
