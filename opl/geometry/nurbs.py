"""Rational B-spline (NURBS) surfaces.

Equation numbers are those of Piegl and Tiller, The NURBS Book, 2nd edition.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import comb
from typing import TYPE_CHECKING

import numpy as np

from opl.geometry.frames import Array, in_mm, read_only

if TYPE_CHECKING:
    from scipy.interpolate import NdBSpline

# du x dv below this fraction of its average over the surface is taken for zero
_DEGENERATE_AREA = 1e-9


class DegenerateNormalError(ValueError):
    """A surface has no normal where one is needed: its two parameter lines have no area there.

    Args:
        uv: Parameters of the place, shape (2,).
        point: The place in [m], shape (3,).
    """

    def __init__(self, uv: Array, point: Array) -> None:
        super().__init__(
            f"the surface has no normal at (u, v) = ({uv[0]:.6g}, {uv[1]:.6g}), "
            f"point {in_mm(point)}: du x dv is zero"
        )
        self.uv = uv
        self.point = point


@dataclass(frozen=True, eq=False)
class NurbsSurface:
    """A rational B-spline surface S(u, v), eq. (4.11).

    Attributes:
        degree_u: Degree along u, at least 1.
        degree_v: Degree along v, at least 1.
        knots_u: Knots along u, not decreasing, shape (nu + degree_u + 1,).
        knots_v: Knots along v, not decreasing, shape (nv + degree_v + 1,).
        control_points: Control points in [m], shape (nu, nv, 3).
        weights: Weights, positive, shape (nu, nv).

    Raises:
        ValueError: If these do not make a surface; the message begins with the attribute.
    """

    degree_u: int
    degree_v: int
    knots_u: Array
    knots_v: Array
    control_points: Array
    weights: Array
    _smallest_area: float = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("knots_u", "knots_v", "control_points", "weights"):
            array = read_only(getattr(self, name))
            if not np.isfinite(array).all():
                raise ValueError(f"{name}: must be finite")
            object.__setattr__(self, name, array)
        points, weights = self.control_points, self.weights
        if points.ndim != 3 or points.shape[2] != 3:
            raise ValueError(f"control_points: must have shape (nu, nv, 3), got {points.shape}")
        if weights.shape != points.shape[:2]:
            raise ValueError(
                f"weights: must have the shape of the control net, {points.shape[:2]}, "
                f"got {weights.shape}"
            )
        if weights.min() <= 0.0:
            raise ValueError(f"weights: must be positive, got {weights.min():g}")
        _check_knots("u", self.degree_u, self.knots_u, points.shape[0])
        _check_knots("v", self.degree_v, self.knots_v, points.shape[1])

        diagonal = np.ptp(points.reshape(-1, 3), axis=0)
        area = float(diagonal @ diagonal / np.ptp(self.domain, axis=0).prod())
        object.__setattr__(self, "_smallest_area", _DEGENERATE_AREA * area)

    @cached_property
    def _homogeneous(self) -> NdBSpline:
        """The control points times their weights, with the weights, as a spline."""
        from scipy.interpolate import NdBSpline  # longer to load than to read most files

        weights = self.weights[..., None]
        return NdBSpline(
            (self.knots_u, self.knots_v),
            np.concatenate([weights * self.control_points, weights], axis=-1),
            (self.degree_u, self.degree_v),
            extrapolate=False,
        )

    def __getstate__(self) -> dict[str, object]:
        # where the surface is taken to it may be known, but not evaluated again
        return {name: value for name, value in vars(self).items() if name != "_homogeneous"}

    @property
    def domain(self) -> Array:
        """Return the smallest and the largest (u, v), shape (2, 2)."""
        (u0, u1), (v0, v1) = (
            (knots[degree], knots[-degree - 1])
            for knots, degree in ((self.knots_u, self.degree_u), (self.knots_v, self.degree_v))
        )
        return np.array([[u0, v0], [u1, v1]])

    def point(self, uv: Array) -> Array:
        """Return S(u, v) in [m], shape (..., 3), of (..., 2); nan outside the domain."""
        homogeneous = self._homogeneous(uv)
        return np.asarray(homogeneous[..., :3] / homogeneous[..., 3:])

    def derivatives(self, uv: Array, order: int = 1) -> Array:
        """Return the point and its partial derivatives, eq. (4.20).

        At a knot where a derivative jumps it is the one of the larger parameters.

        Args:
            uv: Parameters, shape (..., 2).
            order: Highest total order k + l.

        Returns:
            Shape (..., order + 1, order + 1, 3) in [m]: entry [..., k, l, :] is the k-th derivative
            along u of the l-th along v; entries with k + l > order are zero. [..., 0, 0, :] is the
            point itself.
        """
        uv = np.asarray(uv)
        A = np.zeros((*uv.shape[:-1], order + 1, order + 1, 4))
        S = np.zeros((*uv.shape[:-1], order + 1, order + 1, 3))
        orders = [(k, n - k) for n in range(order + 1) for k in range(n + 1)]
        for k, m in orders:
            if k <= self.degree_u and m <= self.degree_v:
                A[..., k, m, :] = self._homogeneous(uv, nu=(k, m))
        w = A[..., 3:]
        for k, m in orders:
            lower = [(i, j) for i in range(k + 1) for j in range(m + 1) if i or j]
            rest = sum(
                comb(k, i) * comb(m, j) * w[..., i, j, :] * S[..., k - i, m - j, :]
                for i, j in lower
            )
            S[..., k, m, :] = (A[..., k, m, :3] - rest) / w[..., 0, 0, :]
        return S

    def normal(self, uv: Array) -> Array:
        """Return the unit normals along du x dv, shape (..., 3), of parameters (..., 2).

        Raises:
            DegenerateNormalError: Where du x dv is zero, at a pole or a cusp, and for parameters
                outside the domain.
        """
        return self.unit_normal(uv, self.derivatives(uv, 1))

    def curvature_tensor(self, uv: Array, x: Array, y: Array) -> Array:
        """Return the second fundamental form in two orthonormal tangent directions.

        The diagonal holds the normal curvatures along x and y (do Carmo, Differential Geometry of
        Curves and Surfaces, section 3.2), positive where the surface bends away from du x dv, as a
        ball does from its outward normal.

        Args:
            uv: Parameters, shape (..., 2).
            x: First unit tangent, shape (..., 3).
            y: Second unit tangent, normal to the first, shape (..., 3).

        Returns:
            Symmetric matrices in [1/m], with respect to the normal du x dv, shape (..., 2, 2).

        Raises:
            DegenerateNormalError: Where the surface has no normal.
        """
        S = self.derivatives(uv, 2)
        n = self.unit_normal(uv, S)
        tangents = np.stack([S[..., 1, 0, :], S[..., 0, 1, :]], axis=-2)
        first = tangents @ np.swapaxes(tangents, -1, -2)
        # of each direction the components along du and dv
        mixed = np.linalg.solve(first, tangents @ np.stack([x, y], axis=-1))
        L, M, N = (-np.sum(S[..., k, m, :] * n, axis=-1) for k, m in ((2, 0), (1, 1), (0, 2)))
        second = np.stack([np.stack([L, M], axis=-1), np.stack([M, N], axis=-1)], axis=-2)
        return np.asarray(np.swapaxes(mixed, -1, -2) @ second @ mixed)

    def unit_normal(self, uv: Array, S: Array) -> Array:
        """Return the unit normals where `derivatives` returned S, shape (..., 3).

        Raises:
            DegenerateNormalError: Where du x dv is zero.
        """
        normal = np.cross(S[..., 1, 0, :], S[..., 0, 1, :])
        area = np.linalg.norm(normal, axis=-1, keepdims=True)
        degenerate = ~(area[..., 0] > self._smallest_area)  # catches nan too
        if degenerate.any():
            first = np.unravel_index(np.argmax(degenerate), degenerate.shape)
            raise DegenerateNormalError(np.asarray(uv)[first], S[..., 0, 0, :][first])
        return np.asarray(normal / area)


def _check_knots(axis: str, degree: int, knots: Array, n_points: int) -> None:
    if not 1 <= degree < n_points:
        raise ValueError(
            f"degree_{axis}: must lie between 1 and {n_points - 1}, one less than the number of "
            f"control points along {axis}, got {degree}"
        )
    if knots.shape != (n_points + degree + 1,):
        raise ValueError(
            f"knots_{axis}: must be {n_points + degree + 1} values (control points + degree + 1), "
            f"got {knots.size}"
        )
    if (np.diff(knots) < 0.0).any():
        raise ValueError(f"knots_{axis}: must not decrease")
    domain = knots[degree : n_points + 1]
    if domain[0] == domain[-1]:
        raise ValueError(f"knots_{axis}: the domain from {domain[0]:g} to {domain[-1]:g} is empty")
    inner, multiplicity = np.unique(
        knots[(knots > domain[0]) & (knots < domain[-1])], return_counts=True
    )
    if (multiplicity > degree).any():
        raise ValueError(
            f"knots_{axis}: inner knots may occur at most {degree} times or the surface tears, got "
            f"{inner[multiplicity > degree][0]:g} more often"
        )
