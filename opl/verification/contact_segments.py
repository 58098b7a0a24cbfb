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

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.contact import LEVER, Touches, contact_positions, misfit

TRIED = 48  # places tried first between two neighbouring cutter points
ROUNDS = 4  # of refining, each to a quarter
AT_ONCE = 1 << 18  # numbers that are held in memory
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
            self._find([(before, after)])
        return self._found[before, after]

    def _find(self, wanted: Iterable[tuple[int, int]]) -> None:
        """Find segments from one touch to another, those of one size at once."""
        configuration, point = self.touches.configuration, self.touches.point
        sizes: dict[tuple[int, int], list[tuple[int, int]]] = {}
        for before, after in wanted:
            if (before, after) not in self._found:
                count = max(int(configuration[after] - configuration[before]) - 1, 0)
                span = int(point[after] - point[before])
                sizes.setdefault((count, span), []).append((before, after))
        for (count, span), pairs in sizes.items():
            tried = span * TRIED + 1  # of which pairs are compared, and which are frames each
            at_once = max(1, AT_ONCE // (tried * max(tried, 16 * count)))
            for first in range(0, len(pairs), at_once):
                self._place(pairs[first : first + at_once], count, span)

    def _place(self, pairs: Sequence[tuple[int, int]], count: int, span: int) -> None:
        """Place the configurations of segments that have as many of them and of points."""
        touches = self.touches
        before, after = np.array(pairs).T
        first = touches.configuration[before]
        configurations = first[:, None] + np.arange(1, count + 1)
        moves = first[:, None] + np.arange(1, count + 2)
        found = np.empty((3, len(pairs), count))
        if count:
            found = np.stack(
                place_between(
                    self.wheel,
                    self.points,
                    self.Ts_contact0_workpiece[configurations],
                    self.duration[moves],
                    (touches.point[before], span),
                    (touches.contact_position[before], touches.contact_position[after]),
                )
            )
        for k, pair in enumerate(pairs):
            self._found[pair] = ContactSegment(configurations[k], *found[:, k])

    def settled(self, ground: NDArray[np.intp], allowed: float) -> NDArray[np.intp]:
        """Return chosen touches, other ones of the same cutter points where those fit better.

        `ground` are indices in order; a configuration between should be at most `allowed` in [m]
        off the contact model.
        """
        chosen: NDArray[np.intp] = ground.copy()
        goes_on = [m for m in range(1, len(chosen)) if self._goes_on(chosen, m)]
        self._find((int(chosen[m - 1]), int(chosen[m])) for m in goes_on)
        # there and back: one that is moved on may leave the segment before it too far off
        for m in (*range(1, len(chosen)), *range(len(chosen) - 1, 0, -1)):
            if not self._goes_on(chosen, m) or self._farthest(chosen, m) <= allowed:
                continue
            for end in (m, m - 1):
                for touch in self._alternatives(chosen, end):
                    tried = chosen.copy()
                    tried[end] = touch
                    if self._around(tried, end) < self._around(chosen, end):
                        chosen = tried
            for end, way in ((m - 1, -1), (m, 1)):
                if self._farthest(chosen, m) > allowed:
                    chosen = self._drawn_on(chosen, end, way, allowed)
        return chosen

    def _drawn_on(
        self, chosen: NDArray[np.intp], end: int, way: int, allowed: float
    ) -> NDArray[np.intp]:
        """Return touches with one end of a segment and those behind it moved towards the other end.

        A flat touches with many points at once, which are ground one by one later, or were before:
        no one of them alone would fit better. They are moved only where all fit better then.

        Args:
            chosen: The touches, by their indices.
            end: Which of them is moved first.
            way: Which are behind it: -1 for those before it, 1 for those after it.
            allowed: How far off the contact model the segments should be at the most, in [m].
        """
        tried, k = chosen.copy(), end
        while 0 <= k < len(tried):
            others = self._alternatives(tried, k)
            if not len(others) or tried[k] == (nearest := others[-1 if way < 0 else 0]):
                break
            tried[k] = nearest
            k += way
            behind = k + (way < 0)
            if not 0 < behind < len(tried) or not self._goes_on(tried, behind):
                break
            if self._farthest(tried, behind) <= allowed:
                break
        moved = range(max(min(k, end), 1), min(max(k, end) + 2, len(tried)))
        own = [j for j in moved if self._goes_on(tried, j)]
        worst, before = (max(self._farthest(one, j) for j in own) for one in (tried, chosen))
        return tried if worst < before else chosen

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
    ends: tuple[NDArray[np.intp], int],
    t_ends: tuple[Array, Array],
) -> tuple[Array, Array, Array]:
    """Place the configurations between two cutter points, none before the one ahead of it.

    Of s segments at once that have n configurations each and lead equally many cutter points on.

    Args:
        wheel: The wheel.
        points: The cutter points.
        Ts_contact0_workpiece: Where the part is at each configuration, shape (s, n, 4, 4).
        duration: Times of the moves, the one onto the second cutter point as well, (s, n + 1).
        ends: The cutter points that are ground before, shape (s,), and how many points later the
            one is that is ground after.
        t_ends: The contact positions before and after, shape (s,) each.

    Returns:
        Fractional cutter point, contact position, and distance from the contact model in [m], with
        what the part is turned counted along `LEVER`; each of shape (s, n).
    """
    start, span = ends[0][:, None, None], ends[1]
    time = np.maximum(duration, 1e-9)
    even = (t_ends[1] - t_ends[0])[:, None] * time / time.sum(axis=1, keepdims=True)
    width = 1.0 / TRIED  # of cutter points around a place that is tried anew
    tried = start + np.arange(span * TRIED + 1) / TRIED  # at first the same for all of a segment
    for _ in range(1 + ROUNDS):
        Ts = Ts_contact0_workpiece[:, :, None] @ points.frames_at(tried)
        t = contact_positions(wheel, Ts)
        distance, angle = misfit(wheel, Ts, t)
        apart = np.hypot(distance, LEVER * angle)
        tried = np.broadcast_to(tried, apart.shape)
        chosen = _in_order(tried, apart, t, even, t_ends)[..., None]
        place, t, apart = (np.take_along_axis(one, chosen, axis=2) for one in (tried, t, apart))
        tried = np.clip(place + np.linspace(-width, width, 9), start, start + span)
        width /= 4.0
    return place[..., 0], t[..., 0], apart[..., 0]


