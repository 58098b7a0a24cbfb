"""Proves a bound on the joint range sum anew, from its certificate alone.

No code of opl is used, and no number that its search computed but the claim itself: a certificate
says where the walls are that every motion must cross, and which bound they are said to prove. Each
wall is enclosed anew, cell by cell, in interval arithmetic rounded outwards; cells go where a point
of the part is surely too deep in the wheel, or no count of full turns keeps the limits, or where
bodies are named that must not collide and near a box that is not refuted surely do. Where
barriers are named, each is shown to be shut all the way, and a motion stays on one side of it, so
that walls may be crossed on that side alone. Branch and bound then shows that no box below the
bound holds a posture of every wall. Its linear programs are
solved by HiGHS, and only their prices are used: any prices bound the box from below.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import coo_array

from benchmarks.intervals import Array
from benchmarks.recheck_arms import SURE, TURN, Flip
from benchmarks.recheck_bodies import Bodies
from benchmarks.recheck_sides import fitting, left_open
from benchmarks.recheck_walls import COARSE, Cells, Machine, joined

WORTH_TRYING = 1e-3  # of the bound: what a proof may lack for smaller cells to make a difference
NEAR = 0.02  # of the bound: how far from a box cells are held against what must not collide
MARK = 1000  # more than there are families
TRIMMED = 0.9  # of the cells: more left, and it is time to split


class Proof:
    """Branch and bound for the least box that holds a posture of every wall.

    Args:
        walls: The cells of each, as the machine encloses them.
        flips: What brings the wrist to either side.
        bound: Boxes below this size in [rad] should not exist.
        bodies: What must not collide, if that is to be minded.
    """

    def __init__(
        self,
        walls: Sequence[Cells],
        flips: Sequence[Flip],
        bound: float,
        bodies: Bodies | None = None,
    ) -> None:
        self._walls, self._flips, self._bound = walls, flips, bound
        self._bodies = bodies
        self.subproblems = 0
        self.missed = 0.0  # [rad] by how much a box stayed below the bound that was not refuted

    def holds(self) -> bool:
        """Return whether no box below the bound holds a posture of every wall."""
        # full turns and flips move a whole motion: at the first wall those near zero are looked at
        return all(
            self._family_holds(self._walls[0].pick(self._walls[0].family == family))
            for family in np.unique(self._walls[0].family)
        )

    def _family_holds(self, first: Cells) -> bool:
        """Return whether no such box holds one of these cells of the first wall."""
        table = [first, *(self._near(first, wall) for wall in self._walls[1:])]
        looked_at = [np.zeros(len(cells.place), dtype=bool) for cells in table]
        while True:
            box = self._missing(table)
            if box is None:
                return True
            if self._bodies is None:
                return False
            found = False
            for k, cells in enumerate(table):
                fresh = (outside(cells, box) < NEAR * self._bound) & ~looked_at[k]
                # marked by their families, which no image of a wall has
                marked = replace(cells, family=cells.family + MARK * (looked_at[k] | fresh))
                marked = self._bodies.cleared(marked, fresh)
                looked_at[k] = marked.family >= MARK
                table[k] = replace(marked, family=marked.family % MARK)
                found |= bool(fresh.any())
            if not found:
                return False

    def _missing(self, table: Sequence[Cells]) -> Array | None:
        """Return a box below the bound that was not refuted, None if there is none."""
        counts = [len(cells.place) for cells in table]
        if 0 in counts:
            return None
        self._cells = joined(table)
        self._of = np.repeat(np.arange(len(table)), counts)
        self._low, self._high = self._cells.low, self._cells.high
        waiting = [(0.0, 0, np.arange(len(self._of)))]
        number = 0
        while waiting:
            _, _, left = heapq.heappop(waiting)
            self.subproblems += 1
            size, parts, box = self._worked(left)
            if size >= self._bound:
                continue
            if not parts:
                self.missed = self._bound - size
                return box
            for part in parts:
                number += 1
                heapq.heappush(waiting, (size, number, part))
        return None

    def _near(self, first: Cells, wall: Cells) -> Cells:
        """Return the images of a wall's cells that lie within the bound of a cell of the first."""
        low, high = first.low.min(axis=0), first.high.max(axis=0)
        most = 2 + int(np.ceil(self._bound / TURN))  # no angle is beyond a turn, nor any box here
        found = []
        for family, sign, shift in self._flips:
            moved = wall.moved(sign, shift, family)
            counts = [
                [
                    n
                    for n in range(-most, most + 1)
                    if (self._gap(moved, low, high, TURN * n)[:, j] < self._bound).any()
                ]
                for j in range(6)
            ]
            for turns in product(*counts):
                away = self._gap(moved, low, high, TURN * np.array(turns)).sum(axis=1)
                if (near := away < self._bound).any():
                    cells = moved.pick(near)
                    found.append(cells.moved(np.ones(6), TURN * np.array(turns), 0))
        return joined(found) if found else wall.pick(np.zeros(len(wall.place), dtype=bool))

    def _gap(self, cells: Cells, low: Array, high: Array, shift: Array | float) -> Array:
        """Return how far cells, moved, are from a box along each joint."""
        return np.maximum(np.maximum(low - cells.high - shift, cells.low + shift - high), 0.0)

    def _worked(self, left: NDArray[np.int64]) -> tuple[float, list[NDArray[np.int64]], Array]:
        """Return a bound on boxes that hold one of some cells for each wall, and these cut in two.

        The bound is infinite where there is no such box below the one asked for. The least box of
        all is returned as well.
        """
        while True:
            left = self._within_reach(left)
            if not len(left):
                return np.inf, [], np.zeros((2, 6))
            size, pressing, box, place = self._relaxed(left)
            if size >= self._bound:
                return size, [], box
            of, starts = self._of[left], self._starts(left)
            least = np.minimum.reduceat(pressing, starts)
            kept = left[size + pressing - least[of] < self._bound + SURE]
            if len(kept) > TRIMMED * len(left):
                return size, self._cut(kept, box, place), box
            left = kept

    def _starts(self, left: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return where each wall begins in a list of cells."""
        return np.searchsorted(self._of[left], np.arange(self._of[-1] + 1))

    def _within_reach(self, left: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the cells that a box below the bound can hold with one of every other wall.

        None are left where some wall has none.
        """
        n_walls = self._of[-1] + 1
        while True:
            if len(np.unique(self._of[left])) < n_walls:
                return left[:0]
            starts = self._starts(left)
            low, high = self._low[left], self._high[left]
            # every box reaches this far down and up, whatever cells it holds
            most = np.minimum.reduceat(low, starts).max(axis=0)
            least = np.maximum.reduceat(high, starts).min(axis=0)
            edges = np.maximum(np.maximum(low, most) - np.minimum(high, least), 0.0)
            kept = edges.sum(axis=1) < self._bound + SURE
            # and on a side of each barrier on which it crosses every wall
            sides = self._cells.sides[left]
            crossed = np.bitwise_or.reduceat(sides, starts)
            kept &= fitting(sides, int(np.bitwise_and.reduce(crossed)))
            if kept.all():
                return left
            left = left[kept]

    def _relaxed(self, left: NDArray[np.int64]) -> tuple[float, Array, Array, Array]:
        """Return a bound, what cells press at its prices, the box, and which cell it meets of each.

        The least box over the convex hulls of what is left of each wall, pads and all.
        """
        cells = self._cells.pick(left)
        of, n_walls, n = self._of[left], int(self._of[-1]) + 1, len(left)
        lowest = np.concatenate([cells.start + cells.pad_low, cells.end + cells.pad_low])
        highest = np.concatenate([cells.start + cells.pad_high, cells.end + cells.pad_high])
        owner = np.concatenate([of, of])
        # rows: upper face less the lowest a wall may be there, and the highest less the lower face
        point, joint = (a.ravel() for a in np.indices((2 * n, 6)))
        row = owner[point] * 6 + joint
        half = 6 * n_walls
        face = np.arange(half)
        A = coo_array(
            (
                np.concatenate([lowest.ravel(), -highest.ravel(), -np.ones(half), np.ones(half)]),
                (
                    np.concatenate([row, half + row, face, half + face]),
                    np.concatenate([12 + point, 12 + point, face % 6, 6 + face % 6]),
                ),
            ),
            shape=(2 * half, 12 + 2 * n),
        ).tocsr()
        once = coo_array((np.ones(2 * n), (owner, 12 + np.arange(2 * n)))).tocsr()
        cost = np.concatenate([np.ones(6), -np.ones(6), np.zeros(2 * n)])
        bounds = [(None, None)] * 12 + [(0.0, None)] * (2 * n)
        found = linprog(cost, A, np.zeros(2 * half), once, np.ones(n_walls), bounds, "highs")
        prices = np.maximum(-found.ineqlin.marginals.reshape(2, n_walls, 6), 0.0)
        prices /= prices.sum(axis=1, keepdims=True)  # of each face together 1
        pressing = (prices[0][owner] * lowest - prices[1][owner] * highest).sum(axis=1)
        pressing = np.minimum(pressing[:n], pressing[n:])
        size = float(np.minimum.reduceat(pressing, self._starts(left)).sum()) - SURE
        box = np.stack([found.x[6:12], found.x[:6]])
        order = np.tile(left, 2) + np.repeat([0.0, 1.0], n)
        place = np.bincount(owner, found.x[12:] * order, minlength=n_walls)
        return size, pressing, box, place

    def _cut(self, left: NDArray[np.int64], box: Array, place: Array) -> list[NDArray[np.int64]]:
        """Return the cells in two parts, parted at the wall that the box misses most.

        By the sides of a barrier, if its cells are not on one side of it.
        """
        cells = self._cells.pick(left)
        missed = misses(cells.start, cells.end, box)
        starts = self._starts(left)
        ends = np.append(starts[1:], len(left))
        away = np.minimum.reduceat(missed, starts)
        away[ends - starts == 1] = -1.0  # one cell: nothing to part
        wall = int(np.argmax(away))
        own = np.arange(starts[wall], ends[wall])
        # if the box holds all that could be parted, it may yet hold no one side of a barrier
        if way := left_open(cells.sides if away[wall] <= 0.0 else cells.sides[own]):
            return [left[fitting(cells.sides, side)] for side in way]
        if away[wall] <= 0.0:
            return []
        # one piece: the same posture, one cell after the other
        kind = np.cumsum(np.any(np.abs(np.diff(cells.start[own], axis=0)) > 1.0, axis=1))
        kind = np.append(0, kind)
        nearest = int(np.argmin(missed[own]))
        if kind[-1] > 0:
            part = kind == kind[nearest]
        else:
            met = int(np.searchsorted(left[own], place[wall]))
            least = max(len(own) // 8, 1)
            at = int(np.clip(met, least, len(own) - least))
            part = np.arange(len(own)) < at
        return [np.delete(left, own[~part]), np.delete(left, own[part])]


def misses(start: Array, end: Array, box: Array) -> Array:
    """Return by how much a box misses chords, about: at some places along each."""
    share = np.linspace(0.0, 1.0, 9)[:, None, None]
    q = start + share * (end - start)
    out = np.maximum(np.maximum(box[0] - q, q - box[1]), 0.0).sum(axis=2)
    return np.asarray(out.min(axis=0))


def outside(cells: Cells, box: Array) -> Array:
    """Return how far cells are from a box, all joints added up."""
    away = np.maximum(np.maximum(box[0] - cells.high, cells.low - box[1]), 0.0)
    return np.asarray(away.sum(axis=1))


def recheck(certificate: dict[str, Any]) -> tuple[bool, int]:
    """Prove the bound of a certificate anew; return whether that succeeds, and the subproblems.

    Where it does not, it is tried over smaller cells.
    """
    subproblems = 0
    bodies = Bodies(certificate["bodies"]) if "bodies" in certificate else None
    for fine in (COARSE, COARSE / 10.0, COARSE / 100.0):
        machine = Machine(certificate, fine)
        walls = machine.walls()
        proof = Proof(walls, machine.arm.flips(), certificate["bound"], bodies)
        holds = proof.holds()
        subproblems += proof.subproblems
        if holds or proof.missed > WORTH_TRYING * certificate["bound"]:
            return holds, subproblems
    return False, subproblems
