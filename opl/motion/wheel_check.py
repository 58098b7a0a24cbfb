"""Which moves bring the held part too near to the wheel, or too deep into its belt.

Stretches of moves are looked at as a whole (`opl.cell.wheel_sweep`), in shorter parts where that
does not tell. What is left is short and mostly as deep in the belt as it may be: that is measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opl.cell.part_tree import PartTree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.wheel_sweep import surely_out
from opl.cell.wheel_triangle import TOLERANCE
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array, transform
from opl.motion.joint_lines import RESOLUTION
from opl.motion.motion import Motion

# Where the part may touch the wheel it turns and slides by many times what it may sink in.
# Stretches on which no corner of its box moves farther than this are looked at as a whole, the
# longest first
LENGTHS = 4e-3, 5e-4  # [m]
FINER = 8  # parts of the shortest ones, where the part could be too deep; a power of two
CERTAIN = 0.75  # of the allowed depth: that a place is no deeper than the rest is soon found out
LONGER = 1.02  # times the straight way from place to place: what the part goes, as it turns


@dataclass(frozen=True)
class _Stretches:
    """Stretches of moves of a motion.

    Attributes:
        move: The move of each, shape (n,).
        begin: Where it begins on it, 0 to 1, shape (n,).
        end: Where it ends, likewise.
    """

    move: np.ndarray
    begin: Array
    end: Array

    def __getitem__(self, chosen: np.ndarray) -> _Stretches:
        return _Stretches(self.move[chosen], self.begin[chosen], self.end[chosen])

    def parts(self, counts: np.ndarray) -> _Stretches:
        """Return each stretch in so many parts, shape (n,)."""
        of = np.repeat(np.arange(len(counts)), counts)
        part = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
        # the last part ends where the stretch does, to the last digit
        begin, end = (
            self.begin[of] * (1.0 - share) + self.end[of] * share
            for share in (part / counts[of], (part + 1) / counts[of])
        )
        return _Stretches(self.move[of], begin, end)


def too_near(
    cell: WorkCell, part: PartTree, motion: Motion, chosen: NDArray[np.bool_]
) -> tuple[np.ndarray, np.ndarray]:
    """Return which moves bring the part too near to the wheel, and which of them end there.

    Free moves keep the clearance of part and wheel, as their configurations tell; on others the
    part is nowhere deeper in the belt than planned.

    Args:
        cell: The cell.
        part: The triangles of the part.
        motion: The motion of n configurations.
        chosen: Which moves are looked at, by the configurations that they end at, shape (n,).

    Returns:
        Two flags for each move, by the configuration that it ends at, each of shape (n,).
    """
    return _Check(cell, part, motion).too_near(chosen)


class _Check:
    """The check of one motion."""

    def __init__(self, cell: WorkCell, part: PartTree, motion: Motion) -> None:
        self._cell, self._part, self._q, self._free = cell, part, motion.q, motion.free
        self._depth = -cell.planned_penetration

    def too_near(self, chosen: NDArray[np.bool_]) -> tuple[np.ndarray, np.ndarray]:
        """Return what `too_near` does."""
        sunk, at_end = np.zeros(len(self._q), dtype=bool), np.zeros(len(self._q), dtype=bool)
        moves = np.flatnonzero(chosen)
        turned = np.abs(self._q[moves] - self._q[np.maximum(moves - 1, 0)]).max(axis=1)
        counts = np.maximum(np.ceil(turned / RESOLUTION), 1).astype(int)
        free = self._free[moves] | (moves == 0)  # no move leads to the first configuration
        whole = _Stretches(moves, np.zeros(len(moves)), np.ones(len(moves)))
        away = whole[free].parts(counts[free])
        needed = np.where(self._free[away.move], self._cell.part_from_wheel, self._depth)
        self._note(away, self._distance(away, 1.0, needed, -np.inf) < needed, sunk, at_end)
        left, moved = self._left(whole[~free])
        self._measure(left, moved, sunk, at_end)
        return sunk, at_end

    def _left(self, stretches: _Stretches) -> tuple[_Stretches, Array]:
        """Return the stretches on which the part may be too deep, and how far it moves on each."""
        Ts = self._placed(self._q[stretches.move]), self._placed(self._q[stretches.move - 1])
        at = [transform(T[:, None], self._part.corners) for T in Ts]
        moved = np.linalg.norm(at[0] - at[1], axis=-1).max(axis=1)
        for length in LENGTHS:
            if not len(moved):
                break
            counts = np.maximum(np.ceil(moved / length), 1).astype(int)
            stretches, moved = stretches.parts(counts), np.repeat(moved / counts, counts)
            begin, middle, end = (
                self._placed(self._at(stretches, share)) for share in (0.0, 0.5, 1.0)
            )
            needed = np.full(len(moved), self._depth)
            out = surely_out(self._part, self._cell.wheel, begin, middle, end, needed)
            stretches, moved = stretches[~out], moved[~out]
        return stretches, moved

    def _measure(
        self, stretches: _Stretches, moved: Array, sunk: np.ndarray, at_end: np.ndarray
    ) -> None:
        """Note on which short stretches the part is too deep at either end, or on the way.

        A place between two that are measured is nearer than half of both distances by half the way
        between them at the most. Where that could matter, the way is halved.
        """
        if not len(moved):
            return
        needed, most = self._depth, CERTAIN * self._cell.planned_penetration
        way = LONGER * moved
        # what keeps its distance is not measured further; how deep it sinks matters no longer
        kept = needed + np.minimum(way / 2.0 + TOLERANCE, most)
        found = [self._distance(stretches, share, kept, needed) for share in (0.0, 1.0)]
        self._note(stretches, found[1] < needed, sunk, at_end)
        sunk[stretches.move[found[0] < needed]] = True
        apart = np.full((len(way), FINER + 1), np.inf)
        apart[:, 0], apart[:, -1] = np.minimum(found, kept)
        step = FINER
        while step > 1:
            before = np.arange(0, FINER, step)
            too_little = 2.0 * (needed + TOLERANCE) + way * step / FINER
            unsure = apart[:, before] + apart[:, before + step] < too_little[:, None]
            one, k = np.nonzero(unsure & ~sunk[stretches.move][:, None])
            middle, kept = before[k] + step // 2, way[one] * step / FINER / 4.0 + TOLERANCE
            kept = needed + np.minimum(kept, most)
            there = self._distance(stretches[one], middle / FINER, kept, needed)
            sunk[stretches.move[one[there < needed]]] = True
            apart[one, middle] = np.minimum(there, kept)
            step //= 2

    def _note(
        self, stretches: _Stretches, deep: np.ndarray, sunk: np.ndarray, at_end: np.ndarray
    ) -> None:
        """Note at the end of which stretches the part is too near."""
        sunk[stretches.move[deep]] = True
        at_end[stretches.move[deep & (stretches.end == 1.0)]] = True

    def _distance(
        self, stretches: _Stretches, share: Array | float, kept: Array, enough: Array | float
    ) -> Array:
        """Return `signed_wheel_distance` at some share of stretches in [m], shape (n,)."""
        Ts = self._placed(self._at(stretches, share))
        return signed_wheel_distance(self._part, self._cell.wheel, Ts, kept, enough)

    def _at(self, stretches: _Stretches, share: Array | float) -> Array:
        """Return the configurations at some share of stretches in [rad], shape (n, 6)."""
        at = (stretches.begin * (1.0 - share) + stretches.end * share)[:, None]
        return np.asarray(self._q[stretches.move - 1] * (1.0 - at) + self._q[stretches.move] * at)

    def _placed(self, q: Array) -> Array:
        """Return the poses of the part in contact frame 0, shape (n, 4, 4)."""
        Ts_base_flange = forward_kinematics(self._cell.robot, q)
        return np.asarray(self._cell.Ts_contact0_workpiece(Ts_base_flange))
