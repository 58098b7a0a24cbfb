"""Where to put points on a curve so that the straight lines between them stay near to it.

The step follows the curvature by way of the bow height, the largest distance of the curve from the
chord of a step. It is measured rather than taken from a formula, so it holds where the curvature
changes within a step.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.sections import SectionCurve

# a bow is measured at its curve's own nodes and at this many more points; the largest distance may
# lie between two of them and be larger by the fraction 1 / n^2 of a parabola
_BOW_SAMPLES = 32
_BOW_FRACTIONS = np.linspace(0.0, 1.0, _BOW_SAMPLES + 1)
_MEASURED = 1.0 - 1.0 / _BOW_SAMPLES**2

# the last step of a pass uses this fraction of what the others may use, within so many trials
_BALANCED = 0.97
_BALANCING_TRIALS = 8

# a step this near to its limits, as a fraction of them, needs no better one
_LONGEST = 0.9995

# fraction of the largest step that is not worth a step of its own
_ROUNDING = 1e-9


def balanced_steps(curve: SectionCurve, max_bow_height: float, largest_step: float) -> Array:
    """Return the arc lengths of the fewest points that keep both limits, shape (k,).

    The longest possible steps give the number. Then all are made smaller by the same scale as long
    as the number stays, until the last one, which took what was left over, is like the others.

    Args:
        curve: What to step along.
        max_bow_height: Largest distance in [m] of the curve from the chord of a step.
        largest_step: Largest length in [m] of a step along the curve.
    """
    best = _longest_steps(curve, max_bow_height, largest_step)
    n = len(best) - 1
    # n - 1 steps of full length fall short of the end, so n steps of this scale do too
    low, high = (n - 1) / n, 1.0
    for _ in range(_BALANCING_TRIALS):
        fill = _size(curve, best[-2], best[-1], max_bow_height, largest_step) / high
        if fill >= _BALANCED:
            break
        # what the last step lacks is shared by all, but for a hair that lets the end be reached
        scale = high * (n - 1.0 + fill + 0.01) / n
        if scale <= low:
            scale = 0.5 * (low + high)
        nodes = _longest_steps(curve, scale**2 * max_bow_height, scale * largest_step)
        if len(nodes) <= len(best):
            best, high = nodes, scale
        else:
            low = scale
    return best


def _longest_steps(curve: SectionCurve, max_bow_height: float, largest_step: float) -> Array:
    """Return the arc lengths of points along a curve, each as far from the last as it may be."""
    nodes = [0.0]
    while nodes[-1] < curve.length:
        nodes.append(_farthest(curve, nodes[-1], max_bow_height, largest_step))
    return np.array(nodes)


def _farthest(
    curve: SectionCurve, start: float, max_bow_height: float, largest_step: float
) -> float:
    """Return the end of the longest step from ``start``.

    The root of size = 1 is sought by linear interpolation; every third time the bracket is halved,
    so that it shrinks on any curve.
    """
    near, near_size = start, 0.0
    far = start + largest_step
    if far > curve.length - _ROUNDING * largest_step:
        far = curve.length
    far_size = _size(curve, start, far, max_bow_height, largest_step)
    if far_size <= 1.0 + 2.0 * _ROUNDING:
        return far
    trial = 0
    # the measured bow jumps a little where one more node of the curve comes in: the root may not be
    while near_size < _LONGEST and far - near > _ROUNDING * largest_step:
        trial += 1
        aim = 0.5 * (1.0 + _LONGEST)
        fraction = (aim - near_size) / (far_size - near_size) if trial % 3 else 0.5
        end = near + fraction * (far - near)
        size = _size(curve, start, end, max_bow_height, largest_step)
        if size <= 1.0:
            near, near_size = end, size
        else:
            far, far_size = end, size
    return near


def _size(
    curve: SectionCurve, start: float, end: float, max_bow_height: float, largest_step: float
) -> float:
    """Return how much of its limits a step uses, 1.0 where one is reached; linear on a circle."""
    bow_height = _bow_height(curve, start, end)
    return max((end - start) / largest_step, np.sqrt(bow_height / (_MEASURED * max_bow_height)))


def _bow_height(curve: SectionCurve, start: float, end: float) -> float:
    """Return the largest distance in [m] of a curve from its chord, measured."""
    nodes = curve.arc_length
    inside = nodes[nodes.searchsorted(start) : nodes.searchsorted(end)]
    points = curve.positions(np.concatenate([start + (end - start) * _BOW_FRACTIONS, inside]))
    points -= points[0]
    chord = points[_BOW_SAMPLES]
    # a closed curve may come back to where it started: no chord to divide by
    square = max(float(chord @ chord), np.finfo(float).tiny)
    fraction = np.minimum(np.maximum(points @ chord / square, 0.0), 1.0)
    away = points - fraction[:, None] * chord
    return float(np.sqrt(np.einsum("ij,ij->i", away, away).max()))
