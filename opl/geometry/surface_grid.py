"""A surface seen from afar: its points on a grid of parameters, and how far it reaches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.nurbs import NurbsSurface

# lines of the parameter grid in each knot span, and about how many there may be in all
_LINES_PER_SPAN = 16
_MAX_LINES = 256


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """Points of a surface on lines of its parameters, all knots among them.

    Attributes:
        u: Parameters of the lines, shape (n,).
        v: Parameters of the lines, shape (m,).
        points: Points in [m], shape (n, m, 3).
    """

    u: Array
    v: Array
    points: Array


def sample_grid(surface: NurbsSurface) -> SurfaceGrid:
    """Return a grid fine enough to separate the curves of a plane on any ordinary surface."""
    (u0, v0), (u1, v1) = surface.domain
    u = _lines(np.clip(surface.knots_u, u0, u1), surface.degree_u)
    v = _lines(np.clip(surface.knots_v, v0, v1), surface.degree_v)
    return SurfaceGrid(u, v, surface.point(np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1)))


def _lines(knots: Array, degree: int) -> Array:
    knots = np.unique(knots)
    n_spans = len(knots) - 1
    n = max(2 * degree, min(_LINES_PER_SPAN, _MAX_LINES // n_spans))
    inner = knots[:-1, None] + np.diff(knots)[:, None] * np.arange(n) / n
    return np.append(inner.ravel(), knots[-1])


def extent_along(surface: NurbsSurface, grid: SurfaceGrid, direction: Array) -> tuple[float, float]:
    """Return the least and the largest d . S(u, v) in [m] over a surface with its grid.

    The direction d has unit length, shape (3,).
    """
    from scipy.optimize import minimize

    lower, upper = surface.domain

    def extreme(sign: float) -> float:
        heights = sign * (grid.points @ direction)
        i, j = np.unravel_index(np.argmin(heights), heights.shape)
        scale = float(np.ptp(heights)) or 1.0

        def height(uv: Array) -> tuple[float, Array]:
            S = surface.derivatives(np.clip(uv, lower, upper), 1)
            value = S @ direction * (sign / scale)
            return value[0, 0], np.array([value[1, 0], value[0, 1]])

        start = np.array([grid.u[i], grid.v[j]])
        bounds = list(zip(lower, upper, strict=True))
        best = minimize(height, start, jac=True, bounds=bounds, tol=1e-15)
        return sign * min(float(heights[i, j]), scale * float(best.fun))

    return extreme(1.0), extreme(-1.0)
