"""Lines of constant parameter on a NURBS surface, for passes that follow its net."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.curves import SurfaceCurve, curvature_jumps, hermite_through
from opl.geometry.frames import Array, from_axes
from opl.geometry.patchwork import Face
from opl.geometry.section import Trace
from opl.geometry.section_curves import FaceCurve

# halvings of the span between two nodes of a line, at most
_MAX_HALVINGS = 12
_BESIDE = 1e-7


@dataclass(frozen=True, eq=False)
class IsoLine(Trace):
    """A line along which one parameter stays, directed as the other grows.

    Attributes:
        axis: Which parameter runs, 0 for u, 1 for v.
        value: The other parameter.
    """

    axis: int
    value: float

    def uv(self, x: Array) -> Array:
        """Return (u, v) where the running parameter has given values, shape (..., 2)."""
        other = np.full_like(x, self.value)
        return np.stack([x, other] if self.axis == 0 else [other, x], axis=-1)

    def frames(self, uv: Array) -> Array:
        """See `Trace.frames`; x is the tangent."""
        S = self.surface.derivatives(uv, 1)
        z = self.outward * self.surface.unit_normal(uv, S)
        return from_axes(z, self._tangent(S), S[:, 0, 0])

    def closest(self, uv: Array, targets: Array, tangents: Array) -> Array:
        """See `Trace.closest`; Newton's method."""
        x, (first, last) = uv[:, self.axis], self.surface.domain[:, self.axis]
        for _ in range(4):
            S = self.surface.derivatives(self.uv(x), 1)
            along = np.sum((S[:, 0, 0] - targets) * tangents, axis=1)
            x = np.clip(x - along / np.sum(self._tangent(S) * tangents, axis=1), first, last)
        return self.uv(x)

    def breaks(self, x: Array) -> np.ndarray:
        """Return which inner ones of increasing values lie on a knot where the curvature jumps."""
        surface = self.surface
        knots = (surface.knots_u, surface.knots_v)[self.axis]
        inner = np.flatnonzero(np.isin(x[1:-1], knots)) + 1
        if not len(inner):
            return inner
        gap = _BESIDE * np.ptp(x)
        before, after = (
            self.bending(self.uv(x[inner] + side * gap))[:, 0, 0] for side in (-1.0, 1.0)
        )
        return np.asarray(inner[curvature_jumps(before, after)])

    def _tangent(self, S: Array) -> Array:
        return np.asarray(S[:, 1, 0] if self.axis == 0 else S[:, 0, 1])


def iso_curves(face: Face, axis: int, value: float, tolerance: float) -> Sequence[SurfaceCurve]:
    """Return what the trim leaves of a line of constant parameter.

    Args:
        face: The face.
        axis: Which parameter runs, 0 for u, 1 for v.
        value: The other parameter.
        tolerance: Largest error in [m] of the line's positions between its nodes.
    """
    line = IsoLine(face.surface, face.outward, axis, value)
    nodes = (face.grid.u, face.grid.v)[axis]
    for _ in range(_MAX_HALVINGS):
        Ts = line.frames(line.uv(nodes))
        points, tangents = Ts[:, :3, 3], Ts[:, :3, 0]
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        positions, turns = hermite_through(points, tangents)
        # quarter of the sagitta's error of a circle in cubic interpolation, and for odd errors
        middle = 0.5 * (nodes[1:] + nodes[:-1])
        exact = line.frames(line.uv(middle))[:, :3, 3]
        to_start, to_end = (
            np.linalg.norm(exact - ends, axis=1) for ends in (points[:-1], points[1:])
        )
        halfway = positions.x[:-1] + np.diff(positions.x) * to_start / np.maximum(
            to_start + to_end, np.finfo(float).tiny
        )
        difference = exact - positions(halfway)
        directions = positions(halfway, nu=1)
        along = np.sum(difference * directions, axis=1, keepdims=True)
        error = np.linalg.norm(difference - along * directions, axis=1)
        bad = ((error > tolerance) | (turns > 0.5)) & (chords > tolerance)
        if not bad.any():
            break
        nodes = np.insert(nodes, np.flatnonzero(bad) + 1, middle[bad])
    uv, breaks = line.uv(nodes), np.asarray(positions.x[line.breaks(nodes)])
    return face.trimmed([FaceCurve(line, uv, positions, breaks)])
