"""A machined surface made of faces: NURBS surfaces, trimmed or whole, that join where they meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.geometry.coverage import AreaSamples
from opl.geometry.curves import MEETING, SurfaceCurve, joined
from opl.geometry.frames import Array
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.section import Section
from opl.geometry.section_curves import FaceCurve, section_curves
from opl.geometry.surface_grid import SurfaceGrid, extent_along, sample_grid
from opl.geometry.trim import Trim, parts_inside

# a plane this near to a point where the surface has no normal is moved off it by as much [m]
_BESIDE_POLE = 2e-7

# a face with less than this fraction of the square of its size has no area
_LEAST_AREA = 1e-9

# shorter curves are what trimming leaves at corners [m]
_SHORTEST = 1e-6


@dataclass(frozen=True, eq=False)
class Face:
    """A part of a NURBS surface whose outside is known.

    Attributes:
        surface: The surface.
        outward: 1.0 if du x dv points outward, -1.0 if inward.
        trim: What of it there is, None for all.
        type: What kind of surface it is in its file, such as ``plane`` or ``b-spline``.

    Raises:
        ValueError: If it has no area; the message begins with what is to blame.
    """

    surface: NurbsSurface
    outward: float = 1.0
    trim: Trim | None = None
    type: str = "nurbs"

    def __post_init__(self) -> None:
        across, along = (np.diff(self.grid.points, axis=axis) for axis in (0, 1))
        area = np.linalg.norm(np.cross(across[:, :-1], along[:-1]), axis=2).sum()
        size = np.ptp(self.surface.control_points.reshape(-1, 3), axis=0).max()
        if not area > _LEAST_AREA * size**2:
            raise ValueError("control_points: span no area")
        if self.trim is not None:
            self.trim.check_against(self.surface.domain)

    @property
    def n_holes(self) -> int:
        """Return the number of borders beyond the outer one."""
        return 0 if self.trim is None else len(self.trim.loops) - 1

    @cached_property
    def grid(self) -> SurfaceGrid:
        """Its points seen from afar."""
        return sample_grid(self.surface)

    @cached_property
    def poles(self) -> Array:
        """Return where a whole border of the surface is one point, in [m], shape (k, 3)."""
        net = self.surface.control_points
        sides = (net[0], net[-1], net[:, 0], net[:, -1])
        size = float(np.ptp(net.reshape(-1, 3), axis=0).max())
        same = [side[0] for side in sides if np.ptp(side, axis=0).max() <= 1e-9 * size]
        return np.array(same).reshape(-1, 3)

    def extent_along(self, direction: Array) -> tuple[float, float]:
        """Return the least and the largest d . S in [m]."""
        if self.trim is None:
            return extent_along(self.surface, self.grid, direction)
        uv = np.stack(np.meshgrid(self.grid.u, self.grid.v, indexing="ij"), axis=-1)
        inside = self.grid.points[self.trim.contains(uv)]
        lower, upper = self.surface.domain
        border = self.surface.point(np.clip(np.concatenate(self.trim.loops), lower, upper))
        heights = np.concatenate([inside, border]) @ direction
        return float(heights.min()), float(heights.max())

    def curves(self, plane_normal: Array, offset: float, tolerance: float) -> list[SurfaceCurve]:
        """Return the curves in which a plane cuts the face; see `section_curves`."""
        beside = self.poles @ plane_normal - offset
        if len(beside) and np.abs(beside).min() < _BESIDE_POLE:
            # away from the pole, and from whatever other plane of the pole is meant
            offset += _BESIDE_POLE * (
                -1.0 if offset > np.median(self.grid.points @ plane_normal) else 1.0
            )
        section = Section(self.surface, self.outward, plane_normal, offset)
        found = self.trimmed(section_curves(section, self.grid, tolerance))
        return [curve for curve in found if curve.length > _SHORTEST]

    def trimmed(self, curves: Sequence[FaceCurve]) -> Sequence[SurfaceCurve]:
        """Return what the trim leaves of curves on the face."""
        if self.trim is None:
            return curves
        return [part for curve in curves for part in parts_inside(curve, self.trim)]

    def area_samples(self, spacing: float) -> AreaSamples:
        """Return points that stand for the area around them."""
        surface, (lower, upper) = self.surface, self.surface.domain
        steps = [
            float(np.linalg.norm(np.diff(self.grid.points, axis=axis), axis=2).sum(axis=axis).max())
            for axis in (0, 1)
        ]
        counts = [int(np.clip(np.ceil(length / spacing), 8, 400)) for length in steps]
        u, v = (
            low + (high - low) * (np.arange(n) + 0.5) / n
            for low, high, n in zip(lower, upper, counts, strict=True)
        )
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        if self.trim is not None:
            uv = uv[self.trim.contains(uv)]
        S = surface.derivatives(uv, 1)
        normals = np.cross(S[:, 1, 0], S[:, 0, 1])
        sizes = np.linalg.norm(normals, axis=1)
        cell = float(np.prod((upper - lower) / counts))
        sound = sizes > 1e-9 * max(float(sizes.max(initial=0.0)), 1e-300)
        outward = self.outward * normals[sound] / sizes[sound, None]
        return AreaSamples(S[sound, 0, 0], outward, sizes[sound] * cell, uv[sound])


@dataclass(frozen=True, eq=False)
class Patchwork:
    """Faces that are ground as one surface; tangent neighbours join."""

    faces: tuple[Face, ...]

    def extent_along(self, direction: Array) -> tuple[float, float]:
        """Return the least and the largest d . S in [m] over all faces; d is a unit vector."""
        low, high = zip(*(face.extent_along(direction) for face in self.faces), strict=True)
        return min(low), max(high)

    def curves(
        self, plane_normal: Array, offset: float, tolerance: float
    ) -> Sequence[SurfaceCurve]:
        """Return the curves in which a plane cuts the surface, in order along their direction.

        Args:
            plane_normal: Unit normal n of the plane, shape (3,).
            offset: Distance of the plane from the origin along n in [m].
            tolerance: Largest error in [m] of a curve's positions between its nodes.
        """
        found: list[SurfaceCurve] = []
        for face in self.faces:
            low, high = (
                face.extent_along(plane_normal) if len(self.faces) > 1 else (-np.inf, np.inf)
            )
            if low < offset < high or (len(self.faces) > 1 and offset in (low, high)):
                found += face.curves(plane_normal, offset, tolerance)
        return in_order(joined(found))

    def area_samples(self, spacing: float) -> AreaSamples:
        """Return points that stand for the area around them, about ``spacing`` [m] apart."""
        return AreaSamples.joined([face.area_samples(spacing) for face in self.faces])

    def curvature_across(self, spacing: float, direction: Array) -> tuple[Array, Array]:
        """Return curvature in [1/m] and slope between the rows of given planes.

        Args:
            spacing: Distance of the samples in [m].
            direction: Unit normal of the planes, shape (3,).

        Returns:
            The normal curvature across the rows, and the cosine between the planes' normal and the
            surface there, shapes (k,).
        """
        curvatures, slopes = [], []
        for face in self.faces:
            samples = face.area_samples(spacing)
            cut, slope, x, y = across_rows(samples.normals, direction)
            tensor = face.outward * face.surface.curvature_tensor(samples.uv[cut], x, y)
            curvatures.append(tensor[:, 1, 1])
            slopes.append(slope)
        return np.concatenate(curvatures), np.concatenate(slopes)


def across_rows(normals: Array, direction: Array) -> tuple[np.ndarray, Array, Array, Array]:
    """Return where planes cut a surface rather than touch it, slope, and tangents along and across.

    Shapes (n,) of bool, and (k,), (k, 3), (k, 3) of what is cut.
    """
    x = np.cross(normals, direction)
    slope = np.linalg.norm(x, axis=1)
    cut = slope > 0.05
    x = x[cut] / slope[cut, None]
    return cut, slope[cut], x, np.cross(normals[cut], x)


def in_order(curves: Sequence[SurfaceCurve]) -> list[SurfaceCurve]:
    """Return curves sorted along the direction in which they run together; rings by their length.

    Rings run nowhere together: the longest comes first, then the one that lies lower in x, y, z.
    """
    if not curves:
        return []
    along = sum(curve.positions(curve.length) - curve.positions(0.0) for curve in curves)
    if np.linalg.norm(along) > MEETING * len(curves):
        return sorted(curves, key=lambda curve: float(along @ curve.positions(0.5 * curve.length)))

    def place(curve: SurfaceCurve) -> tuple[float, ...]:
        middle = curve.positions(np.linspace(0.0, curve.length, 33)).mean(axis=0)
        return tuple(np.round(np.array([-curve.length, *middle]), 4))

    return sorted(curves, key=place)
