"""What a joint box must hold of whole tracks: the dearest place, and what strips share."""

from __future__ import annotations

import numpy as np
from numba import njit

from opl.search.box import sizes_with
from opl.search.ladder import allowed
from opl.search.strips import growth, sweep

_Q, _B = "float64[:,:,::1]", "boolean[:,::1]"
_F1, _I1 = "float64[::1]", "int64[::1]"


@njit(
    f"Tuple((float64,int64))({_Q},{_B},{_F1},boolean[::1],float64,{_F1},float64,{_I1},{_I1},{_I1},"
    f"{_F1},{_F1},float64,{_I1},{_I1},{_Q},{_Q},{_Q},{_Q})",
    cache=True,
)
def bottleneck(  # type: ignore[no-untyped-def]
    q, free, t, off_wheel, max_t_step, max_t_change, max_q_step, blocked,
    first, last, low, high, threshold, rows, start, row_low, row_high, gap_low, gap_high,
):  # fmt: skip
    """Find the connected track whose most expensive place is cheapest to take into a core.

    Places are its nodes, and what it passes in the strips between them. Every box that contains the
    core and holds a connected track is at least that large.

    Args:
        q: Nodes in [rad], shape (n_columns, 6, n_rows).
        free: Which may be used, shape (n_columns, n_rows).
        t: Contact position of each row, shape (n_rows,).
        off_wheel: Which steps leave the wheel, shape (n_columns - 1,).
        max_t_step: As in `Ladder`, ``max_contact_step``.
        max_t_change: As in `Ladder`, ``max_contact_change``.
        max_q_step: As in `Ladder`, ``max_joint_step``.
        blocked: Sorted keys of steps that are not free.
        first: First row in play of each column, shape (n_columns,).
        last: Last row in play of each column, shape (n_columns,).
        low: Lower faces of the core, shape (6,).
        high: Upper faces of the core, shape (6,).
        threshold: Nodes that make the box this large in [rad] are not used.
        rows: Filled with the track, shape (n_columns,).
        start: What a track passes between the columns, as in `Strips`, as are the next four.
        row_low: Least joint positions on the rows.
        row_high: Greatest joint positions on the rows.
        gap_low: Least joint positions in the gaps between them.
        gap_high: Greatest joint positions in the gaps between them.

    Returns:
        The size of the core with that place in [rad], infinite if there is no track; and the column
        of the most expensive node.
    """
    n_columns, _, n_rows = q.shape
    sizes = np.full((n_columns, n_rows), np.inf)
    best = np.full((n_columns, n_rows), np.inf)
    before = np.full((n_columns, n_rows), -1)
    reached = np.empty(n_rows, dtype=np.int64)  # rows of the column before that a track reaches
    gaps = np.empty(n_rows + 1)
    n_reached = 0
    for column in range(n_columns):
        sizes_with(q, column, first[column], last[column], low, high, sizes[column])
        for row in range(first[column], last[column] + 1):
            size = sizes[column, row]
            if not free[column, row] or size >= threshold:
                continue
            if column == 0:
                best[column, row] = size
                continue
            if start[column] > start[column - 1]:
                continue
            for k in range(n_reached):
                here = reached[k]
                if best[column - 1, here] >= best[column, row]:
                    continue
                if not allowed(
                    q, t, off_wheel, max_t_step, max_t_change, max_q_step, blocked,
                    column - 1, here, row,
                ):  # fmt: skip
                    continue
                best[column, row] = max(best[column - 1, here], size)
                before[column, row] = here
                if best[column - 1, here] <= size:
                    break
        if column > 0 and start[column] > start[column - 1]:
            cells = slice(start[column - 1], start[column])
            over_row = growth(row_low[cells], row_high[cells], low, high, threshold)
            over_gap = growth(gap_low[cells], gap_high[cells], low, high, threshold)
            for k in range(n_reached):
                here = reached[k]
                gaps[:] = np.inf
                gaps[here] = gaps[here + 1] = best[column - 1, here]
                sweep(over_row, over_gap, gaps)
                for row in range(first[column], last[column] + 1):
                    cost = max(min(gaps[row], gaps[row + 1]), sizes[column, row])
                    if not free[column, row] or cost >= min(threshold, best[column, row]):
                        continue
                    if allowed(
                        q, t, off_wheel, max_t_step, max_t_change, max_q_step, blocked,
                        column - 1, here, row,
                    ):  # fmt: skip
                        best[column, row] = cost
                        before[column, row] = here
        n_reached = 0
        for row in range(first[column], last[column] + 1):
            if best[column, row] < np.inf:
                reached[n_reached] = row
                n_reached += 1
        if n_reached == 0:
            return np.inf, -1
    row = int(np.argmin(best[n_columns - 1]))
    value = best[n_columns - 1, row]
    if value == np.inf:
        return value, -1
    worst_column = n_columns - 1
    for column in range(n_columns - 1, -1, -1):
        rows[column] = row
        if sizes[column, row] > sizes[worst_column, rows[worst_column]]:
            worst_column = column
        row = before[column, row]
    return value, worst_column


