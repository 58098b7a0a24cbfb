"""Cells of the contact position at places of a pass, in one posture, on one side of barriers.

Each is known as a chord in joint space with pads around it, and can be cut finer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem
from opl.search.walls import UNKNOWN, Wall
from opl.search.way_cells import Cells
from opl.walls.enclosed import ROUND_OFF
from opl.walls.sides import Side

PARTS = 2  # that a cell is cut into
UNSEEN, FREE, STRUCK = range(3)


@dataclass(frozen=True)
class PostureCells:
    """Cells of the columns of a pass in one posture, one column after the other.

    Attributes:
        family: Which posture.
        side: On which side of barriers.
        column: Column of each, shape (n,).
        t: Ends of each in belt units, shape (n, 2).
        q: Postures at the ends in [rad], shape (n, 2, 6).
        pad_low: How far below the chord the postures can be, shape (n, 6).
        pad_high: How far above.
        seen: Of collisions in the middle of each, `UNSEEN`, `FREE` or `STRUCK`, shape (n,).
        least: What a way through each costs at the least, as far as known, shape (n,).
    """

    family: int
    side: Side
    column: np.ndarray
    t: Array
    q: Array
    pad_low: Array
    pad_high: Array
    seen: np.ndarray
    least: Array

    @property
    def known(self) -> np.ndarray:
        """Of which the pads are known, shape (n,)."""
        return np.asarray(
            (self.pad_high < UNKNOWN).all(axis=1) & (self.pad_low > -UNKNOWN).all(axis=1)
        )

    @property
    def widths(self) -> Array:
        """How far joints turn over each, and pads are apart, all together in [rad], shape (n,)."""
        turned = np.abs(self.q[:, 1] - self.q[:, 0])
        return np.asarray((turned + self.pad_high - self.pad_low).sum(axis=1))

    def reach(self, n_columns: int) -> bool:
        """Return whether each of so many columns has a cell."""
        return len(np.unique(self.column)) == n_columns

    def in_columns(self, n_columns: int) -> Cells:
        """Return them as the search takes them."""
        return Cells(
            self.q[:, 0],
            self.q[:, 1] - self.q[:, 0],
            self.pad_low,
            self.pad_high,
            self.t[:, 0],
            self.t[:, 1],
            np.searchsorted(self.column, np.arange(n_columns + 1)),
        )

    def chosen(self, kept: np.ndarray) -> PostureCells:
        """Return some of the cells."""
        return PostureCells(
            self.family, self.side, self.column[kept], self.t[kept], self.q[kept],
            self.pad_low[kept], self.pad_high[kept], self.seen[kept], self.least[kept],
        )  # fmt: skip


def merged(
    old: PostureCells, new: PostureCells, at_old: np.ndarray, at_new: np.ndarray
) -> PostureCells:
    """Return the cells of two sets of columns, which have these numbers then."""
    column = np.concatenate([at_old[old.column], at_new[new.column]])
    both = PostureCells(
        old.family,
        old.side,
        column,
        np.concatenate([old.t, new.t]),
        np.concatenate([old.q, new.q]),
        np.concatenate([old.pad_low, new.pad_low]),
        np.concatenate([old.pad_high, new.pad_high]),
        np.concatenate([old.seen, new.seen]),
        np.concatenate([old.least, new.least]),
    )
    return both.chosen(np.argsort(column, kind="stable"))


def posture_cells(walls: list[Wall], family: int, side: Side) -> PostureCells:
    """Return the cells of walls across a pass, a column each."""
    pieces = [
        (column, piece)
        for column, wall in enumerate(walls)
        for piece in wall.pieces
        if piece.family == family and piece.side == side.number
    ]
    n = sum(len(piece.pad_low) for _, piece in pieces)
    found = PostureCells(
        family, side, np.empty(n, int), np.empty((n, 2)), np.empty((n, 2, 6)), np.empty((n, 6)),
        np.empty((n, 6)), np.full(n, UNSEEN, dtype=np.int8), np.zeros(n),
    )  # fmt: skip
    first = 0
    for column, piece in pieces:
        own = slice(first, first := first + len(piece.pad_low))
        found.column[own] = column
        found.t[own] = np.stack([piece.at[:-1], piece.at[1:]], axis=1)
        found.q[own] = np.stack([piece.corners[:-1], piece.corners[1:]], axis=1)
        found.pad_low[own], found.pad_high[own] = piece.pad_low, piece.pad_high
    return found


def cut(
    problem: GrindingProblem, places: Array, cells: PostureCells, chosen: np.ndarray
) -> PostureCells:
    """Return the cells, some of them cut into parts.

    The second derivative over a part lies within that over the whole, and pads fall with the
    square of the length. Cells whose pads are not known stay as they are.
    """
    known = cells.known & chosen
    parts = np.where(known, PARTS, 1)
    source = np.repeat(np.arange(len(parts)), parts)
    new = np.flatnonzero(known[source])
    share = np.tile(np.arange(PARTS), np.count_nonzero(known))[:, None] + np.array([0, 1])
    share = share / PARTS
    t, q = cells.t[source], cells.q[source]
    pad_low, pad_high = cells.pad_low[source], cells.pad_high[source]
    t[new] = t[new, :1] * (1.0 - share) + t[new, 1:] * share
    chord = q[new, :1] * (1.0 - share[..., None]) + q[new, 1:] * share[..., None]
    frames = problem.points.frames_at(places)[cells.column[source[new]]]
    Ts_base_flange = problem.cell.Ts_base_flange(t[new], frames[:, None])
    there = inverse_kinematics(problem.cell.robot.arm, Ts_base_flange)[:, :, cells.family]
    q[new] = there + 2.0 * np.pi * np.round((chord - there) / (2.0 * np.pi))
    pad_low[new] = (pad_low[new] + ROUND_OFF) / PARTS**2 - ROUND_OFF
    pad_high[new] = (pad_high[new] - ROUND_OFF) / PARTS**2 + ROUND_OFF
    # no posture at an end of a cell whose pads are known would be a contradiction; stay safe
    lost = np.isnan(q[new]).any(axis=(1, 2))
    pad_low[new[lost]], pad_high[new[lost]] = -UNKNOWN, UNKNOWN
    q[new[lost]] = chord[lost]
    seen = cells.seen[source]
    seen[new] = UNSEEN
    at = places[cells.column[source]]
    return PostureCells(
        cells.family, cells.side, cells.column[source], t, q, pad_low, pad_high, seen,
        cells.least[source],
    ).chosen(~cells.side.excludes(at, at, t[:, 0], t[:, 1]))  # fmt: skip
