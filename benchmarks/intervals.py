"""Interval arithmetic that rounds outwards, and functions enclosed with two derivatives.

For `benchmarks.recheck` alone, which shares no code with opl.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROUND_OFF = 1e-12  # of sines, cosines and angles, more than libraries are off


@dataclass(frozen=True)
class Interval:
    """Numbers between two others; every operation rounds outwards."""

    low: Array
    high: Array

    def __add__(self, other: Interval) -> Interval:
        return outwards(self.low + other.low, self.high + other.high)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __sub__(self, other: Interval) -> Interval:
        return self + (-other)

    def __mul__(self, other: Interval) -> Interval:
        a, b = self.low * other.low, self.low * other.high
        c, d = self.high * other.low, self.high * other.high
        least = np.minimum(np.minimum(a, b), np.minimum(c, d))
        return outwards(least, np.maximum(np.maximum(a, b), np.maximum(c, d)))

    def __truediv__(self, other: Interval) -> Interval:
        apart = np.where((other.low > 0.0) | (other.high < 0.0), 1.0, np.nan)
        return self * outwards(apart / other.high, apart / other.low)

    def part(self, cells: slice) -> Interval:
        """Return those of some cells."""
        return Interval(self.low[cells], self.high[cells])

    def root(self) -> Interval:
        """Return the square roots; not a number where there may be none."""
        with np.errstate(invalid="ignore"):
            return outwards(np.sqrt(self.low), np.sqrt(self.high))


def outwards(low: Array, high: Array) -> Interval:
    """Return an interval a little wider than computed."""
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf))


def exactly(value: Array | float) -> Interval:
    """Return a number without doubt, or up to the last digit."""
    return Interval(np.asarray(value, dtype=float), np.asarray(value, dtype=float))


@dataclass(frozen=True)
class Jet:
    """A function of one variable over a cell of it: values and two derivatives."""

    value: Interval
    first: Interval
    second: Interval

    def part(self, cells: slice) -> Jet:
        """Return what it is over some of the cells."""
        return Jet(self.value.part(cells), self.first.part(cells), self.second.part(cells))

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __sub__(self, other: Jet) -> Jet:
        return Jet(self.value - other.value, self.first - other.first, self.second - other.second)

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.first, -self.second)

    def __mul__(self, other: Jet) -> Jet:
        cross = self.first * other.first
        second = self.value * other.second + self.second * other.value + (cross + cross)
        first = self.value * other.first + self.first * other.value
        return Jet(self.value * other.value, first, second)

    def __truediv__(self, other: Jet) -> Jet:
        value = self.value / other.value
        first = (self.first - value * other.first) / other.value
        cross = first * other.first
        return Jet(
            value, first, (self.second - value * other.second - (cross + cross)) / other.value
        )

    def root(self) -> Jet:
        """Return the square root."""
        value = self.value.root()
        first = self.first / (value + value)
        square = first * first
        return Jet(value, first, (self.second - (square + square)) / (value + value))


def still(value: Array | float, like: Array) -> Jet:
    """Return what does not change, known up to the last digit, for the cells of ``like``."""
    held, zero = np.broadcast_to(np.asarray(value, dtype=float), like.shape), np.zeros_like(like)
    return Jet(outwards(held, held), exactly(zero), exactly(zero))


def angle_of(y: Jet, x: Jet) -> Jet:
    """Return the angle of a vector that keeps off the origin."""
    away = x * x + y * y
    first = (x.value * y.first - y.value * x.first) / away.value
    bend = x.value * y.second - y.value * x.second
    second = (bend - first * away.first) / away.value
    # from the middle of the vectors, up to what the farthest of them is off it
    a, b = (x.value.low + x.value.high) / 2.0, (y.value.low + y.value.high) / 2.0
    off = np.hypot(x.value.high - a, y.value.high - b) / np.hypot(a, b)
    with np.errstate(invalid="ignore"):
        wide = np.where(off < 1.0, np.arcsin(off), np.nan) + ROUND_OFF
    middle = np.arctan2(b, a)
    return Jet(Interval(middle - wide, middle + wide), first, second)


Vector = list[Jet]
Number = TypeVar("Number", Interval, Jet)


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product."""
    return [a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3] for k in range(3)]


def unit(v: Vector) -> Vector:
    """Return a vector of length 1."""
    length = dot(v, v).root()
    return [one / length for one in v]
