"""Cutter points of a surface by the equal-section method.

Parallel planes one row pitch apart cut the surface into curves; along each curve the step follows
the curvature so that the bow height, the largest distance of the curve from its chord, stays within
a tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.nurbs import NurbsSurface
from opl.geometry.sections import Section, SectionCurve, extent_along, sample_grid, section_curves

Array = NDArray[np.float64]

# a bow is measured at its curve's own nodes and at this many more points; the largest distance may
# lie between two of them and be larger by the fraction 1 / n^2 of a parabola
_BOW_SAMPLES = 32
_BOW_FRACTIONS = np.linspace(0.0, 1.0, _BOW_SAMPLES + 1)
_MEASURED = 1.0 - 1.0 / _BOW_SAMPLES**2

# error of the interpolated curve as a fraction of the bow height
_CURVE_ERROR = 1e-3

# halvings of the interval in which the least size of n steps is sought
_BALANCING_ROUNDS = 6


@dataclass(frozen=True, eq=False)
class CutterPoints:
    """Points to be ground one after the other, in passes. Arrays are read-only copies.

    Attributes:
        Ts_workpiece_cutter: Cutter frames {M_i} of Zhang et al. (2019): z outward normal of the
            surface, x tangent of the path, y = z cross x; shape (N, 4, 4).
        pass_index: Pass of each point, 0, 1, ... without a gap, shape (N,).
        arc_length: Distance in [m] from the start of the point's own pass along the path, shape
            (N,).

    Raises:
        ValueError: If the shapes differ or the passes are not numbered in order.
    """

    Ts_workpiece_cutter: Array
    pass_index: NDArray[np.int64]
    arc_length: Array

    def __post_init__(self) -> None:
        Ts = np.array(self.Ts_workpiece_cutter, dtype=float)
        pass_index = np.array(self.pass_index, dtype=np.int64)
        arc_length = np.array(self.arc_length, dtype=float)
        n = len(Ts)
        if Ts.shape != (n, 4, 4) or pass_index.shape != (n,) or arc_length.shape != (n,):
            raise ValueError(
                f"cutter points: shapes must be (N, 4, 4), (N,) and (N,), got {Ts.shape}, "
                f"{pass_index.shape} and {arc_length.shape}"
            )
        if not np.isin(np.diff(pass_index, prepend=-1), (0, 1)).all() or pass_index[:1].any():
            raise ValueError("pass_index: must count up from 0 without a gap")
        for name, array in (
            ("Ts_workpiece_cutter", Ts),
            ("pass_index", pass_index),
            ("arc_length", arc_length),
        ):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.pass_index)

    @property
    def n_passes(self) -> int:
        """Return the number of passes."""
        return int(self.pass_index[-1]) + 1 if len(self) else 0


def equal_section_passes(
    surface: NurbsSurface,
    plane_normal: Array,
    *,
    pitch: float,
    margin: float,
    rows: int | None,
    max_bow_height: float,
    largest_step: float,
    zigzag: bool,
    reversed_normal: bool,
) -> CutterPoints:
    """Return the cutter points where parallel planes cut a surface.

    The rows lie in the middle of the surface's extent along the planes' normal, in order along it.
    A pass is travelled along x = outward normal cross ``plane_normal``. In zigzag every second row
    is travelled backwards, but its frames keep their axis x: the part is not turned round on the
    belt, so there the path runs along -x. A plane that cuts the surface more than once gives as
    many passes.

    Args:
        surface: The surface to grind.
        plane_normal: Normal of the planes, of any length, shape (3,).
        pitch: Distance of the planes in [m].
        margin: Least distance in [m] of a plane from both ends of the surface along the normal.
        rows: Number of planes; None for as many as fit.
        max_bow_height: Largest distance in [m] of the path from the chord of a step.
        largest_step: Largest length in [m] of a step along the path.
        zigzag: Whether every second row is travelled backwards.
        reversed_normal: Whether the outward normal is -(du x dv).

    Raises:
        DegenerateNormalError: If a pass runs through a place where the surface has no normal.
        ValueError: If a value is out of its range, if the rows do not fit, or if a plane misses or
            merely touches the surface.
    """
    for name, value in (
        ("pitch", pitch),
        ("max_bow_height", max_bow_height),
        ("largest_step", largest_step),
    ):
        if not value > 0.0:
            raise ValueError(f"{name}: must be positive, got {value:g}")
    length = float(np.linalg.norm(plane_normal))
    if not length > 0.0:
        raise ValueError("plane_normal: must not be zero")
    plane_normal = np.asarray(plane_normal, dtype=np.float64) / length

    grid = sample_grid(surface)
    offsets = _row_offsets(*extent_along(surface, grid, plane_normal), pitch, margin, rows)
    outward = -1.0 if reversed_normal else 1.0
    Ts, arc_lengths = [], []
    for row, offset in enumerate(offsets):
        section = Section(surface, plane_normal, float(offset), outward)
        curves = section_curves(section, grid, _CURVE_ERROR * max_bow_height)
        if not curves:
            raise ValueError(
                f"row {row + 1}, {1e3 * offset:.4g} mm along the plane normal: the "
                "plane does not cut the surface"
            )
        backwards = zigzag and row % 2 == 1
        for curve in reversed(curves) if backwards else curves:
            nodes = _balanced_steps(curve, max_bow_height, largest_step)
            Ts_pass = curve.frames(nodes)
            Ts.append(Ts_pass[::-1] if backwards else Ts_pass)
            arc_lengths.append((curve.length - nodes)[::-1] if backwards else nodes)
    return CutterPoints(
        Ts_workpiece_cutter=np.concatenate(Ts),
        pass_index=np.repeat(np.arange(len(Ts)), [len(Ts_pass) for Ts_pass in Ts]),
        arc_length=np.concatenate(arc_lengths),
    )


def _row_offsets(low: float, high: float, pitch: float, margin: float, rows: int | None) -> Array:
    """Return the offsets of the planes in [m], centred between two ends."""
    rounding = 1e-9 * (high - low)
    room = high - low - 2.0 * margin
    n_fitting = int((room + rounding) // pitch) + 1 if room >= -rounding else 0
    if n_fitting == 0 or (rows is not None and not 1 <= rows <= n_fitting):
        wanted = "a row" if rows is None else f"{rows} rows"
        raise ValueError(
            f"rows: {wanted} of pitch {1e3 * pitch:g} mm do not fit; between margins of "
            f"{1e3 * margin:g} mm on {1e3 * (high - low):.6g} mm there is room for {n_fitting}"
        )
    n = n_fitting if rows is None else rows
    return 0.5 * (low + high) + pitch * (np.arange(n, dtype=np.float64) - 0.5 * (n - 1))


def _balanced_steps(curve: SectionCurve, max_bow_height: float, largest_step: float) -> Array:
    """Return the arc lengths of the fewest points that keep both limits, shape (k,).

    The longest possible steps give the number; then the least scale of the two limits that still
    gives this number spreads what would be left over evenly.
    """
    best = _longest_steps(curve, max_bow_height, largest_step)
    n = len(best) - 1
    # n - 1 steps of full length fall short of the end, so n steps this much shorter do as well
    low, high = (n - 1) / n, 1.0
    for _ in range(_BALANCING_ROUNDS):
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
        start = nodes[-1]
        end = min(start + largest_step, curve.length)
        nodes.append(_farthest(curve, start, end, _MEASURED * max_bow_height))
    return np.array(nodes)


def _farthest(curve: SectionCurve, start: float, end: float, max_bow_height: float) -> float:
    """Return the end of a step from ``start``, at ``end`` or where the bow height is reached.

    The bow grows as the square of the step, so its root is sought: a line on a circle. The bracket
    is kept by halving where the line does not narrow it.
    """
    size = np.sqrt(_bow_height(curve, start, end) / max_bow_height)
    if size <= 1.0:
        return end
    near, far = start, end
    near_size, far_size = 0.0, size
    for attempt in range(60):
        # aim a hair below: a step that comes this near needs no better one
        fraction = (0.9998 - near_size) / (far_size - near_size) if attempt % 3 < 2 else 0.5
        middle = near + fraction * (far - near)
        size = np.sqrt(_bow_height(curve, start, middle) / max_bow_height)
        if size <= 1.0:
            near, near_size = middle, size
            if size >= 0.9995:
                break
        else:
            far, far_size = middle, size
    return near


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
