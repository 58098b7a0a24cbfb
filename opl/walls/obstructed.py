"""Where along a wall the robot surely collides, whatever the posture within the pads of a cell.

A cell counts as forbidden only if at its middle bodies are nearer than allowed by more than they
can come apart within the cell. Looked at closer, so does one in which the part cuts into the wheel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.wheel_cuts import halved
from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem
from opl.search.walls import Piece
from opl.walls.columns import ColumnWalls
from opl.walls.cut_cells import surely_cuts_on
from opl.walls.shut_leads import ShutLeads

# into how many parts a cell is cut at each look, halvings of what is all in collision then, but not
# deep enough to be sure, and how few of those are halved on: what begins there is known closely
PARTS, WITHIN, FEW = (1, 4, 16), (4, 4, 6), (0, 0, 8)
PART_OF_A_WALL = 0.07  # of the work for one: a look, beside what is asked of solids
AROUND = 16  # cells on either side of those asked about that are looked at as well, at first


@dataclass
class _Known:
    """What is known of a piece: how often each cell was looked at, and which part of it is left.

    That is in fractions of the cell. And the piece: while it is kept, no other has its place.
    """

    piece: Piece
    low: Array
    high: Array
    looks: np.ndarray


class Obstructions:
    """Leaves out of walls where the robot collides.

    Args:
        problem: Motions that come nearer than the clearances of its scene do not count.
        leads: Where passes cannot begin or end; such motions do not count either.
        walls: Where the pieces are from. Those with the wrist flipped collide elsewhere.
    """

    def __init__(self, problem: GrindingProblem, leads: ShutLeads, walls: ColumnWalls) -> None:
        self._problem, self._collision = problem, problem.scene.collision
        self._leads = leads
        self._walls = walls
        self._flips = walls.images.flips
        self._known: dict[tuple[int, int], _Known] = {}

    @property
    def n_flips(self) -> int:
        """How many flips of the wrist a posture has."""
        return len(self._flips)

    def clear(
        self, piece: Piece, flip: int, first: int, end: int, looks: int
    ) -> tuple[Array, Array]:
        """Return what is left of cells as `Forbidden.clear` does; the first look is wider."""
        n = len(piece.pad_low)
        known = self._known.get((id(piece), flip))
        if known is None:
            known = _Known(piece, np.zeros(n), np.ones(n), np.zeros(n, dtype=int))
            self._known[id(piece), flip] = known
        if (known.looks[first:end] < looks).any():
            around = AROUND if looks == 1 else 0
            self._look(known, max(first - around, 0), min(end + around, n), looks, flip)
        return known.low, known.high

    def _look(self, known: _Known, first: int, end: int, looks: int, flip: int) -> None:
        """Look at the cells from ``first`` to before ``end``, but for those looked at before."""
        self._walls.made += PART_OF_A_WALL
        piece, (sign, shift) = known.piece, self._flips[flip]
        pads = np.maximum(piece.pad_high, -piece.pad_low)
        step = np.diff(piece.corners, axis=0)

        def surely(_: np.ndarray, low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
            ends = along(low), along(high)
            place = piece.line.T_workpiece_cutter
            shut, shut_there = self._leads.surely(place, piece.family, flip, *ends)
            if looks > 1:  # walls were held against the wheel in larger cells
                cut, cut_there = surely_cuts_on(self._problem, piece.line, *ends)
                shut, shut_there = shut | cut, shut_there | cut_there
            left = ~shut
            shut[left], near = collides(low[left], high[left])
            shut_there[left] |= near
            return shut, shut_there

        def along(place: Array) -> Array:
            return np.interp(place, np.arange(len(piece.at)), piece.at)

        def collides(low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
            middle, half = (low + high) / 2.0, (high - low)[:, None] / 2.0
            cell = middle.astype(int)
            q = piece.corners[cell] + step[cell] * (middle - cell)[:, None]
            turned = np.abs(step[cell]) * half + pads[cell]
            if looks > 1 and piece.bends is not None:
                # from the curve itself, whose slope is that of the chord but for four pads a cell
                on_curve = self._walls.postures(piece, along(middle))
                there = piece.bends[cell] & ~np.isnan(on_curve[:, 0])
                q[there] = on_curve[there]
                turned[there] = ((np.abs(step[cell]) + 4.0 * pads[cell]) * half)[there]
            return self._collide(q * sign + shift, turned)

        # the cells beside tell where collisions begin
        parts = PARTS[looks - 1]
        begin, last = max(first - 1, 0), min(end + 1, len(pads))
        ends = np.linspace(begin, last, (last - begin) * parts + 1)
        run = np.zeros(len(ends) - 1, dtype=int)
        within = WITHIN[looks - 1], FEW[looks - 1]
        _, low, high, hit = halved(run, ends[:-1], ends[1:], surely, *within)
        cell = ((low + high) / 2.0).astype(int)
        new = np.zeros(len(pads), dtype=bool)
        new[first:end] = known.looks[first:end] < looks
        left = ~hit & new[cell]
        known.looks[new], known.low[new], known.high[new] = looks, 1.0, 0.0
        np.minimum.at(known.low, cell[left], (low - cell)[left])
        np.maximum.at(known.high, cell[left], (high - cell)[left])

    def _collide(self, q: Array, turned: Array) -> tuple[np.ndarray, np.ndarray]:
        """Return where postures collide however they turn, and where they do as they are.

        Args:
            q: In [rad], shape (n, 6).
            turned: How far each joint can turn from there in [rad], shape (n, 6).
        """
        near = self._collision.collides(q)
        surely = near.copy()
        surely[near] = self._collision.collides_throughout(q[near], turned[near])
        return surely, near
