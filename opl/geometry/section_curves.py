"""Where planes cut a surface: the curves that passes run along.

A curve is found as a contour line of the plane's equation on a grid of parameters. Its crossings
with the grid lines are made exact, then nodes are added between them until cubic Hermite
interpolation in the arc length reproduces the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from opl.geometry.curves import curvature_jumps, hermite_through
from opl.geometry.frames import Array
from opl.geometry.section import CONVERGED, MAX_NEWTON_STEPS, ON_PLANE, Section, Trace
from opl.geometry.surface_grid import SurfaceGrid

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

# how far beside a knot its two sides are looked at, as a fraction of the distance to the next node
_BESIDE = 1e-6

# normals on both sides of a knot that differ by more than this make a kink [rad]
_KINK = 1e-3

# largest turn of the tangent between two nodes of a curve [rad]
_LARGEST_TURN = 0.5


@dataclass(frozen=True, eq=False)
class FaceCurve:
    """A curve on a face, in the direction of the frames' axis x.

    Attributes:
        trace: What it is a curve of.
        uv: Parameters of its nodes, shape (k, 2).
        positions: The curve as a function of its arc length, (...,) to (..., 3).
        breaks: Inner arc lengths in [m] where the curvature jumps, shape (b,).
    """

    trace: Trace
    uv: Array
    positions: CubicHermiteSpline
    breaks: Array

    @property
    def arc_length(self) -> Array:
        """Return the arc length at its nodes in [m], from 0, shape (k,)."""
        return np.asarray(self.positions.x)

    @property
    def length(self) -> float:
        """Return the length in [m]."""
        return float(self.arc_length[-1])

    def parameters(self, arc_length: Array) -> Array:
        """Return the exact (u, v) at given arc lengths [m], shape (k, 2)."""
        nodes = self.arc_length
        uv = np.stack([np.interp(arc_length, nodes, p) for p in self.uv.T], axis=1)
        # a node may not be moved: not across the border, nor off the knot on which a break lies
        after = np.minimum(nodes.searchsorted(arc_length), len(nodes) - 1)
        inner = nodes[after] != arc_length
        targets, tangents = self.positions(arc_length), self.positions(arc_length, nu=1)
        uv[inner] = self.trace.closest(uv[inner], targets[inner], tangents[inner])
        return uv

    def frames(self, arc_length: Array) -> Array:
        """Return the exact Ts_workpiece_cutter at given arc lengths [m], shape (k, 4, 4)."""
        return self.trace.frames(self.parameters(arc_length))

    def bending(self, arc_length: Array) -> Array:
        """Return the curvature of the surface in [1/m] in axes x and y, shape (k, 2, 2)."""
        return self.trace.bending(self.parameters(arc_length))


def section_curves(section: Section, grid: SurfaceGrid, tolerance: float) -> list[FaceCurve]:
    """Return the curves in which a plane cuts a surface.

    A curve that crosses the seam of a closed surface is two curves that meet there. They come in
    no order.

    Args:
        section: The plane and the surface.
        grid: Grid of the surface; what falls between its lines is not seen.
        tolerance: Largest error in [m] of a curve's ``positions`` between its nodes.

    Raises:
        DegenerateNormalError: Where a curve runs through a place without normal.
        ValueError: Where the plane touches the surface, or a curve cannot be followed.
    """
    from contourpy import LineType, contour_generator

    heights = grid.points @ section.plane_normal
    # a plane through the border itself is sought just inside, then brought to its place
    hair = 1e-7 * np.ptp(heights)
    level = np.clip(section.offset, heights.min() + hair, heights.max() - hair)
    contours = contour_generator(grid.u, grid.v, heights.T, line_type=LineType.Separate)
    return [
        _refined(section, uv, tolerance)
        for line in cast(list[Array], contours.lines(level))
        if len(uv := _crossings(section, grid, line)) > 1
    ]


def _crossings(section: Section, grid: SurfaceGrid, line: Array) -> Array:
    """Return where the plane crosses the grid lines that a contour line crosses, shape (k, 2).

    Each point of a contour line lies on a line of the grid, between two others: one parameter is
    kept, and the root in the other lies in that bracket (Newton's method, halving where it leaves
    it). So the nodes keep their order, and those on the border stay there.
    """
    cells = [
        np.clip(np.searchsorted(lines, values, side="right") - 1, 0, len(lines) - 2)
        for lines, values in zip((grid.u, grid.v), line.T, strict=True)
    ]
    low = np.stack([grid.u[cells[0]], grid.v[cells[1]]], axis=1)
    high = np.stack([grid.u[cells[0] + 1], grid.v[cells[1] + 1]], axis=1)
    fraction = (line - low) / (high - low)
    kept = np.argmin(np.minimum(fraction, 1.0 - fraction), axis=1)
    each, free = np.arange(len(line)), 1 - kept
    uv = np.clip(line, low, high)  # the contour's last digit may lie outside
    uv[each, kept] = np.where(fraction < 0.5, low, high)[each, kept]

    def height(values: Array) -> tuple[Array, Array]:
        uv[each, free] = values
        S = section.surface.derivatives(uv, 1)
        slopes = np.where(free[:, None] == 0, S[:, 1, 0], S[:, 0, 1]) @ section.plane_normal
        return S[:, 0, 0] @ section.plane_normal - section.offset, slopes

    x, left, right = uv[each, free], low[each, free], high[each, free]
    left_height = height(left)[0]
    # where two grid lines meet may be the root but for a rounding error: no change of sign
    end = np.where(x - left < right - x, left, right)
    at_end = np.abs(height(end)[0]) <= ON_PLANE
    x, left, right = (np.where(at_end, end, values) for values in (x, left, right))
    for _ in range(MAX_NEWTON_STEPS):
        heights, slopes = height(x)
        searching = np.abs(heights) > CONVERGED
        if not searching.any():
            break
        on_left = heights * left_height > 0.0
        left, right = np.where(on_left, x, left), np.where(on_left, right, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = x - heights / slopes
        inside = (newton > left) & (newton < right)
        x = np.where(searching, np.where(inside, newton, 0.5 * (left + right)), x)
    # a plane sought just inside the border may not cross it at all
    uv = uv[np.abs(height(x)[0]) <= ON_PLANE]
    chords = np.linalg.norm(np.diff(section.surface.point(uv), axis=0), axis=1)
    return uv[np.append(chords > ON_PLANE, True)] if len(uv) else uv


def _refined(section: Section, uv: Array, tolerance: float) -> FaceCurve:
    """Direct a curve along axis x and add nodes where its interpolation is not good enough."""
    frames = section.frames(uv)
    chords = np.diff(frames[:, :3, 3], axis=0)
    if np.sum(chords * frames[1:, :3, 0]) < 0.0:
        uv = uv[::-1]
    while True:
        frames = section.frames(uv)
        points, tangents = frames[:, :3, 3], frames[:, :3, 0]
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        positions, turns = hermite_through(points, tangents)
        arc_length = np.asarray(positions.x)

        between = 0.5 * (arc_length[1:] + arc_length[:-1])
        targets, directions = positions(between), positions(between, nu=1)
        guesses = 0.5 * (uv[1:] + uv[:-1])
        middles = section.closest(guesses, targets, directions)
        exact = section.frames(middles)
        error = np.linalg.norm(exact[:, :3, 3] - targets, axis=1)
        # an error odd about the middle shows in the tangent there
        error += 0.25 * np.diff(arc_length) * np.linalg.norm(exact[:, :3, 0] - directions, axis=1)
        # a segment as short as the tolerance is a kink of the surface: nothing to refine
        bad = ((error > tolerance) | (turns > _LARGEST_TURN)) & (chords > tolerance)
        if not bad.any():
            breaks = arc_length[_breaks(section, uv)]
            return FaceCurve(section, uv, positions, breaks)
        # halves must be shorter than the whole, or the refinement would never end
        halves = np.linalg.norm(np.stack([points[:-1], points[1:]]) - exact[:, :3, 3], axis=2)
        astray = bad & (halves.max(axis=0) >= chords)
        if astray.any():
            raise section.lost(targets[np.argmax(astray)])
        uv = np.insert(uv, np.flatnonzero(bad) + 1, middles[bad], axis=0)


def _breaks(section: Section, uv: Array) -> NDArray[np.int64]:
    """Return which inner nodes lie on a knot where the curvature of the curve jumps, shape (b,).

    Every crossing of a knot is a node. A knot alone is no evidence: that of an exact circle in
    several rational pieces is smooth.
    """
    surface = section.surface
    both = (surface.knots_u, surface.degree_u), (surface.knots_v, surface.degree_v)
    span = np.ptp(surface.domain, axis=0)
    on_knot = np.zeros(len(uv), dtype=bool)
    for axis, (knots, degree) in enumerate(both):
        gaps = np.abs(uv[:, axis, None] - _weak_knots(knots, degree))
        on_knot |= (gaps <= 1e-9 * span[axis]).any(axis=1)
    nodes = np.flatnonzero(on_knot[1:-1]) + 1
    if not len(nodes):
        return nodes
    before = uv[nodes] + _BESIDE * (uv[nodes - 1] - uv[nodes])
    after = uv[nodes] + _BESIDE * (uv[nodes + 1] - uv[nodes])
    jumps = curvature_jumps(section.bending(before)[:, 0, 0], section.bending(after)[:, 0, 0])
    turns = np.linalg.norm(surface.normal(after) - surface.normal(before), axis=1)
    return np.asarray(nodes[jumps | (turns > _KINK)])


def _weak_knots(knots: Array, degree: int) -> Array:
    """Return the inner knots across which a spline may have no continuous second derivative."""
    inner = knots[(knots > knots[degree]) & (knots < knots[-degree - 1])]
    values, multiplicity = np.unique(inner, return_counts=True)
    return values[multiplicity > degree - 2]