@njit(
    f"boolean({_Q},{_B},{_I1},{_I1},float64,{_F1},{_F1},{_I1},{_Q},{_Q},{_Q},{_Q})",
    cache=True,
)
def tighten_strips(  # type: ignore[no-untyped-def]
    q, free, first, last, threshold, low, high, start, row_low, row_high, gap_low, gap_high
):
    """Enlarge a core by what every motion through a strip passes, one joint at a time.

    The least that the greatest value of a joint can be over all motions through the strip is where
    the upper face must be at least; likewise for the lower face.

    Args:
        q: Nodes in [rad], shape (n_columns, 6, n_rows).
        free: Which may be used, shape (n_columns, n_rows).
        first: First row in play of each column, shape (n_columns,).
        last: Last row in play of each column, shape (n_columns,).
        threshold: Boxes of this size or more in [rad] are of no interest.
        low: Lower faces of the core; changed, shape (6,).
        high: Upper faces of the core; changed, shape (6,).
        start: The strips, as in `Strips`, as are the next four.
        row_low: Least joint positions on the rows.
        row_high: Greatest joint positions on the rows.
        gap_low: Least joint positions in the gaps between them.
        gap_high: Greatest joint positions in the gaps between them.

    Returns:
        Whether the core became larger; a strip that no motion passes makes it infinite.
    """
    n_columns, n_joints, n_rows = q.shape
    changed = False
    here, there = np.empty(n_rows), np.empty(n_rows)
    gaps = np.empty(n_rows + 1)
    for step in range(n_columns - 1):
        if start[step + 1] == start[step]:
            continue
        cells = slice(start[step], start[step + 1])
        over_row = growth(row_low[cells], row_high[cells], low, high, threshold)
        over_gap = growth(gap_low[cells], gap_high[cells], low, high, threshold)
        here[:] = np.inf
        there[:] = np.inf
        sizes_with(q, step, first[step], last[step], low, high, here)
        sizes_with(q, step + 1, first[step + 1], last[step + 1], low, high, there)
        for joint in range(n_joints):
            for sign in (1.0, -1.0):
                gaps[:] = np.inf
                for row in range(first[step], last[step] + 1):
                    if free[step, row] and here[row] < threshold:
                        value = sign * q[step, joint, row]
                        gaps[row] = min(gaps[row], value)
                        gaps[row + 1] = min(gaps[row + 1], value)
                if sign > 0.0:
                    rows_at = np.where(over_row < threshold, row_low[cells, joint], np.inf)
                    gaps_at = np.where(over_gap < threshold, gap_low[cells, joint], np.inf)
                else:
                    rows_at = np.where(over_row < threshold, -row_high[cells, joint], np.inf)
                    gaps_at = np.where(over_gap < threshold, -gap_high[cells, joint], np.inf)
                sweep(rows_at, gaps_at, gaps)
                least = np.inf
                for row in range(first[step + 1], last[step + 1] + 1):
                    if free[step + 1, row] and there[row] < threshold:
                        value = max(min(gaps[row], gaps[row + 1]), sign * q[step + 1, joint, row])
                        least = min(least, value)
                if sign > 0.0 and least > high[joint] + 1e-12:
                    high[joint] = least
                    changed = True
                if sign < 0.0 and -least < low[joint] - 1e-12:
                    low[joint] = -least
                    changed = True
    return changed
