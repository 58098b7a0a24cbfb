"""Strips: what a track passes between two cutter points, wherever and however t changes there.

From one cutter point to the next the contact position may change anywhere on the way, evenly or at
one place. What is common to all these motions bounds from below what any of them costs. So the
strip between the two is cut into cells by lines, places between the cutter points, and by the rows
of the node matrix. A motion passes from cell to cell: over a line, where t lies in a gap between
two rows, or over a row, at a place between two lines. Each of these crossings is known up to a
small interval for every joint.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit

from opl.geometry.frames import Array


@dataclass(frozen=True)
class Strips:
    """The cells of the steps that are looked at closely, the others have none.

    Attributes:
        start: First cell of each step and the end of the last, int64, shape (n_columns,).
        row_low: Least joint positions in [rad] while t passes a row within a cell, shape (n_cells,
            6, n_rows); minus infinity where they are not known.
        row_high: Greatest of these, plus infinity where they are not known.
        gap_low: Least joint positions in [rad] on the line where a cell ends while t is between the
            row before and the row; not looked at for the last cell of a step. Shape like row_low.
        gap_high: Greatest of these.
    """

    start: np.ndarray
    row_low: Array
    row_high: Array
    gap_low: Array
    gap_high: Array

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The attributes as the inner loops take them."""
        return self.start, self.row_low, self.row_high, self.gap_low, self.gap_high


def no_strips(n_columns: int, n_rows: int) -> Strips:
    """Return the strips of a ladder of which no step is looked at closely."""
    nothing = np.empty((0, 6, n_rows))
    return Strips(np.zeros(n_columns, dtype=np.int64), nothing, nothing, nothing, nothing)


def strips_of(q: Array, exact: np.ndarray, in_order: bool) -> Strips:
    """Return the strips of a ladder with columns between its cutter points.

    Args:
        q: Joint positions in [rad], NaN where there is no configuration, shape (n, n_rows, 6).
        exact: Which columns are cutter points, shape (n,); those between two of them are evenly
            spaced.
        in_order: Whether each row is the next contact position after the row before.
    """
    at = np.flatnonzero(exact)
    n_rows = q.shape[1]
    start = np.zeros(len(at), dtype=np.int64)
    parts: list[tuple[Array, Array, Array, Array]] = []
    for step, (first, last) in enumerate(pairwise(at)):
        looked_at = in_order and last > first + 1
        start[step + 1] = start[step] + (last - first if looked_at else 0)
        if looked_at:
            parts.append(_cells(q[first : last + 1]))
    if not parts:
        return no_strips(len(at), n_rows)
    return Strips(
        start, *(np.ascontiguousarray(np.concatenate(p)) for p in zip(*parts, strict=True))
    )


def _cells(q: Array) -> tuple[Array, Array, Array, Array]:
    """Return the intervals of one step, its lines evenly spaced, shape of q (k + 1, n_rows, 6)."""
    q = np.moveaxis(q, 1, 2)  # (k + 1, 6, n_rows)
    # along the path: twice the sagitta of the motion between two lines, from second differences
    bend = np.abs(np.diff(q, n=2, axis=0))
    bend = np.maximum(np.concatenate([bend[:1], bend]), np.concatenate([bend, bend[-1:]]))
    row_low = np.minimum(q[:-1], q[1:]) - bend / 4.0
    row_high = np.maximum(q[:-1], q[1:]) + bend / 4.0
    # across: the same, and enough where t passes an edge of the wheel and the motion has a corner
    line = q[1:]
    bend = np.abs(np.diff(line, n=2, axis=2, prepend=np.nan, append=np.nan))
    before, after = line[..., :-1], line[..., 1:]
    over = (np.nan_to_num(bend[..., :-1]) + np.nan_to_num(bend[..., 1:])) / 4.0
    pad = np.full((*line.shape[:2], 1), np.nan)
    gap_low = np.concatenate([pad, np.minimum(before, after) - over], axis=2)
    gap_high = np.concatenate([pad, np.maximum(before, after) + over], axis=2)
    return (
        np.where(np.isnan(row_low), -np.inf, row_low),
        np.where(np.isnan(row_high), np.inf, row_high),
        np.where(np.isnan(gap_low), -np.inf, gap_low),
        np.where(np.isnan(gap_high), np.inf, gap_high),
    )


_Q, _F1 = "float64[:,:,::1]", "float64[::1]"


@njit(f"float64[:,::1]({_Q},{_Q},{_F1},{_F1},float64)", cache=True)
def growth(below, above, low, high, threshold):  # type: ignore[no-untyped-def]
    """Return the size of a core with each interval taken in, infinite from a threshold on.

    Args:
        below: Lower ends in [rad], shape (k, 6, n_rows).
        above: Upper ends in [rad], shape (k, 6, n_rows).
        low: Lower faces of the core, shape (6,).
        high: Upper faces of the core, shape (6,).
        threshold: Sizes from this on are of no interest.
    """
    n_cells, n_joints, n_rows = below.shape
    sizes = np.zeros((n_cells, n_rows))
    for cell in range(n_cells):
        for joint in range(n_joints):
            for row in range(n_rows):
                edge = max(below[cell, joint, row], high[joint]) - min(
                    above[cell, joint, row], low[joint]
                )
                sizes[cell, row] += max(edge, 0.0)
    return np.where(sizes < threshold, sizes, np.inf)


@njit("void(float64[:,::1],float64[:,::1],float64[::1])", cache=True)
def sweep(over_row, over_gap, gaps):  # type: ignore[no-untyped-def]
    """Carry the cost of being in each gap at the start of a strip to its end.

    Args:
        over_row: Cost of passing each row in each cell, shape (k, n_rows).
        over_gap: Cost of each gap at the end of each cell, shape (k, n_rows).
        gaps: Cost so far of being in the gap below each row, and above the last; changed, shape
            (n_rows + 1,).
    """
    n_cells, n_rows = over_row.shape
    for cell in range(n_cells):
        for row in range(n_rows):
            gaps[row + 1] = min(gaps[row + 1], max(gaps[row], over_row[cell, row]))
        for row in range(n_rows - 1, -1, -1):
            gaps[row] = min(gaps[row], max(gaps[row + 1], over_row[cell, row]))
        if cell < n_cells - 1:
            for row in range(n_rows):
                gaps[row] = max(gaps[row], over_gap[cell, row])
            gaps[n_rows] = np.inf
            gaps[0] = np.inf
