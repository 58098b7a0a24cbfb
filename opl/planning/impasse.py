"""Where no track leads through: the shortest runs of columns that cannot be passed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.planning.branch import Branch
from opl.search.ladder import Ladder


@dataclass(frozen=True)
class Impasse:
    """A run of columns through which no track leads, though one leads through every part of it.

    Attributes:
        first: Its first column.
        last: Its last column; the same where a column has no free node at all.
    """

    first: int
    last: int


def shortest_impasse(branches: list[Branch]) -> Impasse | None:
    """Return the shortest impasse of the branch that a search came farthest on, None if none.

    Args:
        branches: What was searched, with all that was found to be blocked.
    """
    if not branches:
        return None
    farthest = max(branches, key=lambda branch: branch.reached)
    runs = impasses(farthest.ladder, farthest.blocked)
    return min(runs, key=lambda run: run.last - run.first, default=None)


def impasses(ladder: Ladder, blocked: set[int]) -> list[Impasse]:
    """Return every impasse of a ladder, in order.

    Args:
        ladder: The nodes.
        blocked: Keys of the steps that are not free.
    """
    free, found = ladder.free, []
    start = 0
    while start < len(free):
        reach, last = free[start], start
        while reach.any() and last < len(free) - 1:
            reach = _steps(ladder, blocked, last)[reach].any(axis=0)
            last += 1
        if reach.any():
            break  # it leads to the end
        reach, first = free[last], last
        while reach.any():
            first -= 1
            reach = _steps(ladder, blocked, first)[:, reach].any(axis=1)
        found.append(Impasse(first, last))
        start = first + 1
    return found


def _steps(ladder: Ladder, blocked: set[int], column: int) -> np.ndarray:
    """Return which nodes of a column lead to which of the next, shape (n_rows, n_rows)."""
    n_rows = ladder.free.shape[1]
    allowed = ladder.free[column][:, None] & ladder.free[column + 1]
    if not ladder.off_wheel[column]:
        t = ladder.contact_position
        change = np.abs(t[:, None] - t)
        allowed &= change <= ladder.contact_changes[column] + 1e-9
        moves = np.maximum(np.ceil(change / ladder.max_contact_step - 1e-9), 1.0)
        turned = np.abs(ladder.q[column][:, None] - ladder.q[column + 1]).max(axis=2)
        allowed &= turned <= ladder.max_joint_step * moves
    keys = column * n_rows * n_rows + np.arange(n_rows * n_rows).reshape(n_rows, n_rows)
    own = [key for key in blocked if key // (n_rows * n_rows) == column]
    return np.asarray(allowed & ~np.isin(keys, own))
