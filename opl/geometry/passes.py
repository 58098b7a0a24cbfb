"""Passes over a surface: rows of curves a pitch apart, cut into cutter points.

Equal-section passes are where parallel planes cut the surface; iso-parametric passes follow the net
of a single NURBS face.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from opl.geometry.coverage import AreaSamples
from opl.geometry.curves import MEETING, SurfaceCurve, clipped, is_closed
from opl.geometry.frames import Array
from opl.geometry.iso_lines import iso_curves
from opl.geometry.order import shortest_links
from opl.geometry.patchwork import Patchwork
from opl.geometry.steps import TooManyStepsError, steps_of
from opl.geometry.toolpath import CutterPoints

MOST_ROWS = 2000

# error of the interpolated curve as a fraction of the bow height
_CURVE_ERROR = 1e-3


class PassesError(ValueError):
    """A value of `Passes` does not go with the surface, or is out of its range.

    Attributes:
        attribute: Which one.
        message: What is wrong with it.
    """

    def __init__(self, attribute: str, message: str) -> None:
        super().__init__(f"{attribute}: {message}")
        self.attribute = attribute
        self.message = message


class Order(str, Enum):
    """In which order and direction the passes are ground."""

    ONE_WAY = "one_way"  # row by row, all in the direction of axis x
    ZIGZAG = "zigzag"  # row by row, every second one backwards
    BOTH = "both"  # row by row, each there and back
    SHORTEST = "shortest"  # in whatever order and direction leaves the shortest way between them


class PassKind(str, Enum):
    """What curves passes run along."""

    SECTIONS = "sections"  # where planes cut the surface
    ALONG_U = "along_u"  # lines of constant v
    ALONG_V = "along_v"  # lines of constant u


class MachinedSurface(Protocol):
    """What is to be ground: NURBS faces or a mesh."""

    def extent_along(self, direction: Array) -> tuple[float, float]:
        """Return the least and the largest d . p in [m]."""

    def curves(
        self, plane_normal: Array, offset: float, tolerance: float
    ) -> Sequence[SurfaceCurve]:
        """Return the curves in which the plane n . p = offset cuts the surface, in order."""

    def area_samples(self, spacing: float) -> AreaSamples:
        """Return points that stand for the area around them, about ``spacing`` [m] apart."""

    def curvature_across(self, spacing: float, direction: Array) -> tuple[Array, Array]:
        """Return curvature in [1/m] across the rows, and cosine of planes' normal to surface."""


def bounding_box(surface: MachinedSurface) -> Array:
    """Return the least and the largest x, y, z of a surface in [m], shape (2, 3)."""
    return np.asarray(np.array([surface.extent_along(axis) for axis in np.eye(3)]).T)


def longest_side(surface: MachinedSurface) -> float:
    """Return the longest side of the bounding box in [m]."""
    return float(np.ptp(bounding_box(surface), axis=0).max())


@dataclass(frozen=True)
class Passes:
    """How a surface is cut into passes; lengths in [m].

    Attributes:
        plane_normal: Normal of the planes, of any length, shape (3,); not used by lines of
            constant parameter.
        pitch: Distance of the rows.
        max_bow_height: Largest distance of the path from the chord of a step.
        largest_step: Largest length of a step along the path.
        margin: Least distance of a row from both ends of the surface along the planes' normal.
        rows: Number of rows; None for as many as fit.
        order: Order and direction of the passes.
        kind: What curves they run along.
        end_margin: What is left out at both ends of an open pass.
        repeats: How often the rows are ground.
        shift: How far each repeat is shifted across the rows; a row that leaves the margins is
            left out.
    """

    plane_normal: Array
    pitch: float
    max_bow_height: float
    largest_step: float
    margin: float = 0.0
    rows: int | None = None
    order: Order = Order.ONE_WAY
    kind: PassKind = PassKind.SECTIONS
    end_margin: float = 0.0
    repeats: int = 1
    shift: float = 0.0


@dataclass(frozen=True, eq=False)
class LaidPasses:
    """Cutter points, and how the surface bends there.

    Attributes:
        points: The cutter points.
        bending: Curvature in [1/m] in axes x and y of each, positive where the surface bends away
            from its normal, shape (N, 2, 2).
    """

    points: CutterPoints
    bending: Array


ShortestOrder = Callable[[Sequence[Array]], list[tuple[int, int]]]


def lay_passes(
    surface: MachinedSurface, passes: Passes, shortest: ShortestOrder = shortest_links
) -> LaidPasses:
    """Return the cutter points of a surface.

    The rows lie in the middle of the surface's extent along the planes' normal, in order along it.
    A section is travelled along x = outward normal cross ``plane_normal``, a line of constant
    parameter as its parameter grows. A pass travelled backwards keeps the axis x of its frames: the
    part is not turned round on the belt, so there the path runs along -x. A row that is cut into
    several curves gives as many passes; one that closes on itself ends where it began.

    Args:
        surface: The surface to grind, in the workpiece frame.
        passes: How it is cut.
        shortest: Finds the order `Order.SHORTEST`, given the frames of each pass.

    Raises:
        DegenerateNormalError: If a pass runs through a place where the surface has no normal.
        PassesError: If a value is out of its range, or if the rows do not fit.
        ValueError: If a plane misses or merely touches the surface.
    """
    for name in ("pitch", "max_bow_height", "largest_step", "repeats"):
        if not getattr(passes, name) > 0.0:
            raise PassesError(name, f"must be positive, got {getattr(passes, name):g}")
    low, high, curves_at = _rows_of(surface, passes)
    first = _row_offsets(low, high, passes)
    rounding = 1e-9 * (high - low)
    rows = []
    for repeat in range(passes.repeats):
        for row, offset in enumerate(first + repeat * passes.shift):
            inside = low + passes.margin - rounding <= offset <= high - passes.margin + rounding
            if repeat == 0 or inside:
                rows.append(_row(curves_at(float(offset)), row, float(offset), passes))
    curves = [curve for row in rows for curve in row]
    try:
        nodes = steps_of(curves, passes.max_bow_height, passes.largest_step)
    except TooManyStepsError as error:
        raise PassesError(error.limit, str(error)) from error
    laid = [_Laid(*one) for one in zip(curves, nodes, strict=True)]
    order = list(_ordered(rows, laid, passes.order, shortest))
    return LaidPasses(
        CutterPoints(
            Ts_workpiece_cutter=np.concatenate([laid[i].frames[::step] for i, step in order]),
            pass_index=np.repeat(np.arange(len(order)), [len(laid[i].nodes) for i, _ in order]),
            arc_length=np.concatenate(
                [
                    laid[i].nodes if step > 0 else (laid[i].nodes[-1] - laid[i].nodes)[::-1]
                    for i, step in order
                ]
            ),
        ),
        np.concatenate([laid[i].bending[::step] for i, step in order]),
    )


