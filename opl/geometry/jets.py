"""Intervals, and functions enclosed with their first two derivatives.

An interval is its middle and its radius, for each cell that is looked at. Operations give intervals
that hold every result; round-off, some 1e-15 of the numbers in it, is left to who uses the result.
Where an operation is not defined everywhere in an interval, the result is not finite, and so is
whatever is computed from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from opl.files.kernels import Kernel, kernel
from opl.geometry.frames import Array

Own = TypeVar("Own", bound="Enclosed")
_UNARY = "void(f8[:,::1], f8[:,::1])"
_BINARY = "void(f8[:,::1], f8[:,::1], f8[:,::1])"


@dataclass(frozen=True)
class Interval:
    """Numbers known up to a radius.

    Attributes:
        middle: Any shape.
        radius: Not negative, of the same shape.
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


@dataclass(frozen=True)
class Enclosed:
    """A function of one variable over cells of it, or what can be added up likewise.

    Attributes:
        data: Middle and radius of what holds its value in each cell, then of its first derivative,
            then of its second, shape (6, ...).
    """

    data: Array

    @property
    def value(self) -> Interval:
        """Holds its values."""
        return Interval(self.data[0], self.data[1])

    @property
    def first(self) -> Interval:
        """Holds its first derivative."""
        return Interval(self.data[2], self.data[3])

    @property
    def second(self) -> Interval:
        """Holds its second derivative."""
        return Interval(self.data[4], self.data[5])

    def __add__(self: Own, other: Own) -> Own:
        return type(self)(np.add(*_of_one_shape(self, other)))

    def __sub__(self: Own, other: Own) -> Own:
        return self + -other

    def __neg__(self: Own) -> Own:
        opposite = self.data.copy()
        np.negative(opposite[::2], out=opposite[::2])
        return type(self)(opposite)

    def scaled(self: Own, factors: Array | float) -> Own:
        """Return the multiples by exact numbers that broadcast with the cells."""
        multiples = _spread(self.data, np.shape(factors)) * factors
        np.abs(multiples[1::2], out=multiples[1::2])
        return type(self)(multiples)

    def plus(self: Own, numbers: Array | float) -> Own:
        """Return the sum with exact numbers that broadcast with the cells."""
        total = _spread(self.data, np.shape(numbers)).copy()
        total[0] += numbers
        return type(self)(total)


class Jet(Enclosed):
    """A function of one variable over cells of it."""

    def __mul__(self, other: Jet) -> Jet:
        return Jet(_computed(_product, *_of_one_shape(self, other)))

    def __truediv__(self, other: Jet) -> Jet:
        return Jet(_computed(_quotient, *_of_one_shape(self, other)))

    def root(self) -> Jet:
        """Return the square root; of values less than 0 that of 0."""
        return Jet(_computed(_root, self.data))


class Turning(Enclosed):
    """An angle in [rad] and how fast it turns, over cells."""


def turning(sine: Jet, cosine: Jet) -> Turning:
    """Return how the angle turns whose sine and cosine these are, up to a common length."""
    s, c = _of_one_shape(sine, cosine)
    turned = _computed(_turning, s, c)
    # sine and cosine lie in a rectangle: from its middle it is seen under this angle at the most
    away, off = np.hypot(s[0], c[0]), np.hypot(s[1], c[1])
    np.arctan2(s[0], c[0], out=turned[0])
    turned[1] = np.arcsin(np.divide(off, away, out=np.full_like(away, np.nan), where=off < away))
    return Turning(turned)


def constant(value: float, like: Array) -> Jet:
    """Return an exact number that does not change, over cells of the shape of ``like``."""
    data = np.zeros((6, *np.shape(like)))
    data[0] = value
    return Jet(data)


def variable(middle: Array, radius: Array) -> Jet:
    """Return the variable itself, over cells about ``middle``."""
    data = np.zeros((6, *np.shape(middle)))
    data[0], data[1], data[2] = middle, radius, 1.0
    return Jet(data)


def wave(cosine: Array, sine: Array, middle: Array, radius: Array, rate: float) -> Jet:
    """Return ``cosine`` * cos(rate * u) + ``sine`` * sin(rate * u) over cells of u.

    Args:
        cosine: Amplitudes, shape (..., n).
        sine: Amplitudes, shape (..., n).
        middle: Middle of each cell, shape (n,).
        radius: Half its width, below a quarter of a turn, shape (n,).
        rate: What one unit of u turns, in [rad].
    """
    c, s = np.cos(rate * middle), np.sin(rate * middle)
    value, slope = cosine * c + sine * s, sine * c - cosine * s
    near, off = np.cos(rate * radius), np.sin(rate * radius)
    inward, outward = (1.0 - near) / 2.0, (1.0 + near) / 2.0
    data = np.empty((6, *value.shape))
    # level * cos(d) + change * sin(d) for every |d| up to the radius
    for order, (level, change) in enumerate(((value, slope), (slope, -value), (-value, -slope))):
        data[2 * order] = level * outward * rate**order
        data[2 * order + 1] = (np.abs(level) * inward + np.abs(change) * off) * rate**order
    return Jet(data)


