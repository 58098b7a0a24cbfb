"""The cheapest way through columns of cells: a lower bound of travel and time.

A cell is a piece of a curve in joint space, known as a chord and pads around it. What the way from
a cell to one of the next column costs at the least would lose the length of both, if each edge
could choose its own point in a cell. So a potential is added at one edge and taken off at the next:
it is linear along each chord, any one gives a true bound, and the cost of getting there along the
ends of the chords makes it nearly tight. For any prices p of the joints, none above the price of
travel, p times the change of the joints is not more than what their travel costs; that is linear
along both chords, so its least lies at their ends.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array


@dataclass(frozen=True)
class Cells:
    """The cells of all columns, one column after the other.

    Attributes:
        start: Joint positions at one end in [rad], shape (n, 6).
        along: From there to the other end in [rad], shape (n, 6).
        pad_low: How far below the chord the curve can be, not positive, shape (n, 6).
        pad_high: How far above, not negative, shape (n, 6).
        t_low: Least contact position of each in belt units, shape (n,).
        t_high: Greatest, shape (n,).
        first: Index of the first cell of each column, and n, shape (n_columns + 1,).
    """

    start: Array
    along: Array
    pad_low: Array
    pad_high: Array
    t_low: Array
    t_high: Array
    first: np.ndarray

    @property
    def edges(self) -> int:
        """How many ways lead from cells to cells of the next column."""
        counts = np.diff(self.first)
        return int((counts[:-1] * counts[1:]).sum())

    @cached_property
    def _last(self) -> np.ndarray:
        """Which cells have an end that is not the start of the next one, shape (n,)."""
        apart = np.append(self.t_high[:-1] != self.t_low[1:], True)
        apart[np.asarray(self.first[1:]) - 1] = True
        return np.asarray(apart)

    @cached_property
    def ends(self) -> Cells:
        """The ends of all cells, each once, as cells without length."""
        last = self._last
        order = np.argsort(
            np.concatenate([np.arange(len(last)), np.flatnonzero(last) + 0.5]), kind="stable"
        )
        q = np.concatenate([self.start, (self.start + self.along)[last]])[order]
        t = np.concatenate([self.t_low, self.t_high[last]])[order]
        more = np.concatenate([[0], np.cumsum(last)])
        first = np.asarray(self.first) + more[np.asarray(self.first)]
        none = np.zeros_like(q)
        return Cells(q, none, none, none, t, t, first)

    def at_ends(self, of_ends: Array) -> tuple[Array, Array]:
        """Return what is known of `ends` at the start and at the other end of each cell."""
        at = np.arange(len(self.start)) + np.cumsum(self._last) - self._last
        return of_ends[at], of_ends[at + 1]


@dataclass(frozen=True)
class WayPrices:
    """What the way from column to column is charged for.

    Attributes:
        travel: For each radian that a joint turns in [1/rad].
        time: For each second in [1/s].
        seconds: Least time from each column to the next in [s], shape (n_columns - 1,).
        max_speed: Largest joint speeds in [rad/s], shape (6,).
        contact_speed: Largest speed of t in belt units per second.
    """

    travel: float
    time: float
    seconds: Array
    max_speed: Array
    contact_speed: float


def cheapest_over_ends(cells: Cells, prices: WayPrices) -> Array:
    """Return the cost of the cheapest way to each of `Cells.ends` over others, shape (m,)."""
    ends = cells.ends
    total, nothing = np.zeros((2, len(ends.start)))
    _fill(ends, prices, nothing, nothing, False, total)
    return np.asarray(total)


def cheapest_ways(cells: Cells, prices: WayPrices, potential: Array) -> Array:
    """Return what a way through each cell costs at the least, shape (n,).

    Args:
        cells: The cells.
        prices: What is charged for.
        potential: Any number for each of `Cells.ends`; what the travel on the way to each costs
            makes the bound sharp, shape (m,).
    """
    start, end = (np.ascontiguousarray(one) for one in cells.at_ends(potential))
    forward, backward = np.zeros((2, len(start)))
    _fill(cells, prices, start, end, False, forward)
    _fill(cells, prices, start, end, True, backward)
    return np.asarray(forward + backward)


def _fill(
    cells: Cells, prices: WayPrices, start: Array, end: Array, backwards: bool, total: Array
) -> None:
    """Fill in costs as `_pass_on` does."""
    _pass_on(
        np.array(cells.start, order="C"),
        np.array(cells.along, order="C"),
        np.array(cells.pad_low, order="C"),
        np.array(cells.pad_high, order="C"),
        np.array(cells.t_low),
        np.array(cells.t_high),
        np.array(cells.first, dtype=np.int64),
        prices.travel,
        prices.time,
        np.array(prices.seconds),
        np.array(prices.max_speed),
        prices.contact_speed,
        start,
        end,
        backwards,
        total,
    )


@kernel("float64(float64,float64[:,::1],float64[:,::1],int64,int64,int64)")
def _pads(price, pad_low, pad_high, a, b, joint):  # type: ignore[no-untyped-def]
    """Return the least of a price times what the pads of two cells add to the way from a to b."""
    if price > 0.0:
        return price * (pad_low[b, joint] - pad_high[a, joint])
    return price * (pad_high[b, joint] - pad_low[a, joint])


@kernel(
    "void(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[::1],float64[::1],"
    "int64[::1],float64,float64,float64[::1],float64[::1],float64,float64[::1],float64[::1],"
    "boolean,float64[::1])"
)
def _pass_on(  # type: ignore[no-untyped-def]
    start, along, pad_low, pad_high, t_low, t_high, first, travel, time, seconds, max_speed,
    contact_speed, potential, potential_end, backwards, total,
):  # fmt: skip
    """Fill in the cost of the cheapest way from one end to each cell.

    Of a way from the first column the potential at the cell is taken off; of one from the last, it
    is added where that begins.
    """
    n_columns, n_joints = len(first) - 1, start.shape[1]
    begin = n_columns - 1 if backwards else 0
    for cell in range(first[begin], first[begin + 1]):
        total[cell] = 0.0
        if backwards:
            total[cell] = min(potential[cell], potential_end[cell])
        else:
            total[cell] = -max(potential[cell], potential_end[cell])
    price = np.empty(n_joints)
    for step in range(1, n_columns):
        column = n_columns - 1 - step if backwards else step
        beside = column + 1 if backwards else column - 1
        least = seconds[min(column, beside)]
        for cell in range(first[column], first[column + 1]):
            best = np.inf
            for come in range(first[beside], first[beside + 1]):
                a, b = (cell, come) if backwards else (come, cell)  # from a to b
                slope_a = potential_end[a] - potential[a]
                slope_b = potential_end[b] - potential[b]
                fixed, rise_a, rise_b, lasts = 0.0, 0.0, 0.0, least
                for joint in range(n_joints):
                    away = start[b, joint] - start[a, joint]
                    d_a, d_b = along[a, joint], along[b, joint]
                    middle = away + 0.5 * (d_b - d_a)
                    # the same posture a full turn away
                    turns = 2.0 * np.pi * np.round(middle / (2.0 * np.pi))
                    away -= turns
                    low = away + min(d_b, 0.0) - max(d_a, 0.0)
                    low += pad_low[b, joint] - pad_high[a, joint]
                    high = away + max(d_b, 0.0) - min(d_a, 0.0)
                    high += pad_high[b, joint] - pad_low[a, joint]
                    gap = max(low, -high, 0.0)
                    lasts = max(lasts, gap / max_speed[joint])
                    price[joint] = 0.0
                    if max(high, -low) < np.pi:  # else another turn might be nearer
                        price[joint] = travel if middle > turns else -travel
                        fixed += price[joint] * away + _pads(
                            price[joint], pad_low, pad_high, a, b, joint
                        )
                        rise_a += price[joint] * d_a
                        rise_b += price[joint] * d_b
                    # a price of zero is as true as any
                slid = max(t_low[b] - t_high[a], t_low[a] - t_high[b])
                lasts = max(lasts, slid / contact_speed)
                found = fixed + min(0.0, slope_a - rise_a) + min(0.0, rise_b - slope_b)
                # all prices lower, where the way hardly turns a joint
                if rise_a + rise_b != 0.0:
                    share = min(max((slope_a + slope_b) / (rise_a + rise_b), 0.0), 1.0)
                    lower = share * fixed + min(0.0, slope_a - share * rise_a)
                    found = max(found, lower + min(0.0, share * rise_b - slope_b))
                # one joint held still: its price makes up for the slopes of the potential
                for joint in range(n_joints):
                    old = price[joint]
                    d_a, d_b = along[a, joint], along[b, joint]
                    if old == 0.0 or abs(d_a + d_b) < 1e-12:
                        continue
                    wanted = old + (slope_a + slope_b - rise_a - rise_b) / (d_a + d_b)
                    new = min(max(wanted, -travel), travel)
                    away = start[b, joint] - start[a, joint]
                    middle = away + 0.5 * (d_b - d_a)
                    away -= 2.0 * np.pi * np.round(middle / (2.0 * np.pi))
                    other = fixed + (new - old) * away
                    other += _pads(new, pad_low, pad_high, a, b, joint)
                    other -= _pads(old, pad_low, pad_high, a, b, joint)
                    other += min(0.0, slope_a - rise_a - (new - old) * d_a)
                    other += min(0.0, rise_b + (new - old) * d_b - slope_b)
                    found = max(found, other)
                cost = total[come] + time * lasts + found + potential[a] - potential[b]
                best = min(best, cost)
            total[cell] = best
