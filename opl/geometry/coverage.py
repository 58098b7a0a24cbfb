"""How much of a surface the passes come by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints

# points looked at between two cutter points of a pass are this much nearer than a pitch
_LOOKS_PER_PITCH = 8.0


@dataclass(frozen=True, eq=False)
class AreaSamples:
    """Points of a surface, each standing for the area around it.

    Attributes:
        points: In [m], shape (k, 3).
        normals: Outward unit normals, shape (k, 3).
        areas: In [m^2], shape (k,).
        uv: Parameters where the surface has them, nan elsewhere, shape (k, 2).
    """

    points: Array
    normals: Array
    areas: Array
    uv: Array

    @classmethod
    def joined(cls, parts: Sequence[AreaSamples]) -> AreaSamples:
        """Return the samples of several surfaces as one."""
        return cls(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("points", "normals", "areas", "uv")
            )
        )

    def chosen(self, which: NDArray[np.bool_]) -> AreaSamples:
        """Return some of the samples."""
        return AreaSamples(
            self.points[which], self.normals[which], self.areas[which], self.uv[which]
        )


def uncovered(samples: AreaSamples, points: CutterPoints, pitch: float) -> NDArray[np.bool_]:
    """Return which samples are more than half a pitch [m] away from every pass, shape (k,)."""
    from scipy.spatial import cKDTree

    looks, spacing = _looks_along(points, pitch)[0], pitch / _LOOKS_PER_PITCH
    distance, _ = cKDTree(looks).query(samples.points)
    # the nearest look may be half a spacing further along than the path itself
    return np.asarray(distance > np.hypot(0.5 * pitch * (1.0 + 1e-6), 0.5 * spacing))


def lying_on_others(
    cutter_points: CutterPoints, pitch: float, tolerance: float
) -> list[tuple[int, int]]:
    """Return the passes that run along an earlier one for at least half of their points.

    Args:
        cutter_points: The points of all passes.
        pitch: Distance of the rows in [m].
        tolerance: Passes that are no further apart than this are one [m].

    Returns:
        Pairs of passes, the earlier one first.
    """
    from scipy.spatial import cKDTree

    looks, owner = _looks_along(cutter_points, pitch)
    reach = float(np.hypot(tolerance, 0.5 * pitch / _LOOKS_PER_PITCH))
    points, pass_index = cutter_points.Ts_workpiece_cutter[:, :3, 3], cutter_points.pass_index
    own = [points[pass_index == k] for k in range(cutter_points.n_passes)]
    # a pass that lies on another one does so in its middle or in one of its quarters
    some = np.array([mine[[len(mine) // 4, len(mine) // 2, 3 * len(mine) // 4]] for mine in own])
    near = cKDTree(looks).query_ball_point(some.reshape(-1, 3), reach)
    found = []
    for k, mine in enumerate(own):
        others = {int(owner[look]) for looked in near[3 * k : 3 * k + 3] for look in looked}
        for other in sorted(other for other in others if other < k):
            distance, _ = cKDTree(looks[owner == other]).query(mine)
            if np.count_nonzero(distance <= reach) >= 0.5 * len(mine):
                found.append((other, k))
    return found


def _looks_along(cutter_points: CutterPoints, pitch: float) -> tuple[Array, np.ndarray]:
    """Return points along passes, close to each other, and the pass of each, (m, 3) and (m,)."""
    points, pass_index = cutter_points.Ts_workpiece_cutter[:, :3, 3], cutter_points.pass_index
    one_pass = np.diff(pass_index) == 0
    starts, ends = points[:-1][one_pass], points[1:][one_pass]
    lengths = np.linalg.norm(ends - starts, axis=1)
    counts = np.maximum(np.ceil(lengths * _LOOKS_PER_PITCH / pitch).astype(int), 1)
    which = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    fraction = (np.arange(len(which)) - first[which] + 0.5) / counts[which]
    between = starts[which] + fraction[:, None] * (ends - starts)[which]
    owner = np.concatenate([pass_index, pass_index[:-1][one_pass][which]])
    return np.concatenate([points, between]), owner
