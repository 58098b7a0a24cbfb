"""Encloses the walls of a certificate, for `benchmarks.recheck`.

Lengths are in [m], angles in [rad], contact positions t in belt units.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import (
    ROUND_OFF,
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
from benchmarks.recheck_arms import SURE, TURN, Flags, Posture, arm_of

UNKNOWN = 50.0  # more than joints turn
COARSE = 2e-5  # [rad] sum of the pads of a cell that is looked at first
SMALLEST = 1.0 / 1024.0  # cell that is not cut further then
HALVINGS = 12
ROW_PARTS = 16  # cells between two cutter points at one contact position
TRIED = 64  # triangles of the part that are sought to be deep in the wheel
WITNESSES = 12  # points of one
CLOSER = 16  # times that the deepest point is looked for, each time twice as near
GRID = np.array([(i, j, 12 - i - j) for i in range(13) for j in range(13 - i)]) / 12.0


@dataclass(frozen=True)
class Cells:
    """Postures over cells of a wall: near the chord from start to end, up to pads, shape (n, 6)."""

    family: NDArray[np.int64]
    place: Array
    start: Array
    end: Array
    pad_low: Array
    pad_high: Array

    @property
    def low(self) -> Array:
        """Lower faces of boxes around them."""
        return np.minimum(self.start, self.end) + self.pad_low

    @property
    def high(self) -> Array:
        """Upper faces."""
        return np.maximum(self.start, self.end) + self.pad_high

    def pick(self, which: NDArray[Any]) -> Cells:
        """Return some of them."""
        return Cells(*(getattr(self, field.name)[which] for field in fields(self)))

    def moved(self, sign: Array, shift: Array, family: int) -> Cells:
        """Return them elsewhere: sign * q + shift, in another family."""
        mirrored = sign < 0.0
        return Cells(
            self.family + family,
            self.place,
            self.start * sign + shift,
            self.end * sign + shift,
            np.where(mirrored, -self.pad_high, self.pad_low),
            np.where(mirrored, -self.pad_low, self.pad_high),
        )


def joined(cells: Sequence[Cells]) -> Cells:
    """Return several as one."""
    every = [[getattr(one, field.name) for one in cells] for field in fields(Cells)]
    return Cells(*(np.concatenate(parts) for parts in every))


class Machine:
    """Encloses the postures on the walls of a certificate.

    Args:
        certificate: As `benchmarks.certificate` writes it.
        fine: Sum of the pads in [rad] of a cell that is not cut further.
    """

    def __init__(self, certificate: dict[str, Any], fine: float) -> None:
        self._fine = fine
        self._smallest = SMALLEST * min(np.sqrt(fine / COARSE), 1.0)
        robot, wheel = certificate["robot"], certificate["wheel"]
        self.arm = arm_of(robot["arm"])
        self._lower, self._upper = np.array(robot["lower"]), np.array(robot["upper"])
        self._width, self._radius = wheel["width"], wheel["radius"]
        self._T_base_contact0 = np.array(wheel["T_base_contact0"])
        self._flat = 500.0 * self._width
        self._last = self._flat + np.rad2deg(wheel["max_roll"])
        self._allowed = certificate["penetration"]
        self._T_workpiece_flange = np.linalg.inv(np.array(certificate["T_flange_workpiece"]))
        self._triangles = np.array(certificate["triangles"])  # shape (n, 3, 3)
        self._Ts_workpiece_cutter = np.array(certificate["Ts_workpiece_cutter"])
        self._pass_index = certificate["pass_index"]

    def wall(self, chain: Sequence[Sequence[float]]) -> Cells:
        """Return the cells of a wall, those left out in which nothing is allowed.

        Its corners are places and contact positions. From the least contact position to the
        greatest, one of the two the same from each corner to the next: whoever goes on along the
        pass, and never back, crosses it where it leads upwards or along the pass.

        Raises:
            ValueError: If the chain is not one, or leads from pass to pass.
        """
        if max(abs(chain[0][1] + self._last), abs(chain[-1][1] - self._last)) > SURE:
            raise ValueError("a wall ends within the contact positions of the wheel")
        places = [place for place, _ in chain]
        if self._pass_index[int(min(places))] != self._pass_index[int(np.ceil(max(places)))]:
            raise ValueError("a wall leads from one pass to another")
        parts = []
        for (place, t), (there, top) in pairwise(chain):
            if place == there and top > t:
                parts.append(self._column(place, t, top))
            elif top == t:
                parts.append(self._row(min(place, there), max(place, there), t))
            elif place != there:
                raise ValueError("a wall leads across places and contact positions at once")
        for k, part in enumerate(parts):
            part.place[:] += 1e4 * k  # one after the other
        return joined(parts)

    def _frame(self, place: float) -> Array:
        """Return a cutter frame between two, as the path is defined there."""
        before = min(int(place), len(self._Ts_workpiece_cutter) - 2)
        a, b = self._Ts_workpiece_cutter[before : before + 2]
        T = a + (place - before) * (b - a)
        z = T[:3, 2] / np.linalg.norm(T[:3, 2])
        x = T[:3, 0] - z * (z @ T[:3, 0])
        x /= np.linalg.norm(x)
        T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
        return np.asarray(T)

    def _column(self, place: float, first: float, last: float) -> Cells:
        """Return a place at the contact positions between two."""
        T_cutter_workpiece = np.linalg.inv(self._frame(place))
        stops = [first, *(t for t in (-self._flat, self._flat) if first < t < last), last]
        runs = [np.linspace(a, b, int(np.ceil(b - a)) + 1) for a, b in pairwise(stops)]
        low = np.concatenate([run[:-1] for run in runs])
        high = np.concatenate([run[1:] for run in runs])
        low, high = self._touching(T_cutter_workpiece, low, high)
        K = T_cutter_workpiece @ self._T_workpiece_flange

        def flange(low: Array, high: Array) -> list[Vector]:
            T = self._contact(low, high)
            base = [[still(self._T_base_contact0[r, c], low) for c in range(4)] for r in range(3)]
            C = [[dot(base[r], [T[k][c] for k in range(3)]) for c in range(4)] for r in range(3)]
            held = [[still(K[r, c], low) for c in range(4)] for r in range(3)]
            axes = [[dot(C[r], [held[k][c] for k in range(3)]) for r in range(3)] for c in range(4)]
            axes[3] = [axes[3][r] + C[r][3] + base[r][3] for r in range(3)]
            return axes

        return self._enclosed(flange, low, high)

    def _contact(self, low: Array, high: Array) -> list[list[Jet]]:
        """Return the contact frame in contact frame 0 over cells on the flat or on an edge."""
        one, zero = np.ones_like(low), np.zeros_like(low)
        rolled = (low + high) / 2.0 - np.clip((low + high) / 2.0, -self._flat, self._flat) != 0.0
        edge = np.where(rolled, np.clip(low, -self._flat, self._flat), 0.0)
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

    def _row(self, before: float, after: float, t: float) -> Cells:
        """Return the places between two at one contact position."""
        stops = np.unique([before, *np.arange(np.ceil(before), np.floor(after) + 1.0), after])
        at = np.full(1, t)
        T = np.eye(4)
        contact = self._contact(at, at)
        for r, c in product(range(3), range(4)):
            T[r, c] = contact[r][c].value.low[0] / 2.0 + contact[r][c].value.high[0] / 2.0
        T_base_contact = self._T_base_contact0 @ T
        K = self._T_workpiece_flange
        found = []
        for a, b in pairwise(stops):
            first = int(a)
            one, other = self._Ts_workpiece_cutter[first : first + 2]

            def flange(
                low: Array, high: Array, one: Array = one, other: Array = other, n: int = first
            ) -> list[Vector]:
                share = Jet(
                    outwards(low - n, high - n),
                    exactly(np.ones_like(low)),
                    exactly(np.zeros_like(low)),
                )
                x, _, z, p = (
                    [
                        still(one[k, c], low) + share * still(other[k, c] - one[k, c], low)
                        for k in range(3)
                    ]
                    for c in range(4)
                )
                z = unit(z)
                lean = dot(x, z)
                x = unit([x[k] - z[k] * lean for k in range(3)])
                y = cross(z, x)
                axes = []
                for c in range(4):
                    v = [still(K[k, c], low) for k in range(3)]
                    v = [v[k] - p[k] for k in range(3)] if c == 3 else v
                    local = (dot(x, v), dot(y, v), dot(z, v))
                    base = [[still(T_base_contact[r, k], low) for k in range(4)] for r in range(3)]
                    turned = [dot(base[r], local) for r in range(3)]
                    axes.append([turned[r] + base[r][3] if c == 3 else turned[r] for r in range(3)])
                return axes

            grid = np.linspace(a, b, ROW_PARTS + 1)
            found.append(self._enclosed(flange, grid[:-1], grid[1:]))
        return joined(found)

    def _enclosed(
        self, flange: Callable[[Array, Array], list[Vector]], low: Array, high: Array
    ) -> Cells:
        """Return the cells of a run; those whose pads are wide are cut further."""
        found = []
        for halving in range(HALVINGS + 1):
            whole, starts, ends = (
                list(self.arm.postures(*flange(a, b)))
                for a, b in ((low, high), (low, low), (high, high))
            )
            families, wide = [], np.zeros(len(low), dtype=bool)
            for family, (over, first, last) in enumerate(zip(whole, starts, ends, strict=True)):
                cells = chords(family, over, first, last, low, high)
                here = ~over.out_of_reach & self._within_limits(cells)
                spread = (cells.pad_high - cells.pad_low).sum(axis=1)
                wide |= here & (spread > self._fine)
                families.append((cells, here))
            wide &= (high - low > self._smallest) & (halving < HALVINGS)
            found += [cells.pick(here & ~wide) for cells, here in families]
            if not wide.any():
                break
            low, high = halves(low[wide], high[wide], wide[wide])
        every = joined(found)
        return every.pick(np.lexsort([every.place, every.family]))

    def _within_limits(self, cells: Cells) -> Flags:
        """Return which some full turns, with the wrist to either side, bring within the limits."""
        kept = np.zeros(len(cells.place), dtype=bool)
        for _, sign, shift in self.arm.flips():
            moved = cells.moved(sign, shift, 0)
            up = TURN * np.ceil((self._lower - moved.high) / TURN - SURE)
            kept |= (moved.low + up <= self._upper + SURE).all(axis=1)
        return kept

    def _touching(self, T_cutter_workpiece: Array, low: Array, high: Array) -> tuple[Array, Array]:
        """Return the cells in which the part is nowhere sure to be too deep in the wheel."""
        deep, middle = self._too_deep(T_cutter_workpiece, low, high)
        for _ in range(HALVINGS):
            edge = np.zeros(len(low), dtype=bool)
            beside = (middle[1:] != middle[:-1]) & (low[1:] == high[:-1])
            edge[1:] |= beside
            edge[:-1] |= beside
            edge |= middle
            edge &= ~deep & (high - low > self._smallest)
            if not edge.any():
                break
            fresh_low, fresh_high = halves(low[edge], high[edge], np.ones(edge.sum(), dtype=bool))
            fresh = self._too_deep(T_cutter_workpiece, fresh_low, fresh_high)
            low, high = np.append(low[~edge], fresh_low), np.append(high[~edge], fresh_high)
            deep, middle = np.append(deep[~edge], fresh[0]), np.append(middle[~edge], fresh[1])
            order = np.argsort(low, kind="stable")
            low, high, deep, middle = low[order], high[order], deep[order], middle[order]
        return low[~deep], high[~deep]

    def _too_deep(self, T_cutter_workpiece: Array, low: Array, high: Array) -> tuple[Flags, Flags]:
        """Return where the part is too deep all over a cell, and where it is in its middle.

        That it is, some points of one of its triangles show.
        """
        deep, middle = np.zeros(len(low), dtype=bool), np.zeros(len(low), dtype=bool)
        points = np.empty((0, 3))
        cutter = self._triangles @ T_cutter_workpiece[:3, :3].T + T_cutter_workpiece[:3, 3]
        for k, t in enumerate((low + high) / 2.0):
            # what shows it of the cell before may show it of this one
            ends = np.full(len(points), low[k]), np.full(len(points), high[k])
            if len(points) and self._least_depth(points, *ends) > self._allowed + SURE:
                deep[k] = middle[k] = True
                continue
            slide = np.clip(t, -self._flat, self._flat)
            roll = np.deg2rad(t - slide)
            c, s = np.cos(roll), np.sin(roll)
            x = c * cutter[..., 0] + s * cutter[..., 2] - 1e-3 * slide
            z = c * cutter[..., 2] - s * cutter[..., 0] - self._radius
            seen = np.stack([x, cutter[..., 1], z], axis=-1)
            for triangle in self._hopeful(seen):
                weights, depth = self._witnesses(seen[triangle])
                if depth <= self._allowed:
                    continue
                middle[k] = True
                points = weights @ cutter[triangle]
                ends = np.full(len(points), low[k]), np.full(len(points), high[k])
                if self._least_depth(points, *ends) > self._allowed + SURE:
                    deep[k] = True
                    break
        return deep, middle

    def _hopeful(self, triangles: Array) -> NDArray[np.int64]:
        """Return the triangles that may be too deep, seen from the middle of the wheel."""
        x, y, z = np.moveaxis(triangles, -1, 0)
        # no deeper than along the axle, nor than square to it towards the middle of the triangle
        beside = np.where(np.ptp(np.sign(x), axis=1) > 1.0, 0.0, np.abs(x).min(axis=1))
        my, mz = y.mean(axis=1, keepdims=True), z.mean(axis=1, keepdims=True)
        away = np.maximum(np.hypot(my, mz), 1e-9)
        radial = self._radius - ((y * my + z * mz) / away).min(axis=1)
        hope = np.minimum(self._width / 2.0 - beside, radial)
        worth = np.flatnonzero(hope > self._allowed)
        return worth[np.argsort(-hope[worth], kind="stable")[:TRIED]]

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
            middle, size = shares[deepest], size * 0.5
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

    def _least_depth(self, points: Array, low: Array, high: Array) -> float:
        """Return how deep a triangle is at the least all over a cell, by points of it."""
        cell = self._contact(low, high)
        x, y, z = (
            (dot(cell[r], [still(v, low) for v in points.T]) + cell[r][3]).value for r in range(3)
        )
        height = z - exactly(np.full(len(points), self._radius))
        across, along = (np.maximum(np.abs(v.low), np.abs(v.high)) for v in (y, height))
        return least_of_most(*self._ways(x.low, x.high, np.hypot(across, along)))[0]


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


def halves(low: Array, high: Array, which: Flags) -> tuple[Array, Array]:
    """Return cells, some of them cut in two."""
    middle = (low[which] + high[which]) / 2.0
    first, last = np.append(low, middle), np.append(high, high[which])
    last[: len(high)][which] = middle
    order = np.argsort(first, kind="stable")
    return first[order], last[order]


def chords(
    family: int, over: Posture, first: Posture, last: Posture, low: Array, high: Array
) -> Cells:
    """Return cells as chords with pads, from what is known all over them and at their ends."""
    n = len(low)
    start, end, pad_low, pad_high = (np.empty((n, 6)) for _ in range(4))
    eighth = (high - low) ** 2 / 8.0
    with np.errstate(invalid="ignore"):
        for j in range(6):
            q, a, b = over.q[j], first.q[j].value, last.q[j].value
            start[:, j] = (a.low + a.high) / 2.0
            step = (b.low + b.high) / 2.0 - start[:, j]
            end[:, j] = start[:, j] + step - TURN * np.round(step / TURN)
            doubt = SURE + (a.high - a.low) + (b.high - b.low)
            pad_low[:, j] = np.minimum(0.0, -eighth * q.second.high) - doubt
            pad_high[:, j] = np.maximum(0.0, -eighth * q.second.low) + doubt
            fast = np.maximum(np.abs(q.first.low), np.abs(q.first.high)) * (high - low)
            # no derivative: the angle itself, if that is known
            rough = ~np.isfinite(pad_low[:, j] + pad_high[:, j] + start[:, j] + end[:, j])
            rough |= ~(fast < np.pi / 2.0)
            middle, wide = (q.value.low + q.value.high) / 2.0, (q.value.high - q.value.low) / 2.0
            known = np.isfinite(middle) & (wide < 0.5)
            start[rough, j] = end[rough, j] = np.where(known, middle, 0.0)[rough]
            pad_high[rough, j] = np.where(known, wide + SURE, UNKNOWN)[rough]
            pad_low[rough, j] = -pad_high[rough, j]
    families = np.full(n, family, dtype=np.int64)
    return Cells(families, (low + high) / 2.0, start, end, pad_low, pad_high)
