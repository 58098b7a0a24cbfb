"""Where planes cut a surface: the curves that passes run along.

A curve is found as a contour line of the plane's equation on a grid of parameters. Its crossings
with the grid lines are made exact, then nodes are added between them until cubic Hermite
interpolation in the arc length reproduces the curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from contourpy import LineType, contour_generator
from scipy.interpolate import CubicHermiteSpline

from opl.geometry.frames import Array, from_axes
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.surface_grid import SurfaceGrid

# points of a curve lie this near to their plane [m], on the surface they lie exactly; the search
# for them ends well below
_ON_PLANE = 1e-9
_CONVERGED = 1e-12
_MAX_NEWTON_STEPS = 60

# sine of the angle between surface and plane below which they touch rather than cut
_TOUCHING = 1e-6

# largest turn of the tangent between two nodes of a curve [rad]
_LARGEST_TURN = 0.5


@dataclass(frozen=True, eq=False)
class Section:
    """A plane n . p = offset through a surface whose outside is known.

    Attributes:
        surface: The surface.
        plane_normal: Unit normal n of the plane, shape (3,).
        offset: Distance of the plane from the origin along n in [m].
        outward: 1.0 if du x dv points outward, -1.0 if inward.
    """

    surface: NurbsSurface
    plane_normal: Array
    offset: float
    outward: float

    def frames(self, uv: Array) -> Array:
        """Return Ts_workpiece_cutter, shape (..., 4, 4): z outward normal, x = z cross n.

        The tangent of the curve is normal to both the surface's and the plane's normal, so x is
        exact where z is.

        Args:
            uv: Parameters of points of the section, shape (..., 2).

        Raises:
            DegenerateNormalError: Where the surface has no normal.
            ValueError: Where the plane touches the surface, so that the curve has no tangent.
        """
        z = self.outward * self.surface.normal(uv)
        x = np.cross(z, self.plane_normal)
        points = self.surface.point(uv)
        touching = np.linalg.norm(x, axis=-1) < _TOUCHING
        if touching.any():
            place = 1e3 * points[touching][0]
            raise ValueError(
                f"the plane {1e3 * self.offset:.4g} mm along its normal touches the surface at "
                f"({place[0]:.4g}, {place[1]:.4g}, {place[2]:.4g}) mm and does not cut it there"
            )
        return from_axes(z, x, points)

    def closest(self, uv: Array, targets: Array, tangents: Array) -> Array:
        """Return the parameters of the points of the section abreast of given points.

        Newton's method on two equations: the point lies on the plane, and its difference to the
        target is normal to the tangent.

        Args:
            uv: First guesses, shape (k, 2).
            targets: Points near the section in [m], shape (k, 3).
            tangents: Directions of the curve there, shape (k, 3).

        Raises:
            ValueError: Where there is no such point in the domain.
        """
        lower, upper = self.surface.domain
        for _ in range(_MAX_NEWTON_STEPS):
            S = self.surface.derivatives(uv, 1)
            points, gradients = S[:, 0, 0], np.stack([S[:, 1, 0], S[:, 0, 1]], axis=1)
            along = np.sum((points - targets) * tangents, axis=1)
            residuals = np.stack([points @ self.plane_normal - self.offset, along], axis=1)
            jacobian = np.stack(
                [gradients @ self.plane_normal, np.einsum("kij,kj->ki", gradients, tangents)],
                axis=1,
            )
            # the pseudo-inverse, as the matrix may be singular at a guess
            step = np.linalg.pinv(jacobian) @ residuals[..., None]
            previous, uv = uv, np.clip(uv - step[..., 0], lower, upper)
            if np.all(np.abs(uv - previous) <= _CONVERGED * (upper - lower)):
                break
        distance = np.abs(self.surface.point(uv) @ self.plane_normal - self.offset)
        if (distance > _ON_PLANE).any():
            raise self.lost(targets[np.argmax(distance)])
        return uv

    def lost(self, point: Array) -> ValueError:
        """Return the error that a curve cannot be followed near a point [m]."""
        x, y, z = 1e3 * point
        return ValueError(
            f"the plane {1e3 * self.offset:.4g} mm along its normal: its curve on the surface "
            f"cannot be followed near ({x:.4g}, {y:.4g}, {z:.4g}) mm; is the surface smooth there?"
        )


@dataclass(frozen=True, eq=False)
class SectionCurve:
    """One curve of a section, in the direction of the frames' axis x.

    Attributes:
        section: What it is a curve of.
        uv: Parameters of its nodes, shape (k, 2).
        arc_length: Arc length at its nodes in [m], from 0, shape (k,).
        positions: The curve as a function of its arc length, (...,) to (..., 3).
    """

    section: Section
    uv: Array
    arc_length: Array
    positions: CubicHermiteSpline

    @property
    def length(self) -> float:
        """Return the length in [m]."""
        return float(self.arc_length[-1])

    def frames(self, arc_length: Array) -> Array:
        """Return the exact Ts_workpiece_cutter at given arc lengths [m], shape (k, 4, 4)."""
        uv = np.stack([np.interp(arc_length, self.arc_length, p) for p in self.uv.T], axis=1)
        # the ends are nodes, and one on the border may not be moved across it
        inner = (arc_length > 0.0) & (arc_length < self.length)
        targets, tangents = self.positions(arc_length), self.positions(arc_length, nu=1)
        uv[inner] = self.section.closest(uv[inner], targets[inner], tangents[inner])
        return self.section.frames(uv)


def section_curves(section: Section, grid: SurfaceGrid, tolerance: float) -> list[SectionCurve]:
    """Return the curves in which a plane cuts a surface, in order along their direction.

    A curve that crosses the seam of a closed surface is two curves that meet there.

    Args:
        section: Plane and surface.
        grid: Grid of the surface; what falls between its lines is not seen.
        tolerance: Largest error in [m] of a curve's ``positions`` between its nodes.

    Raises:
        DegenerateNormalError: Where a curve runs through a place without normal.
        ValueError: Where the plane touches the surface, or a curve cannot be followed.
    """
    heights = grid.points @ section.plane_normal
    # a plane through the border itself is sought just inside, then brought to its place
    hair = 1e-7 * np.ptp(heights)
    level = np.clip(section.offset, heights.min() + hair, heights.max() - hair)
    contours = contour_generator(grid.u, grid.v, heights.T, line_type=LineType.Separate)
    curves = [
        _refined(section, uv, tolerance)
        for line in cast(list[Array], contours.lines(level))
        if len(uv := _crossings(section, grid, line)) > 1
    ]
    if not curves:
        return []
    along = sum(curve.positions(curve.length) - curve.positions(0.0) for curve in curves)
    return sorted(curves, key=lambda curve: float(along @ curve.positions(0.5 * curve.length)))


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
    at_end = np.abs(height(end)[0]) <= _ON_PLANE
    x, left, right = (np.where(at_end, end, values) for values in (x, left, right))
    for _ in range(_MAX_NEWTON_STEPS):
        heights, slopes = height(x)
        searching = np.abs(heights) > _CONVERGED
        if not searching.any():
            break
        on_left = heights * left_height > 0.0
        left, right = np.where(on_left, x, left), np.where(on_left, right, x)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = x - heights / slopes
        inside = (newton > left) & (newton < right)
        x = np.where(searching, np.where(inside, newton, 0.5 * (left + right)), x)
    # a plane sought just inside the border may not cross it at all
    uv = uv[np.abs(height(x)[0]) <= _ON_PLANE]
    chords = np.linalg.norm(np.diff(section.surface.point(uv), axis=0), axis=1)
    return uv[np.append(chords > _ON_PLANE, True)] if len(uv) else uv


def _refined(section: Section, uv: Array, tolerance: float) -> SectionCurve:
    """Direct a curve along axis x and add nodes where its interpolation is not good enough."""
    frames = section.frames(uv)
    chords = np.diff(frames[:, :3, 3], axis=0)
    if np.sum(chords * frames[1:, :3, 0]) < 0.0:
        uv = uv[::-1]
    while True:
        frames = section.frames(uv)
        points, tangents = frames[:, :3, 3], frames[:, :3, 0]
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        cosine = np.clip(np.sum(tangents[1:] * tangents[:-1], axis=1), -1.0, 1.0)
        turns = np.arccos(cosine)
        # length of the circular arc that has this chord and this turn
        arcs = chords / np.sinc(turns / (2.0 * np.pi))
        arc_length = np.append(0.0, np.cumsum(arcs))
        positions = CubicHermiteSpline(arc_length, points, tangents)

        between = 0.5 * (arc_length[1:] + arc_length[:-1])
        targets, directions = positions(between), positions(between, nu=1)
        guesses = 0.5 * (uv[1:] + uv[:-1])
        middles = section.closest(guesses, targets, directions)
        exact = section.frames(middles)
        error = np.linalg.norm(exact[:, :3, 3] - targets, axis=1)
        # an error odd about the middle shows in the tangent there
        error += 0.25 * arcs * np.linalg.norm(exact[:, :3, 0] - directions, axis=1)
        # a segment as short as the tolerance is a kink of the surface: nothing to refine
        bad = ((error > tolerance) | (turns > _LARGEST_TURN)) & (chords > tolerance)
        if not bad.any():
            return SectionCurve(section, uv, arc_length, positions)
        # halves must be shorter than the whole, or the refinement would never end
        halves = np.linalg.norm(np.stack([points[:-1], points[1:]]) - exact[:, :3, 3], axis=2)
        astray = bad & (halves.max(axis=0) >= chords)
        if astray.any():
            raise section.lost(targets[np.argmax(astray)])
        uv = np.insert(uv, np.flatnonzero(bad) + 1, middles[bad], axis=0)
