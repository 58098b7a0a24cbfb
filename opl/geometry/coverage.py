"""How much of a surface the passes come by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from opl.geometry.frames import Array

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


def uncovered_fraction(
    samples: AreaSamples, points: Array, pass_index: np.ndarray, pitch: float
) -> float:
    """Return the part of the area that is more than half a pitch away from every pass, 0 to 1.

    Args:
        samples: Of the surface.
        points: Cutter points in [m], shape (n, 3).
        pass_index: Pass of each, shape (n,).
        pitch: Distance of the rows in [m].
    """
    one_pass = np.diff(pass_index) == 0
    starts, ends = points[:-1][one_pass], points[1:][one_pass]
    lengths = np.linalg.norm(ends - starts, axis=1)
    spacing = pitch / _LOOKS_PER_PITCH
    counts = np.maximum(np.ceil(lengths / spacing).astype(int), 1)
    which = np.repeat(np.arange(len(counts)), counts)
    first = np.cumsum(counts) - counts
    fraction = (np.arange(len(which)) - first[which] + 0.5) / counts[which]
    looks = starts[which] + fraction[:, None] * (ends - starts)[which]
    distance, _ = cKDTree(np.concatenate([points, looks])).query(samples.points)
    # the nearest look may be half a spacing further along than the path itself
    reach = np.hypot(0.5 * pitch * (1.0 + 1e-6), 0.5 * spacing)
    total = float(samples.areas.sum())
    return float(samples.areas[distance > reach].sum()) / total if total > 0.0 else 0.0
