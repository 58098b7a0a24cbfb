"""Cutter points of a surface by the equal-section method.

Parallel planes one row pitch apart cut the surface into curves; each curve is a pass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.sections import Section, section_curves
from opl.geometry.steps import balanced_steps
from opl.geometry.surface_grid import extent_along, sample_grid

# error of the interpolated curve as a fraction of the bow height
_CURVE_ERROR = 1e-3


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
            nodes = balanced_steps(curve, max_bow_height, largest_step)
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
