"""Points to be ground, one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array, interpolate, read_only


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
        Ts, arc_length = read_only(self.Ts_workpiece_cutter), read_only(self.arc_length)
        pass_index = read_only(self.pass_index, np.int64)
        n = len(Ts)
        if Ts.shape != (n, 4, 4) or pass_index.shape != (n,) or arc_length.shape != (n,):
            raise ValueError(
                f"cutter points: shapes must be (N, 4, 4), (N,) and (N,), got {Ts.shape}, "
                f"{pass_index.shape} and {arc_length.shape}"
            )
        if not np.isin(np.diff(pass_index, prepend=-1), (0, 1)).all() or pass_index[:1].any():
            raise ValueError("pass_index: must count up from 0 without a gap")
        object.__setattr__(self, "Ts_workpiece_cutter", Ts)
        object.__setattr__(self, "pass_index", pass_index)
        object.__setattr__(self, "arc_length", arc_length)

    def __len__(self) -> int:
        return len(self.pass_index)

    @property
    def link_length(self) -> float:
        """Return the sum of the straight links from each pass to the next in [m]."""
        steps = np.linalg.norm(np.diff(self.Ts_workpiece_cutter[:, :3, 3], axis=0), axis=1)
        return float(steps[np.diff(self.pass_index) != 0].sum())

    @property
    def n_passes(self) -> int:
        """Return the number of passes."""
        return int(self.pass_index[-1]) + 1 if len(self) else 0

    def direction_at(self, column: int) -> float:
        """Return 1 if a pass runs along x of the cutter frame at a point, -1 if backwards."""
        on_pass = np.flatnonzero(self.pass_index == self.pass_index[column])
        before, after = max(column - 1, on_pass[0]), min(column + 1, on_pass[-1])
        T = self.Ts_workpiece_cutter
        along = (T[after, :3, 3] - T[before, :3, 3]) @ T[column, :3, 0]
        return -1.0 if along < 0.0 else 1.0

    def frames_at(self, place: Array) -> Array:
        """Return cutter frames at fractional cutter points, shape (..., 4, 4)."""
        before = np.clip(place.astype(int), 0, len(self) - 1)
        after = np.minimum(before + 1, len(self) - 1)
        Ts = self.Ts_workpiece_cutter
        return interpolate(Ts[before], Ts[after], place - before)

    def at_places(self, place: Array) -> CutterPoints:
        """Return fractional cutter points of some passes, shape (n,), as points of their own.

        Their passes count up from 0 again.
        """
        _, index = np.unique(self.pass_index[place.astype(int)], return_inverse=True)
        arc_length = np.interp(place, np.arange(len(self)), self.arc_length)
        return CutterPoints(self.frames_at(place), index, arc_length)
