"""How deep a part is in the wheel of a certificate, at the least, for `benchmarks.recheck`.

Lengths are in [m], angles in [rad], contact positions t in belt units.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import (
    ROUND_OFF,
    Array,
    Interval,
    Jet,
    dot,
    exactly,
    outwards,
    still,
)
from benchmarks.recheck_arms import SURE, Flags

SEEN = 256  # triangles of the part that are looked at along several directions
TRIED = 64  # that are sought to be deep in the wheel
WITNESSES = 12  # points of one
CLOSER = 6  # times that the deepest point is looked for, each time six times as near
GRID = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12.0
# ways out of the wheel that are tried: away from the axle where these points are, tilted
AWAY = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4.0
TILTS = np.deg2rad(np.arange(-90.0, 91.0, 10.0))


class Wheel:
    """A wheel that a part may sink into no deeper than so much.

    Args:
        certificate: As `benchmarks.certificate` writes it.
    """

    def __init__(self, certificate: dict[str, Any]) -> None:
        wheel = certificate["wheel"]
        self._width, self._radius = wheel["width"], wheel["radius"]
        self.flat = 500.0 * self._width
        self.last = self.flat + np.rad2deg(wheel["max_roll"])
        self._allowed = certificate["penetration"]
        self.triangles = np.array(certificate["triangles"])  # shape (n, 3, 3)

    def contact(self, low: Array, high: Array) -> list[list[Jet]]:
        """Return the contact frame in contact frame 0 over cells on the flat or on an edge."""
        one, zero = np.ones_like(low), np.zeros_like(low)
        rolled = (low + high) / 2.0 - np.clip((low + high) / 2.0, -self.flat, self.flat) != 0.0
        edge = np.where(rolled, np.clip(low, -self.flat, self.flat), 0.0)
        a, b = (np.deg2rad(np.where(rolled, t - edge, 0.0)) for t in (low, high))
        crest = np.where((a <= 0.0) & (b >= 0.0), 1.0, np.maximum(np.cos(a), np.cos(b)))
        cosine = outwards(np.minimum(np.cos(a), np.cos(b)) - ROUND_OFF, crest + ROUND_OFF)
        sine = outwards(np.sin(a) - ROUND_OFF, np.sin(b) + ROUND_OFF)
        rate = np.where(rolled, np.deg2rad(1.0), 0.0)
        speed, square = outwards(rate, rate), outwards(-(rate**2), -(rate**2))
        c = Jet(cosine, -(sine * speed), cosine * square)
        s = Jet(sine, cosine * speed, sine * square)
        value = Interval(np.where(rolled, edge, low), np.where(rolled, edge, high))
        drift = outwards(-np.where(rolled, 0.0, 1e-3), -np.where(rolled, 0.0, 1e-3))
        slide = Jet(value * outwards(-1e-3 * one, -1e-3 * one), drift, exactly(zero))
        nothing, whole = still(0.0, low), still(1.0, low)
        return [
            [c, nothing, s, slide],
            [nothing, whole, nothing, nothing],
            [-s, nothing, c, nothing],
        ]

    def too_deep(self, T_cutter_workpiece: Array, low: Array, high: Array) -> tuple[Flags, Flags]:
        """Return where the part is too deep all over a cell, and where it is in its middle.

        That it is, some points of one of its triangles show.
        """
        deep, middle = np.zeros(len(low), dtype=bool), np.zeros(len(low), dtype=bool)
        points = np.empty((0, 3))
        cutter = self.triangles @ T_cutter_workpiece[:3, :3].T + T_cutter_workpiece[:3, 3]
        for k, t in enumerate((low + high) / 2.0):
            # what shows it of the cell before may show it of this one
            if len(points) and self._holds(points, low[k], high[k]):
                deep[k] = middle[k] = True
                continue
            for triangle, weights in self.deep_points(cutter, float(t)):
                middle[k] = True
                points = weights @ cutter[triangle]
                if self._holds(points, low[k], high[k]):
                    deep[k] = True
                    break
        return deep, middle

    def deep_points(self, cutter: Array, t: float) -> Iterator[tuple[int, Array]]:
        """Yield triangles that are too deep, and the points that show it, as shares of the corners.

        Args:
            cutter: The triangles in the cutter frame, shape (n, 3, 3).
            t: Contact position.
        """
        slide = np.clip(t, -self.flat, self.flat)
        roll = np.deg2rad(t - slide)
        c, s = np.cos(roll), np.sin(roll)
        x = c * cutter[..., 0] + s * cutter[..., 2] - 1e-3 * slide
        z = c * cutter[..., 2] - s * cutter[..., 0] - self._radius
        seen = np.stack([x, cutter[..., 1], z], axis=-1)
        for triangle in self._hopeful(seen):
            weights, depth = self._witnesses(seen[triangle])
            if depth > self._allowed:
                yield int(triangle), weights

    def _hopeful(self, triangles: Array) -> NDArray[np.int64]:
        """Return the triangles that may be too deep, seen from the middle of the wheel."""
        x, y, z = np.moveaxis(triangles, -1, 0)
        # no deeper than along the axle, nor than square to it towards the middle of the triangle
        along = self._width / 2.0 + np.minimum(-x.min(axis=1), x.max(axis=1))
        my, mz = y.mean(axis=1, keepdims=True), z.mean(axis=1, keepdims=True)
        away = np.maximum(np.hypot(my, mz), 1e-9)
        radial = self._radius - ((y * my + z * mz) / away).min(axis=1)
        hope = np.minimum(along, radial)
        worth = np.flatnonzero(hope > self._allowed)
        worth = worth[np.argsort(-hope[worth], kind="stable")[:SEEN]]
        ways = self._ways_out(triangles[worth])
        still_worth = np.flatnonzero(ways > self._allowed)
        return worth[still_worth[np.argsort(-ways[still_worth], kind="stable")[:TRIED]]]

    def _ways_out(self, triangles: Array) -> Array:
        """Return how far it is out of the wheel for triangles, along some direction, (n,).

        No triangle is deeper in the wheel than that.
        """
        x, across = triangles[:, None, :, 0], triangles[..., 1:]
        away = AWAY @ across
        lengths = np.linalg.norm(away, axis=-1, keepdims=True)
        away = np.where(lengths > 1e-9, away / np.maximum(lengths, 1e-9), (0.0, 1.0))
        along = away @ across.swapaxes(1, 2)  # of each corner, shape (n, directions, 3)
        shortest = np.full(len(triangles), np.inf)
        for tilt in TILTS:
            c, s = np.cos(tilt), np.sin(tilt)
            begun = self._radius * c + self._width / 2.0 * abs(s)
            ways = begun - (c * along + s * x).min(axis=-1)
            shortest = np.minimum(shortest, ways.min(axis=-1))
        return shortest

    def _witnesses(self, triangle: Array) -> tuple[Array, float]:
        """Return points of a triangle, as shares of its corners, and how deep they show it to be.

        At each tilt from square to the axle to along it, some point has to be deep that way. Points
        are added for the tilt at which those before show least.
        """
        shares: list[Array] = []
        tilt, end, depth = np.pi / 4.0, 0, -np.inf
        for _ in range(WITNESSES):
            share, most = self._deepest(triangle, tilt, end)
            if most <= self._allowed:
                return np.array([share]), most  # that way it is out sooner
            shares.append(share)
            points = np.array(shares) @ triangle
            ways = self._ways(*points.T[[0, 0]], np.hypot(points[:, 1], points[:, 2]))
            found, tilt, end = least_of_most(*ways)
            if found <= depth + 1e-9:
                break
            depth = found
        return np.array(shares), depth

    def _deepest(self, triangle: Array, tilt: float, end: int) -> tuple[Array, float]:
        """Return about the point of a triangle that is deepest at a tilt, and how deep it is.

        It is tilted from square to the axle to one end of it.
        """
        middle, size = np.full(3, 1.0 / 3.0), 1.0
        for _ in range(CLOSER):
            shares = middle + size * (GRID - 1.0 / 3.0)
            shares = np.maximum(shares, 0.0)
            shares /= shares.sum(axis=1, keepdims=True)
            x, y, z = (shares @ triangle).T
            radial, ends = self._ways(x, x, np.hypot(y, z))
            depth = np.cos(tilt) * radial + np.sin(tilt) * ends[end]
            deepest = int(np.argmax(depth))
            middle, size = shares[deepest], size / 6.0
        return np.asarray(middle), float(depth[deepest])

    def _ways(self, x_low: Array, x_high: Array, away: Array) -> tuple[Array, Array]:
        """Return how deep points are square to the axle, and towards both its ends, at the least.

        Args:
            x_low: Least place along the axle from the middle of the wheel, shape (n,).
            x_high: Greatest.
            away: Farthest from the axle.
        """
        half = self._width / 2.0
        return self._radius - away, np.array([half - x_high, half + x_low])

    def _holds(self, points: Array, low: float, high: float) -> bool:
        """Return whether points at rest in the cutter frame are too deep all over a cell."""
        return self.surely_too_deep([outwards(v, v) for v in points.T], low, high)

    def surely_too_deep(self, points: Sequence[Interval], low: float, high: float) -> bool:
        """Return whether a triangle is, by points of it in the cutter frame, all over a cell."""
        n = len(points[0].low)
        cell = self.contact(np.array([low]), np.array([high]))
        rows = [[one.value for one in row] for row in cell]
        x, y, z = (dot(row, points) + row[3] for row in rows)
        height = z - exactly(np.full(n, self._radius))
        across, along = (np.maximum(np.abs(v.low), np.abs(v.high)) for v in (y, height))
        depth, _, _ = least_of_most(*self._ways(x.low, x.high, np.hypot(across, along)))
        return depth > self._allowed + SURE


def least_of_most(radial: Array, ends: Array) -> tuple[float, float, int]:
    """Return the shortest way out of the wheel of a body with points so deep in it, at the least.

    In a direction tilted by ``a`` from square to the axle towards one of its ends, a body overlaps
    the wheel by no less than the most of ``radial cos a + end sin a`` over its points: the support
    of a cylinder is that of its radius and that of its half width, added up. Between two tilts at
    which such a sum is positive it is concave, so it is no less than at the worse of the two.

    Args:
        radial: How deep each point is square to the axle, shape (n,).
        ends: And towards each end of the axle, shape (2, n).

    Returns:
        The least over all tilts of the most over the points, the tilt in [rad], and to which end.
    """
    worst = (np.inf, 0.0, 0)
    for end, axial in enumerate(ends):
        # where two points are as deep as each other
        rise, run = radial[:, None] - radial, axial - axial[:, None]
        crossing = np.arctan2(np.abs(rise), np.abs(run))[(rise * run > 0.0)]
        tilts = np.unique(np.concatenate([[0.0, np.pi / 4.0, np.pi / 2.0], crossing]))
        depth = np.cos(tilts)[:, None] * radial + np.sin(tilts)[:, None] * axial
        least = np.minimum(depth[:-1], depth[1:]).max(axis=1)
        at = int(np.argmin(least))
        if least[at] < worst[0]:
            tilt = tilts[at + int(depth[at].max() > depth[at + 1].max())]
            worst = (float(least[at]), float(tilt), end)
    return worst
