"""The recursive search of the paper: a track through the node matrix with a small joint range sum.

This is Algorithm 1 of Zhang et al. (2019): try the nodes of the next column by increasing joint
range sum of the track with each of them, go on from the first that can be stepped to, and when none
is left give up the current node and go back a column. It knows arrays only, no robot.

Two changes that alter no result: the stack is explicit, because paths are longer than a recursion
may be deep, and a node from which the rest could not be completed is remembered as dead, because
that does not depend on how it was reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.files.kernels import kernel
from opl.search.ladder import EDGE_RULE, Ladder, allowed, contains, continuous


@dataclass(frozen=True)
class Descent:
    """How far a search from one start node came.

    Attributes:
        rows: The row chosen in each column, shape (n_columns,), or None if the search failed or was
            given up.
        joint_range_sum: Sum over joints of (max - min) over the nodes of the track in [rad]. For a
            search given up, the sum at which it was.
        reached: Largest number of columns that some partial track passed.
    """

    rows: np.ndarray | None
    joint_range_sum: float
    reached: int


def descend(
    ladder: Ladder, start: int, blocked: np.ndarray, dead: np.ndarray, bound: float = np.inf
) -> Descent:
    """Search from one start node.

    Args:
        ladder: The nodes.
        start: Row of the start node in column 0; must be free.
        blocked: Keys of edges that are not free, sorted, shape (n_blocked,) of int64.
        dead: Nodes known to be dead ends, shape (n_columns, n_rows); new ones are added.
        bound: Give up as soon as the joint range sum reaches this value, in [rad]. Only if no dead
            end is missing in ``dead`` is it certain that the track would not have been shorter.
    """
    rows = np.full(len(ladder.q), -1, dtype=np.int64)
    outcome, total, reached = _descend(
        ladder.edge_rule, ladder.free, blocked, dead, start, bound, rows
    )
    return Descent(rows if outcome == _COMPLETE else None, total, reached)


def add_dead_ends(ladder: Ladder, blocked: np.ndarray, dead: np.ndarray) -> None:
    """Mark every node from which the last column cannot be reached.

    A search finds dead ends as it meets them; one that is to stop at a bound must know them before,
    or it stops on a track that it would have come back from.

    New ones are added to `dead`, shape (n_columns, n_rows).
    """
    _add_dead_ends(ladder.edge_rule, ladder.free, blocked, dead)


_COMPLETE, _FAILED, _GIVEN_UP = 1, 0, 2

_FIELD = f"{EDGE_RULE},boolean[:,::1],int64[::1],boolean[:,::1]"


@kernel(f"void({_FIELD})", early=True)
def _add_dead_ends(edge_rule, free, blocked, dead):  # type: ignore[no-untyped-def]
    n_columns, n_rows = free.shape
    for column in range(n_columns - 2, -1, -1):
        for here in range(n_rows):
            if not free[column, here] or dead[column, here]:
                continue
            leads_on = False
            for k in range(n_rows):
                row = (here + k) % n_rows  # the row it is on leads on most often
                if not free[column + 1, row] or dead[column + 1, row]:
                    continue
                if allowed(edge_rule, blocked, column, here, row):
                    leads_on = True
                    break
            dead[column, here] = not leads_on


@kernel(
    f"Tuple((int64,float64,int64))({_FIELD},int64,float64,int64[::1])",
    early=True,
    makes_arrays=True,
)
def _descend(edge_rule, free, blocked, dead, start, bound, rows):  # type: ignore[no-untyped-def]
    q = edge_rule[0]
    n_columns, n_joints, n_rows = q.shape
    sums = np.empty(n_rows)
    low = np.empty((n_columns, n_joints))
    high = np.empty((n_columns, n_joints))
    # candidates of a column are taken by increasing (sum, row); these hold where it stands
    tried_sum = np.full(n_columns + 1, -np.inf)
    tried_row = np.full(n_columns + 1, -1)
    rows[0] = start
    low[0] = q[0, :, start]
    high[0] = q[0, :, start]
    column = 0
    reached = 1
    total = 0.0
    while column < n_columns - 1:
        here = rows[column]
        following = column + 1
        best_sum = np.inf
        best_row = -1
        sums[:] = 0.0
        for joint in range(n_joints):
            low_joint = low[column, joint]
            high_joint = high[column, joint]
            for row in range(n_rows):
                value = q[following, joint, row]
                sums[row] += max(value, high_joint) - min(value, low_joint)
        for row in range(n_rows):
            ranges = sums[row]
            if ranges >= best_sum or ranges < tried_sum[following]:
                continue
            if not free[following, row] or dead[following, row]:
                continue
            if ranges == tried_sum[following] and row <= tried_row[following]:
                continue
            if not continuous(edge_rule, column, here, row):
                continue
            best_sum = ranges
            best_row = row
        if best_row < 0:
            dead[column, here] = True
            if column == 0:
                return _FAILED, np.inf, reached
            column -= 1
            continue
        if best_sum >= bound:
            return _GIVEN_UP, best_sum, reached
        tried_sum[following] = best_sum
        tried_row[following] = best_row
        if contains(blocked, (column * n_rows + here) * n_rows + best_row):
            continue
        rows[following] = best_row
        total = best_sum
        for joint in range(n_joints):
            value = q[following, joint, best_row]
            low[following, joint] = min(low[column, joint], value)
            high[following, joint] = max(high[column, joint], value)
        column = following
        tried_sum[column + 1] = -np.inf
        tried_row[column + 1] = -1
        reached = max(reached, column + 1)
    return _COMPLETE, total, reached
