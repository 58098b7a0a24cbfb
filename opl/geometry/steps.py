"""Where to put points on a curve so that the straight lines between them stay near to it.

The step follows the curvature through the bow height, the largest distance of the curve from the
chord of a step. It is measured rather than taken from a formula, so it holds where the curvature
changes within a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from opl.geometry.curves import SurfaceCurve
from opl.geometry.frames import Array

# a bow is measured at its curve's own nodes and at this many more points; the largest distance may
# lie between two of them and be larger by the fraction 1 / n^2 of a parabola
_BOW_SAMPLES = 32
_BOW_FRACTIONS = np.linspace(0.0, 1.0, _BOW_SAMPLES + 1)
_MEASURED = 1.0 - 1.0 / _BOW_SAMPLES**2

# rounds in which steps are shared out anew before they are laid one after the other
_SHARINGS = 10

# after half of them this fraction of the steps may be more than the fewest: a long curve over the
# facets of a mesh has no even steps
_SPARE = 0.02

# the last step of a pass uses this fraction of what the others may use, within so many trials
_BALANCED = 0.97
_BALANCING_TRIALS = 8

# a step this near to its limits, as a fraction of them, needs no better one
_LONGEST = 0.9995

# nor is it sought more finely than this fraction of its length
_SEARCHED = 1e-5

# fraction of a step that is not worth a step of its own
_ROUNDING = 1e-9


# points of all passes together: more than anybody plans
MOST_POINTS = 20_000


class TooManyStepsError(ValueError):
    """Steps so short that there would be more points than can be planned.

    Attributes:
        limit: Which limit makes them so short, ``largest_step`` or ``max_bow_height``.
    """

    def __init__(self, limit: str, value: float, count: float) -> None:
        super().__init__(
            f"{1e3 * value:g} mm makes about {count:.0f} cutter points; at most {MOST_POINTS} "
            "are planned"
        )
        self.limit = limit


def steps_of(
    curves: Sequence[SurfaceCurve], max_bow_height: float, largest_step: float
) -> list[Array]:
    """Return the steps of all curves, each as of `balanced_steps`.

    Raises:
        TooManyStepsError: If they have more than `MOST_POINTS` points together.
    """
    length = sum(curve.length for curve in curves)
    if length > MOST_POINTS * largest_step:
        raise TooManyStepsError("largest_step", largest_step, length / largest_step)
    steps: list[Array] = []
    done, n = 0.0, 0
    for curve in curves:
        steps.append(balanced_steps(curve, max_bow_height, largest_step))
        done, n = done + curve.length, n + len(steps[-1])
        if n > MOST_POINTS:
            raise TooManyStepsError("max_bow_height", max_bow_height, n * length / done)
    return steps


def balanced_steps(curve: SurfaceCurve, max_bow_height: float, largest_step: float) -> Array:
    """Return the arc lengths of the fewest points that keep both limits, shape (k,).

    Both ends are points, and so is every place where the curvature jumps; the steps in between use
    about as much of the limits as each other.

    Args:
        curve: What to step along.
        max_bow_height: Largest distance in [m] of the curve from the chord of a step.
        largest_step: Largest length in [m] of a step along the curve.
    """
    stepping = _Stepping(curve, max_bow_height, largest_step)
    nodes = [np.zeros(1)]
    for start, stop in pairwise([0.0, *curve.breaks.tolist(), curve.length]):
        span = stepping.shared_out(start, stop)
        nodes.append((stepping.balanced(start, stop) if span is None else span)[1:])
    return np.concatenate(nodes)


@dataclass(frozen=True, eq=False)
class _Stepping:
    """A curve and the limits of its steps, as in `balanced_steps`."""

    curve: SurfaceCurve
    max_bow_height: float
    largest_step: float

    def shared_out(self, start: float, stop: float) -> Array | None:
        """Return balanced steps where a few looks at all of them at once are enough, else None.

        A step's size is what it uses of the limits. On a circle, and nearly so elsewhere, sizes add
        up along the curve: their sum gives the number of steps, and steps that share it evenly are
        balanced.
        """
        nodes = np.linspace(start, stop, _count((stop - start) / self.largest_step) + 1)
        for trial in range(_SHARINGS):
            sizes = self._sizes(nodes)
            n = _count(float(sizes.sum()))
            if trial >= _SHARINGS // 2:
                n += int(_SPARE * n)
            if sizes.max() <= 1.0 and len(sizes) <= n:
                return nodes
            shared = np.append(0.0, np.cumsum(sizes))
            nodes = np.interp(np.linspace(0.0, shared[-1], n + 1), shared, nodes)
            nodes[0], nodes[-1] = start, stop
        return None

    def balanced(self, start: float, stop: float) -> Array:
        """Return the fewest steps, balanced as well as they may be.

        The longest possible steps give the number. Then all are made smaller by the same scale as
        long as the number stays, until the last one, which took what was left over, is like the
        others.
        """
        best = self._longest_steps(start, stop)
        n = len(best) - 1
        # n - 1 steps of full length fall short of the end, so n steps of this scale do too
        low, high = (n - 1) / n, 1.0
        for _ in range(_BALANCING_TRIALS):
            fill = self._size(best[-2], best[-1]) / high
            if fill >= _BALANCED:
                break
            # what the last step lacks is shared by all, but for a hair that lets the end be reached
            scale = high * (n - 1.0 + fill + 0.01) / n
            if scale <= low:
                scale = 0.5 * (low + high)
            smaller = _Stepping(
                self.curve, scale**2 * self.max_bow_height, scale * self.largest_step
            )
            nodes = smaller._longest_steps(start, stop)
            if len(nodes) <= len(best):
                best, high = nodes, scale
            else:
                low = scale
        return best

    def _longest_steps(self, start: float, stop: float) -> Array:
        nodes = [start]
        while nodes[-1] < stop:
            nodes.append(self._farthest(nodes[-1], stop))
        return np.array(nodes)

    def _farthest(self, start: float, stop: float) -> float:
        """Return the end of the longest step from ``start``, ``stop`` at most.

        The root of size = 1 is sought by linear interpolation; every third time the bracket is
        halved, so that it shrinks on any curve.
        """
        near, near_size = start, 0.0
        far = start + self.largest_step
        if far > stop - _ROUNDING * self.largest_step:
            far = stop
        far_size = self._size(start, far)
        if far_size <= 1.0:
            return far
        trial = 0
        # the measured bow jumps a little where one more node of the curve comes in: there may be
        # no root
        while near_size < _LONGEST and far - near > _SEARCHED * (far - start):
            trial += 1
            aim = 0.5 * (1.0 + _LONGEST)
            fraction = (aim - near_size) / (far_size - near_size) if trial % 3 else 0.5
            end = near + fraction * (far - near)
            size = self._size(start, end)
            if size <= 1.0:
                near, near_size = end, size
            else:
                far, far_size = end, size
        return near

    def _size(self, start: float, end: float) -> float:
        return float(self._sizes(np.array([start, end]))[0])

    def _sizes(self, nodes: Array) -> Array:
        """Return how much of its limits each step uses, 1.0 at a limit; linear on a circle.

        A hair over the largest step is rounding and not counted.
        """
        lengths = np.diff(nodes) / (self.largest_step * (1.0 + 2.0 * _ROUNDING))
        bows = _bow_heights(self.curve, nodes)
        return np.maximum(lengths, np.sqrt(bows / (_MEASURED * self.max_bow_height)))


def _count(size: float) -> int:
    return max(int(np.ceil(size - _ROUNDING * max(size, 1.0))), 1)


def _bow_heights(curve: SurfaceCurve, nodes: Array) -> Array:
    """Return the largest distance in [m] of a curve from the chord of each step, measured."""
    looks = nodes[:-1, None] + np.diff(nodes)[:, None] * _BOW_FRACTIONS
    points = curve.positions(looks)
    origins, chords = points[:, 0], points[:, -1] - points[:, 0]
    away = _away(points - origins[:, None], chords[:, None]).max(axis=1)
    own = curve.arc_length
    inner = own[own.searchsorted(nodes[0], "right") : own.searchsorted(nodes[-1])]
    step = nodes.searchsorted(inner, "right") - 1
    np.maximum.at(away, step, _away(curve.positions(inner) - origins[step], chords[step]))
    return np.asarray(np.sqrt(away))


def _away(points: Array, chords: Array) -> Array:
    """Return the squared distance of points from chords that begin at the origin."""
    # a closed curve may come back to where it started: no chord to divide by
    square = np.maximum(np.sum(chords * chords, axis=-1), np.finfo(float).tiny)
    fraction = np.clip(np.sum(points * chords, axis=-1) / square, 0.0, 1.0)
    away = points - fraction[..., None] * chords
    return np.asarray(np.sum(away * away, axis=-1))
