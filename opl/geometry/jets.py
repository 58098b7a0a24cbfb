"""Intervals, and functions enclosed with their first two derivatives.

An interval is its middle and its radius, in arrays: one for each cell that is looked at. Operations
give intervals that hold every result; round-off, some 1e-15 of the numbers in it, is left to who
uses the result. Where an operation is not defined everywhere in an interval, the result is not
finite, and so is whatever is computed from it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array


@dataclass(frozen=True)
class Interval:
    """Numbers known up to a radius.

    Attributes:
        middle: Any shape.
        radius: Not negative, broadcasts with the middle.
    """

    middle: Array
    radius: Array

    @property
    def low(self) -> Array:
        """The least numbers."""
        return self.middle - self.radius

    @property
    def high(self) -> Array:
        """The greatest numbers."""
        return self.middle + self.radius

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.middle + other.middle, self.radius + other.radius)

    def __sub__(self, other: Interval) -> Interval:
        return Interval(self.middle - other.middle, self.radius + other.radius)

    def __neg__(self) -> Interval:
        return Interval(-self.middle, self.radius)

    def __mul__(self, other: Interval) -> Interval:
        a, r = np.abs(self.middle), self.radius
        b, s = np.abs(other.middle), other.radius
        return Interval(self.middle * other.middle, a * s + r * b + r * s)

    def times(self, factor: float) -> Interval:
        """Return the multiples by an exact number."""
        return Interval(factor * self.middle, abs(factor) * self.radius)

    def scaled(self, factors: Array) -> Interval:
        """Return the multiples by exact numbers that broadcast with these."""
        return Interval(factors * self.middle, np.abs(factors) * self.radius)

    def __truediv__(self, other: Interval) -> Interval:
        product = (other.middle - other.radius) * (other.middle + other.radius)
        apart = np.where(product > 0.0, product, np.nan)
        return self * Interval(other.middle / apart, other.radius / apart)

    def root(self) -> Interval:
        """Return the square roots, 0 of what is less than 0."""
        low, high = np.sqrt(np.maximum(self.low, 0.0)), np.sqrt(np.maximum(self.high, 0.0))
        return Interval((low + high) / 2.0, (high - low) / 2.0)


@dataclass(frozen=True)
class Jet:
    """A function of one variable over cells of it.

    Attributes:
        value: Holds its values in each cell.
        first: Holds its first derivative.
        second: Holds its second derivative.
    """

    value: Interval
    first: Interval
    second: Interval

    def __add__(self, other: Jet) -> Jet:
        return Jet(self.value + other.value, self.first + other.first, self.second + other.second)

    def __sub__(self, other: Jet) -> Jet:
        return Jet(self.value - other.value, self.first - other.first, self.second - other.second)

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.first, -self.second)

    def __mul__(self, other: Jet) -> Jet:
        first = self.value * other.first + self.first * other.value
        both = (self.first * other.first).times(2.0)
        second = self.value * other.second + both + self.second * other.value
        return Jet(self.value * other.value, first, second)

    def __truediv__(self, other: Jet) -> Jet:
        value = self.value / other.value
        first = (self.first - value * other.first) / other.value
        rest = self.second - (first * other.first).times(2.0) - value * other.second
        return Jet(value, first, rest / other.value)

    def times(self, factor: float) -> Jet:
        """Return the multiple by an exact number."""
        return Jet(self.value.times(factor), self.first.times(factor), self.second.times(factor))

    def scaled(self, factors: Array) -> Jet:
        """Return the multiples by exact numbers that broadcast with the cells."""
        return Jet(
            self.value.scaled(factors), self.first.scaled(factors), self.second.scaled(factors)
        )

    def plus(self, number: Array | float) -> Jet:
        """Return the sum with an exact number."""
        value = Interval(self.value.middle + number, self.value.radius)
        return Jet(value, self.first, self.second)

    def root(self) -> Jet:
        """Return the square root."""
        value = self.value.root()
        double = value.times(2.0)
        first = self.first / double
        return Jet(value, first, (self.second - (first * first).times(2.0)) / double)


@dataclass(frozen=True)
class Turning:
    """An angle and how fast it turns, over cells.

    Attributes:
        angle: Holds the angle in [rad].
        first: Holds its first derivative in [rad] per unit of the variable.
        second: Holds its second derivative.
    """

    angle: Interval
    first: Interval
    second: Interval

    def __add__(self, other: Turning) -> Turning:
        return Turning(
            self.angle + other.angle, self.first + other.first, self.second + other.second
        )

    def __sub__(self, other: Turning) -> Turning:
        return self + -other

    def __neg__(self) -> Turning:
        return Turning(-self.angle, -self.first, -self.second)

    def scaled(self, factors: Array) -> Turning:
        """Return the multiples by exact numbers that broadcast with the cells."""
        return Turning(
            self.angle.scaled(factors), self.first.scaled(factors), self.second.scaled(factors)
        )

    def plus(self, angle: Array | float) -> Turning:
        """Return it turned by exact angles in [rad]."""
        turned = Interval(self.angle.middle + angle, self.angle.radius)
        return Turning(turned, self.first, self.second)


def turning(sine: Jet, cosine: Jet) -> Turning:
    """Return how the angle turns whose sine and cosine these are, up to a common length."""
    length = sine.value * sine.value + cosine.value * cosine.value
    numerator = cosine.value * sine.first - sine.value * cosine.first
    first = numerator / length
    change = cosine.value * sine.second - sine.value * cosine.second
    half = cosine.value * cosine.first + sine.value * sine.first
    # sine and cosine lie in a rectangle: from its middle it is seen under this angle at the most
    middle = np.arctan2(sine.value.middle, cosine.value.middle)
    away = np.hypot(sine.value.middle, cosine.value.middle)
    off = np.hypot(sine.value.radius, cosine.value.radius)
    seen = np.arcsin(np.divide(off, away, out=np.full_like(away, np.nan), where=off < away))
    return Turning(Interval(middle, seen), first, (change - (first * half).times(2.0)) / length)


def constant(value: Array, like: Array) -> Jet:
    """Return exact numbers that do not change, of the shape of ``like``."""
    zero = Interval(np.zeros_like(like), np.zeros_like(like))
    return Jet(Interval(np.broadcast_to(value, like.shape), zero.radius), zero, zero)


def variable(middle: Array, radius: Array) -> Jet:
    """Return the variable itself, over cells about ``middle``."""
    ones, zeros = np.ones_like(middle), np.zeros_like(middle)
    return Jet(Interval(middle, radius), Interval(ones, zeros), Interval(zeros, zeros))


def wave(cosine: Array, sine: Array, middle: Array, radius: Array, rate: float) -> Jet:
    """Return ``cosine`` * cos(rate * u) + ``sine`` * sin(rate * u) over cells of u.

    Args:
        cosine: Amplitudes, shape (n,).
        sine: Amplitudes, shape (n,).
        middle: Middle of each cell, shape (n,).
        radius: Half its width, below a quarter of a turn, shape (n,).
        rate: What one unit of u turns, in [rad].
    """
    c, s = np.cos(rate * middle), np.sin(rate * middle)
    value, slope = cosine * c + sine * s, sine * c - cosine * s
    near, off = np.cos(rate * radius), np.sin(rate * radius)

    def about(level: Array, change: Array, factor: float) -> Interval:
        # level * cos(d) + change * sin(d) for every |d| up to the radius
        spread = np.abs(level) * (1.0 - near) / 2.0 + np.abs(change) * off
        return Interval(level * (1.0 + near) / 2.0, spread).times(factor)

    return Jet(
        about(value, slope, 1.0),
        about(slope, -value, rate),
        about(-value, -slope, rate * rate),
    )
