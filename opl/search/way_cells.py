"""Cells of curves in joint space, column by column, and what ways through them are charged for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

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

    @cached_property
    def at_start(self) -> np.ndarray:
        """Which of `ends` is the start of each cell, shape (n,); the next is its other end."""
        return np.asarray(np.arange(len(self.start)) + np.cumsum(self._last) - self._last)

    def at_ends(self, of_ends: Array) -> tuple[Array, Array]:
        """Return what is known of `ends` at the start and at the other end of each cell."""
        return of_ends[self.at_start], of_ends[self.at_start + 1]


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

    def of(self, turned: Array, slid: Array, seconds: Array) -> Array:
        """Return what ways cost, from posture to posture, shape (...).

        Args:
            turned: By how much joints turn in [rad], shape (..., 6).
            slid: By how much t changes in belt units, shape (...).
            seconds: Least time of each in [s], shape (...).
        """
        turned = np.abs(turned)
        lasts = np.maximum(
            (turned / self.max_speed).max(axis=-1), np.abs(slid) / self.contact_speed
        )
        lasts = np.maximum(lasts, seconds)
        return np.asarray(self.travel * turned.sum(axis=-1) + self.time * lasts)
