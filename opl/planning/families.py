"""The inverse solutions of a problem as families: unrolled angles, before any count of full turns.

All nodes of a family are images of these: the same after full turns of joints, or with the wrist
flipped. Which image a pass uses is its placement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.planning.columns import ColumnWalls, Seams
from opl.search.box import JointBox
from opl.search.outside import outside

MOST_GROWN = 200  # times that a box is grown for a column
GROWN = 1e-7  # [rad] less need not be grown for
JUMP = 0.5  # [rad] between neighbouring contact positions; more is no motion


@dataclass(frozen=True)
class Placement:
    """Which image of a family a pass uses.

    Attributes:
        family: The family.
        flip: Whether its wrist is flipped, index of `ColumnWalls.flips`.
        shift: Full turns in [rad], shape (6,).
        loose: Joints whose full turns are counted anew at each node, shape (6,).
        center: Where those should be near to, in [rad], shape (6,).
    """

    family: int
    flip: tuple[Array, Array]
    shift: Array
    loose: np.ndarray
    center: Array

    def of(self, q: Array) -> Array:
        """Return the placed joint positions, shape (..., 6)."""
        sign, shift = self.flip
        placed = q * sign + shift + self.shift
        turns = 2.0 * np.pi * np.round((self.center - placed) / (2.0 * np.pi))
        return np.asarray(np.where(self.loose, placed + turns, placed))


@dataclass(frozen=True)
class Fit:
    """How a pass fits into a box.

    Attributes:
        placement: The image.
        missing: How much the box must grow for each column of the pass, in [rad], shape (n,).
        row: Fractional row of the contact position where, shape (n,).
    """

    placement: Placement
    missing: Array
    row: Array


def grown(q: Array, free: np.ndarray, box: JointBox) -> JointBox | None:
    """Return a box grown until it holds a point of every column, the worst column first.

    None if some column has none.

    Args:
        q: Postures in [rad], shape (n, m, 6).
        free: Which may be used, shape (n, m).
        box: The box.
    """
    by_joint = np.ascontiguousarray(np.moveaxis(q, 1, 2))
    low, high = box.lower.copy(), box.upper.copy()
    missing, row = np.empty(len(q)), np.empty(len(q))
    for _ in range(MOST_GROWN):
        outside(by_joint, free, low, high, JUMP, missing, row)
        column = int(np.argmax(missing))
        if not np.isfinite(missing[column]):
            return None
        if missing[column] <= GROWN:
            break
        here = int(row[column])
        x = row[column] - here
        point = q[column, here]
        if x > 0.0:
            point = (1.0 - x) * point + x * q[column, here + 1]
        low, high = np.minimum(low, point), np.maximum(high, point)
    return JointBox(low, high)


class Families:
    """The unrolled angles of every family at some places.

    Args:
        walls: For families, flips and seams.
        seams: Where angles are cut open.
        q: Inverse solutions in [rad], shape (N, M, 8, 6).
        cuts: Where the part would sink too deep into the wheel, shape (N, M).
        pass_index: Pass of each column, shape (N,).
    """

    def __init__(
        self, walls: ColumnWalls, seams: Seams, q: Array, cuts: np.ndarray, pass_index: np.ndarray
    ) -> None:
        self._walls = walls
        self._seams = seams
        self._pass_index = pass_index
        self._unrolled = {}
        for family in walls.families:
            start = seams.start[family]
            unrolled = start + np.remainder(q[:, :, family] - start, 2.0 * np.pi)
            free = ~np.isnan(unrolled[..., 0]) & ~cuts
            free[free] = walls.within_limits(unrolled[free])
            if free.any():
                self._unrolled[family] = unrolled, free

    def fits(self, index: int, low: Array, high: Array, reference: bool) -> list[Fit]:
        """Return how every image of every family of a pass fits into a box.

        Args:
            index: The pass.
            low: Lower faces in [rad], shape (6,).
            high: Upper faces.
            reference: Whether only the families themselves count, not their images.
        """
        columns = self._pass_index == index
        found = []
        center = (low + high) / 2.0
        for family, (unrolled, free) in self._unrolled.items():
            for flip in self._walls.flips[: 1 if reference else None]:
                sign, shift = flip
                now = unrolled[columns] * sign + shift
                open_now = free[columns]
                loose = ~self._seams.kept[family]
                mean = now[open_now].mean(axis=0) if open_now.any() else center
                turns = 2.0 * np.pi * np.round((center - mean) / (2.0 * np.pi))
                whole = np.zeros(6) if reference else np.where(loose, 0.0, turns)
                placement = Placement(family, flip, whole, loose, center)
                q = np.ascontiguousarray(np.moveaxis(placement.of(unrolled[columns]), 1, 2))
                missing, row = np.empty(len(q)), np.empty(len(q))
                outside(q, np.ascontiguousarray(open_now), low, high, JUMP, missing, row)
                found.append(Fit(placement, missing, row))
        return found
