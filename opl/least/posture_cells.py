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
    problem: GrindingProblem, places: np.ndarray, cells: PostureCells, chosen: np.ndarray
) -> PostureCells:
    """Return the cells, some of them cut into parts.

    The second derivative over a part lies within that over the whole, and pads fall with the
    square of the length. Cells whose pads are not known stay as they are.
    """
    known = cells.known & chosen
    parts = np.where(known, PARTS, 1)
    source = np.repeat(np.arange(len(parts)), parts)
    number = np.arange(len(source)) - np.repeat(np.cumsum(parts) - parts, parts)
    ends = (number[:, None] + np.array([0, 1])) / parts[source][:, None]
    t = cells.t[source]
    t = t[:, :1] * (1.0 - ends) + t[:, 1:] * ends
    chord = cells.q[source]
    chord = chord[:, :1] * (1.0 - ends[..., None]) + chord[:, 1:] * ends[..., None]
    frames = problem.points.Ts_workpiece_cutter[places[cells.column[source]]]
    Ts_base_flange = problem.cell.Ts_base_flange(t, frames[:, None])
    q = inverse_kinematics(problem.cell.robot.arm, Ts_base_flange)[:, :, cells.family]
    q = q + 2.0 * np.pi * np.round((chord - q) / (2.0 * np.pi))
    whole = known[source]
    finer = np.where(whole, PARTS**2, 1)[:, None]
    pad_low = (cells.pad_low[source] + ROUND_OFF) / finer - ROUND_OFF
    pad_high = (cells.pad_high[source] - ROUND_OFF) / finer + ROUND_OFF
    q = np.where(whole[:, None, None], q, chord)
    # no posture at an end of a cell whose pads are known would be a contradiction; stay safe
    lost = np.any(np.isnan(q), axis=(1, 2))
    pad_low[lost], pad_high[lost] = -UNKNOWN, UNKNOWN
    q[lost] = chord[lost]
    at = places[cells.column[source]]
    return PostureCells(
        cells.family, cells.side, cells.column[source], t, q, pad_low, pad_high,
        np.where(whole, UNSEEN, cells.seen[source]).astype(np.int8), cells.least[source],
    ).chosen(~cells.side.excludes(at, at, t[:, 0], t[:, 1]))  # fmt: skip