def _spread(data: Array, shape: tuple[int, ...]) -> Array:
    """Return data broadcast with cells of some shape."""
    cells = data.shape[1:]
    whole = np.broadcast_shapes(cells, shape)
    data = data.reshape(6, *(1,) * (len(whole) - len(cells)), *cells)
    return data if data.shape[1:] == whole else np.broadcast_to(data, (6, *whole))


def _of_one_shape(one: Enclosed, other: Enclosed) -> tuple[Array, Array]:
    """Return the data of two over the same cells."""
    a, b = one.data, other.data
    if a.shape == b.shape:
        return a, b
    return _spread(a, b.shape[1:]), _spread(b, a.shape[1:])


def _computed(made: Kernel, *given: Array) -> Array:
    """Return what a kernel makes of data, shape (6, ...) each."""
    found = np.empty(given[0].shape)
    made(*(np.ascontiguousarray(one).reshape(6, -1) for one in given), found.reshape(6, -1))
    return found


# In the kernels an interval is a pair of its middle and its radius.


@kernel()
def _sum(one, other):  # type: ignore[no-untyped-def]
    return one[0] + other[0], one[1] + other[1]


@kernel()
def _difference(one, other):  # type: ignore[no-untyped-def]
    return one[0] - other[0], one[1] + other[1]


@kernel()
def _by(one, other):  # type: ignore[no-untyped-def]
    a, r, b, s = one[0], one[1], other[0], other[1]
    return a * b, abs(a) * s + r * abs(b) + r * s


@kernel()
def _double(one):  # type: ignore[no-untyped-def]
    return 2.0 * one[0], 2.0 * one[1]


@kernel()
def _inverse(one):  # type: ignore[no-untyped-def]
    """Return the inverse of an interval, not finite if it holds 0."""
    apart = (one[0] - one[1]) * (one[0] + one[1])
    if not apart > 0.0:
        apart = np.nan
    return one[0] / apart, one[1] / apart


@kernel()
def _of(data, n):  # type: ignore[no-untyped-def]
    """Return value, first and second derivative in a cell."""
    return (data[0, n], data[1, n]), (data[2, n], data[3, n]), (data[4, n], data[5, n])


@kernel()
def _put(data, n, value, first, second):  # type: ignore[no-untyped-def]
    data[0, n], data[1, n] = value
    data[2, n], data[3, n] = first
    data[4, n], data[5, n] = second


@kernel(_BINARY, early=True)
def _product(a, b, found):  # type: ignore[no-untyped-def]
    for n in range(a.shape[1]):
        v, f, s = _of(a, n)
        w, g, t = _of(b, n)
        first = _sum(_by(v, g), _by(f, w))
        second = _sum(_sum(_by(v, t), _double(_by(f, g))), _by(s, w))
        _put(found, n, _by(v, w), first, second)


@kernel(_BINARY, early=True)
def _quotient(a, b, found):  # type: ignore[no-untyped-def]
    for n in range(a.shape[1]):
        v, f, s = _of(a, n)
        w, g, t = _of(b, n)
        inverse = _inverse(w)
        value = _by(v, inverse)
        first = _by(_difference(f, _by(value, g)), inverse)
        rest = _difference(_difference(s, _double(_by(first, g))), _by(value, t))
        _put(found, n, value, first, _by(rest, inverse))


@kernel(_UNARY, early=True)
def _root(a, found):  # type: ignore[no-untyped-def]
    for n in range(a.shape[1]):
        v, f, s = _of(a, n)
        low, high = np.sqrt(max(v[0] - v[1], 0.0)), np.sqrt(max(v[0] + v[1], 0.0))
        value = (low + high) / 2.0, (high - low) / 2.0
        inverse = _inverse(_double(value))
        first = _by(f, inverse)
        _put(found, n, value, first, _by(_difference(s, _double(_by(first, first))), inverse))


@kernel(_BINARY, early=True)
def _turning(sine, cosine, found):  # type: ignore[no-untyped-def]
    """Set how fast an angle turns, and nothing of where it is."""
    for n in range(sine.shape[1]):
        v, f, s = _of(sine, n)
        w, g, t = _of(cosine, n)
        inverse = _inverse(_sum(_by(v, v), _by(w, w)))
        first = _by(_difference(_by(w, f), _by(v, g)), inverse)
        half = _sum(_by(w, g), _by(v, f))
        change = _difference(_by(w, s), _by(v, t))
        second = _by(_difference(change, _double(_by(first, half))), inverse)
        _put(found, n, (0.0, 0.0), first, second)