CurvesAt = Callable[[float], Sequence[SurfaceCurve]]


def _rows_of(surface: MachinedSurface, passes: Passes) -> tuple[float, float, CurvesAt]:
    """Return where rows may lie, from and to in [m], and the curves of the row at a place."""
    tolerance = _CURVE_ERROR * passes.max_bow_height
    if passes.kind is PassKind.SECTIONS:
        length = float(np.linalg.norm(passes.plane_normal))
        if not length > 0.0:
            raise PassesError("plane_normal", "must not be zero")
        normal = np.asarray(passes.plane_normal, dtype=np.float64) / length
        low, high = surface.extent_along(normal)
        return low, high, lambda offset: surface.curves(normal, offset, tolerance)

    if not isinstance(surface, Patchwork) or len(surface.faces) != 1:
        raise PassesError("kind", f"{passes.kind.value} needs a single NURBS face")
    face = surface.faces[0]
    axis = 0 if passes.kind is PassKind.ALONG_U else 1
    across = (face.grid.v, face.grid.u)[axis]
    # the widest distance between neighbouring lines of the grid counts
    gaps = np.linalg.norm(np.diff(face.grid.points, axis=1 - axis), axis=2).max(axis=axis)
    places = np.append(0.0, np.cumsum(gaps))
    return (
        0.0,
        float(places[-1]),
        lambda offset: iso_curves(face, axis, float(np.interp(offset, places, across)), tolerance),
    )


def _row_offsets(low: float, high: float, passes: Passes) -> Array:
    """Return the places of the rows in [m], centred between two ends."""
    pitch, margin, rows = passes.pitch, passes.margin, passes.rows
    rounding = 1e-9 * (high - low)
    room = high - low - 2.0 * margin
    n_fitting = int((room + rounding) // pitch) + 1 if room >= -rounding else 0
    if n_fitting == 0 or (rows is not None and not 1 <= rows <= n_fitting):
        wanted = "a row" if rows is None else f"{rows} rows"
        raise PassesError(
            "rows",
            f"{wanted} of pitch {1e3 * pitch:g} mm do not fit; between margins of "
            f"{1e3 * margin:g} mm on {1e3 * (high - low):.6g} mm there is room for {n_fitting}",
        )
    n = n_fitting if rows is None else rows
    if n * passes.repeats > MOST_ROWS:
        raise PassesError(
            "pitch",
            f"makes {n * passes.repeats} rows with their repeats, at most {MOST_ROWS} are laid; "
            f"got {1e3 * pitch:g} mm",
        )
    return 0.5 * (low + high) + pitch * (np.arange(n, dtype=np.float64) - 0.5 * (n - 1))


def _row(
    curves: Sequence[SurfaceCurve], row: int, offset: float, passes: Passes
) -> list[SurfaceCurve]:
    """Return what the margins at the ends leave of the curves of a row."""
    where = f"row {row + 1}, {1e3 * offset:.4g} mm along the plane normal: "
    if not curves:
        raise ValueError(where + "the plane does not cut the surface")
    margin = passes.end_margin
    left = []
    for curve in curves:
        if margin == 0.0 or is_closed(curve):
            left.append(curve)
        elif curve.length > 2.0 * margin + MEETING:
            left.append(clipped(curve, margin, curve.length - margin))
    if not left:
        raise ValueError(where + f"margins of {1e3 * margin:g} mm leave nothing of its passes")
    return left


class _Laid:
    """A curve with its steps."""

    def __init__(self, curve: SurfaceCurve, nodes: Array) -> None:
        self.nodes = nodes
        self.frames = curve.frames(self.nodes)
        self.bending = curve.bending(self.nodes)


def _ordered(
    rows: Sequence[Sequence[SurfaceCurve]],
    laid: Sequence[_Laid],
    order: Order,
    shortest: ShortestOrder,
) -> Iterator[tuple[int, int]]:
    """Yield which curve comes next, and 1 if it is travelled forwards, -1 if backwards."""
    if order is Order.SHORTEST:
        yield from shortest([one.frames for one in laid])
        return
    first = 0
    for number, row in enumerate(rows):
        here = range(first, first + len(row))
        first += len(row)
        if order is Order.BOTH:
            for index in here:
                yield index, 1
                yield index, -1
        elif order is Order.ZIGZAG and number % 2 == 1:
            yield from ((index, -1) for index in reversed(here))
        else:
            yield from ((index, 1) for index in here)
