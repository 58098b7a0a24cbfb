"""Encloses the walls of a certificate, for `benchmarks.recheck`.

Lengths are in [m], angles in [rad], contact positions t in belt units.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.intervals import Array, Vector, dot, still
from benchmarks.recheck_arms import SURE, TURN, Flags, Posture, arm_of
from benchmarks.recheck_depth import Wheel
from benchmarks.recheck_pass import Passes
from benchmarks.recheck_sides import ANY, Chain, Sides

UNKNOWN = 50.0  # more than joints turn
COARSE = 2e-5  # [rad] sum of the pads of a cell that is looked at first
SMALLEST = 1.0 / 1024.0  # cell that is not cut further then
HALVINGS = 12
ROW_PARTS = 16  # cells between two cutter points at one contact position


@dataclass(frozen=True)
class Cells:
    """Postures over cells of a wall: near the chord from start to end, up to pads, shape (n, 6)."""

    family: NDArray[np.int64]
    place: Array
    start: Array
    end: Array
    pad_low: Array
    pad_high: Array
    sides: NDArray[np.int64]  # of barriers, that a pass there may stay on

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
            self.sides,
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
        self._T_base_contact0 = np.array(wheel["T_base_contact0"])
        self._wheel, self._passes = Wheel(certificate), Passes(certificate)
        self._sides = Sides(certificate["barriers"], self._passes, self._wheel)
        self._T_workpiece_flange = np.linalg.inv(np.array(certificate["T_flange_workpiece"]))
        self._chains: list[Chain] = certificate["walls"]

    def walls(self) -> list[Cells]:
        """Return the walls of the certificate, and those where its barriers meet."""
        return [self.wall(chain) for chain in (*self._chains, *self._sides.meetings())]

    def wall(self, chain: Sequence[Sequence[float]]) -> Cells:
        """Return the cells of a wall, those left out in which nothing is allowed.

        Its corners are places and contact positions. From the least contact position to the
        greatest, one of the two the same from each corner to the next: whoever goes on along the
        pass, and never back, crosses it where it leads upwards or along the pass.

        Raises:
            ValueError: If the chain is not one, or leads from pass to pass.
        """
        if max(abs(chain[0][1] + self._wheel.last), abs(chain[-1][1] - self._wheel.last)) > SURE:
            raise ValueError("a wall ends within the contact positions of the wheel")
        places = [place for place, _ in chain]
        self._passes.require_one(min(places), max(places))
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

    def _column(self, place: float, first: float, last: float) -> Cells:
        """Return a place at the contact positions between two."""
        T_cutter_workpiece = np.linalg.inv(self._passes.frame(place))
        flat = self._wheel.flat
        stops = [first, *(t for t in (-flat, flat) if first < t < last), last]
        runs = [np.linspace(a, b, int(np.ceil(b - a)) + 1) for a, b in pairwise(stops)]
        low = np.concatenate([run[:-1] for run in runs])
        high = np.concatenate([run[1:] for run in runs])
        low, high = self._touching(T_cutter_workpiece, low, high)
        K = T_cutter_workpiece @ self._T_workpiece_flange

        def flange(low: Array, high: Array) -> list[Vector]:
            T = self._wheel.contact(low, high)
            base = [[still(self._T_base_contact0[r, c], low) for c in range(4)] for r in range(3)]
            C = [[dot(base[r], [T[k][c] for k in range(3)]) for c in range(4)] for r in range(3)]
            held = [[still(K[r, c], low) for c in range(4)] for r in range(3)]
            axes = [[dot(C[r], [held[k][c] for k in range(3)]) for r in range(3)] for c in range(4)]
            axes[3] = [axes[3][r] + C[r][3] + base[r][3] for r in range(3)]
            return axes

        at = np.array(place)
        return self._enclosed(flange, lambda *ends: self._sides.of(at, at, *ends), low, high)

    def _row(self, before: float, after: float, t: float) -> Cells:
        """Return the places between two at one contact position."""
        stops = np.unique([before, *np.arange(np.ceil(before), np.floor(after) + 1.0), after])
        at = np.full(1, t)

        def sides(low: Array, high: Array) -> NDArray[np.int64]:
            return self._sides.of(low, high, at, at)

        T = np.eye(4)
        contact = self._wheel.contact(at, at)
        for r, c in product(range(3), range(4)):
            T[r, c] = contact[r][c].value.low[0] / 2.0 + contact[r][c].value.high[0] / 2.0
        T_base_contact = self._T_base_contact0 @ T
        K = self._T_workpiece_flange
        found = []
        for a, b in pairwise(stops):

            def flange(low: Array, high: Array, first: int = int(a)) -> list[Vector]:
                x, y, z, p = self._passes.between(first, low, high)
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
            found.append(self._enclosed(flange, sides, grid[:-1], grid[1:]))
        return joined(found)

    def _enclosed(
        self,
        flange: Callable[[Array, Array], list[Vector]],
        sides: Callable[[Array, Array], NDArray[np.int64]],
        low: Array,
        high: Array,
    ) -> Cells:
        """Return the cells of a run; those whose pads are wide are cut further."""
        found = []
        for halving in range(HALVINGS + 1):
            n, families, wide = len(low), [], np.zeros(len(low), dtype=bool)
            # all over the cells, and where they begin and end
            every = flange(np.concatenate([low, low, high]), np.concatenate([high, low, high]))
            for family, known in enumerate(self.arm.postures(*every)):
                over, first, last = (known.part(slice(k * n, (k + 1) * n)) for k in range(3))
                cells = chords(family, over, first, last, low, high)
                cells = replace(cells, sides=sides(low, high))
                here = ~over.out_of_reach & self._within_limits(cells)
                spread = (cells.pad_high - cells.pad_low).sum(axis=1)
                wide |= here & (spread > self._fine)
                families.append((cells, here))
            wide &= (high - low > self._smallest) & (halving < HALVINGS)
            found += [cells.pick(here & ~wide) for cells, here in families]
            if not wide.any():
                break
            low, high = halves(low[wide], high[wide], wide[wide])
        kept = joined(found)
        return kept.pick(np.lexsort([kept.place, kept.family]))

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
        deep, middle = self._wheel.too_deep(T_cutter_workpiece, low, high)
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
            fresh = self._wheel.too_deep(T_cutter_workpiece, fresh_low, fresh_high)
            low, high = np.append(low[~edge], fresh_low), np.append(high[~edge], fresh_high)
            deep, middle = np.append(deep[~edge], fresh[0]), np.append(middle[~edge], fresh[1])
            order = np.argsort(low, kind="stable")
            low, high, deep, middle = low[order], high[order], deep[order], middle[order]
        return low[~deep], high[~deep]


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
    sides = np.full(n, ANY, dtype=np.int64)
    return Cells(families, (low + high) / 2.0, start, end, pad_low, pad_high, sides)