def _in_order(
    tried: Array, apart: Array, t: Array, even: Array, t_ends: tuple[Array, Array]
) -> NDArray[np.intp]:
    """Choose one place for each configuration so that none goes back, shape (s, n).

    The sum of the squares of all misfits is least. Places, distances in [m] and contact positions
    have shape (s, n, k), even changes of t, the changes of all moves if they were as fast, shape
    (s, n + 1).
    """
    chosen = np.empty(tried.shape[:2], dtype=np.intp)
    given = (np.require(one, requirements=["C", "W"]) for one in (tried, apart, t, even, *t_ends))
    _choose(*given, chosen)
    return chosen


@kernel(
    "void(float64[:,:,::1],float64[:,:,::1],float64[:,:,::1],float64[:,::1],float64[::1],"
    "float64[::1],int64[:,::1])",
    early=True,
    makes_arrays=True,
)
def _choose(tried, apart, t, even, t_before, t_after, chosen):  # type: ignore[no-untyped-def]
    """Do `_in_order` by dynamic programming over the configurations."""
    n_segments, n, count = tried.shape
    came_from = np.zeros((n, count), np.int64)
    cost, further = np.empty(count), np.empty(count)
    for s in range(n_segments):
        for j in range(count):
            begun = UNEVEN * (t[s, 0, j] - t_before[s] - even[s, 0])
            cost[j] = apart[s, 0, j] * apart[s, 0, j] + begun * begun
        for k in range(1, n):
            for j in range(count):
                least, came_from[k, j] = np.inf, 0
                for i in range(count):
                    if tried[s, k, j] < tried[s, k - 1, i]:
                        continue
                    change = UNEVEN * (t[s, k, j] - t[s, k - 1, i] - even[s, k])
                    total = cost[i] + change * change
                    if total < least:
                        least, came_from[k, j] = total, i
                further[j] = least + apart[s, k, j] * apart[s, k, j]
            cost[:] = further
        least, last = np.inf, 0
        for j in range(count):
            ended = UNEVEN * (t_after[s] - t[s, n - 1, j] - even[s, n])
            total = cost[j] + ended * ended
            if total < least:
                least, last = total, j
        for k in range(n - 1, -1, -1):
            chosen[s, k] = last
            last = came_from[k, last]
