"""Lines of constant parameter on a NURBS surface, for passes that follow its net."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from opl.geometry.curves import SurfaceCurve, between_nodes, curvature_jumps, hermite_through
from opl.geometry.frames import Array, from_axes
from opl.geometry.patchwork import Face
from opl.geometry.trim import parts_inside

# halvings of the span between two nodes of a line, at most
_MAX_HALVINGS = 12
_BESIDE = 1e-7


@dataclass(frozen=True, eq=False)
class IsoLine:
    """A line along which one parameter stays, directed as the other grows.

    Attributes:
        face: What it lies on.
        axis: Which parameter runs, 0 for u, 1 for v.
        value: The other parameter.
        nodes: Values of the running parameter at its nodes, shape (k,).
        arc_length: Arc length there in [m], from 0, shape (k,).
        positions: The curve as a function of its arc length, (...,) to (..., 3).
    """

    face: Face
    axis: int
    value: float
    nodes: Array
    arc_length: Array
    positions: CubicHermiteSpline

    @property
    def length(self) -> float:
        """Return the length in [m]."""
        return float(self.arc_length[-1])

    @cached_property
    def breaks(self) -> Array:
        """Inner arc lengths in [m] where the curvature jumps, shape (b,)."""
        surface = self.face.surface
        knots = np.unique((surface.knots_u, surface.knots_v)[self.axis])
        inner = np.flatnonzero(np.isin(self.nodes[1:-1], knots)) + 1
        if not len(inner):
            return np.empty(0)
        gap = _BESIDE * np.ptp(self.nodes)
        before, after = (
            _bending(self.face, self._uv(self.nodes[inner] + side * gap), self.axis)[:, 0, 0]
            for side in (-1.0, 1.0)
        )
        return self.arc_length[inner[curvature_jumps(before, after)]]

    def parameters(self, arc_length: Array) -> Array:
        """Return (u, v) at given arc lengths in [m], shape (k, 2)."""
        x = np.interp(arc_length, self.arc_length, self.nodes)
        inner = between_nodes(self.arc_length, arc_length)
        targets, tangents = self.positions(arc_length), self.positions(arc_length, nu=1)
        for _ in range(4):  # Newton: the point abreast of the target
            S = self.face.surface.derivatives(self._uv(x), 1)
            d = S[:, 1, 0] if self.axis == 0 else S[:, 0, 1]
            along = np.sum((S[:, 0, 0] - targets) * tangents, axis=1)
            step = along / np.sum(d * tangents, axis=1)
            x = np.clip(np.where(inner, x - step, x), self.nodes[0], self.nodes[-1])
        return self._uv(x)

    def frames(self, arc_length: Array) -> Array:
        """Return Ts_workpiece_cutter at given arc lengths in [m], shape (k, 4, 4)."""
        return _frames(self.face, self.parameters(arc_length), self.axis)

    def bending(self, arc_length: Array) -> Array:
        """Return the curvature of the surface in [1/m] in axes x and y, shape (k, 2, 2)."""
        return _bending(self.face, self.parameters(arc_length), self.axis)

    def _uv(self, x: Array) -> Array:
        return _uv(x, self.axis, self.value)


def iso_curves(face: Face, axis: int, value: float, tolerance: float) -> Sequence[SurfaceCurve]:
    """Return what the trim leaves of a line of constant parameter.

    Args:
        face: The face.
        axis: Which parameter runs, 0 for u, 1 for v.
        value: The other parameter.
        tolerance: Largest error in [m] of the line's positions between its nodes.
    """
    grid = face.grid
    nodes = (grid.u, grid.v)[axis]
    for _ in range(_MAX_HALVINGS):
        Ts = _frames(face, _uv(nodes, axis, value), axis)
        points, tangents = Ts[:, :3, 3], Ts[:, :3, 0]
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        positions, turns = hermite_through(points, tangents)
        # quarter of the sagitta's error of a circle in cubic interpolation, and for odd errors
        middle = 0.5 * (nodes[1:] + nodes[:-1])
        exact = _frames(face, _uv(middle, axis, value), axis)[:, :3, 3]
        halfway = positions.x[:-1] + np.diff(positions.x) * np.linalg.norm(
            exact - points[:-1], axis=1
        ) / np.maximum(
            np.linalg.norm(exact - points[:-1], axis=1)
            + np.linalg.norm(exact - points[1:], axis=1),
            np.finfo(float).tiny,
        )
        difference = exact - positions(halfway)
        directions = positions(halfway, nu=1)
        along = np.sum(difference * directions, axis=1, keepdims=True)
        error = np.linalg.norm(difference - along * directions, axis=1)
        bad = ((error > tolerance) | (turns > 0.5)) & (chords > tolerance)
        if not bad.any():
            break
        nodes = np.insert(nodes, np.flatnonzero(bad) + 1, middle[bad])
    line = IsoLine(face, axis, value, nodes, positions.x, positions)
    if face.trim is None:
        return [line]
    return parts_inside(line, line.parameters, face.trim)


def _uv(x: Array, axis: int, value: float) -> Array:
    other = np.full_like(x, value)
    return np.stack([x, other] if axis == 0 else [other, x], axis=-1)


def _frames(face: Face, uv: Array, axis: int) -> Array:
    S = face.surface.derivatives(uv, 1)
    z = face.outward * face.surface.unit_normal(uv, S)
    return from_axes(z, S[:, 1, 0] if axis == 0 else S[:, 0, 1], S[:, 0, 0])


def _bending(face: Face, uv: Array, axis: int) -> Array:
    R = _frames(face, uv, axis)[:, :3, :3]
    return face.outward * face.surface.curvature_tensor(uv, R[:, :, 0], R[:, :, 1])
