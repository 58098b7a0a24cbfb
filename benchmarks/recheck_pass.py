"""Cutter frames along the passes of a certificate, for `benchmarks.recheck`."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from benchmarks.intervals import (
    Array,
    Interval,
    Jet,
    Vector,
    cross,
    dot,
    exactly,
    outwards,
    still,
    unit,
)


class Passes:
    """Cutter frames at places of passes: fractional cutter points.

    Args:
        certificate: As `benchmarks.certificate` writes it.
    """

    def __init__(self, certificate: dict[str, Any]) -> None:
        self._Ts_workpiece_cutter = np.array(certificate["Ts_workpiece_cutter"])
        self._pass_index = certificate["pass_index"]
        self._all_along = lru_cache(maxsize=1)(self._frames)

    def require_one(self, first: float, last: float) -> None:
        """Do nothing if two places are on one pass.

        Raises:
            ValueError: If not.
        """
        if self._pass_index[int(first)] != self._pass_index[int(np.ceil(last))]:
            raise ValueError(f"places {first:g} and {last:g} are on two passes")

    def frame(self, place: float) -> Array:
        """Return a cutter frame between two, as the path is defined there."""
        before = min(int(place), len(self._Ts_workpiece_cutter) - 2)
        a, b = self._Ts_workpiece_cutter[before : before + 2]
        T = a + (place - before) * (b - a)
        z = T[:3, 2] / np.linalg.norm(T[:3, 2])
        x = T[:3, 0] - z * (z @ T[:3, 0])
        x /= np.linalg.norm(x)
        T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        return np.asarray(T)

    def in_cutter(self, points: Array, place: float) -> Array:
        """Return points of the workpiece in the cutter frame at a place, shape (..., 3)."""
        T = np.linalg.inv(self.frame(place))
        return np.asarray(points @ T[:3, :3].T + T[:3, 3])

    def between(self, first: int, low: Array, high: Array) -> tuple[Vector, Vector, Vector, Vector]:
        """Return axes and origin of the cutter frame over cells after a cutter point."""
        one, other = self._Ts_workpiece_cutter[first : first + 2]
        share = Jet(
            outwards(low - first, high - first),
            exactly(np.ones_like(low)),
            exactly(np.zeros_like(low)),
        )
        x, _, z, p = (
            [still(one[k, c], low) + share * still(other[k, c] - one[k, c], low) for k in range(3)]
            for c in range(4)
        )
        z = unit(z)
        lean = dot(x, z)
        x = unit([x[k] - z[k] * lean for k in range(3)])
        return x, cross(z, x), z, p

    def seen(self, points: Array, first: float, last: float) -> list[Interval]:
        """Return points of the workpiece in the cutter frame, all the way between two places.

        Args:
            points: Shape (n, 3).
            first: From this place
            last: to this one, not past the next cutter point.
        """
        *axes, p = self._all_along(first, last)
        v = [outwards(of, of) - its for of, its in zip(points.T, p, strict=True)]
        return [dot(axis, v) for axis in axes]

    def _frames(self, first: float, last: float) -> list[list[Interval]]:
        """Return axes and origin of the cutter frame all the way between two places."""
        frames = self.between(int(first), np.array([first]), np.array([last]))
        return [[one.value for one in column] for column in frames]
