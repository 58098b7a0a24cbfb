"""Where a track leads through a ladder, and the shortest runs of columns that cannot be passed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.files.kernels import kernel
from opl.search.ladder import EDGE_RULE, Ladder, allowed
from opl.search.recursive import add_dead_ends


def impasses(ladder: Ladder, blocked: np.ndarray) -> list[tuple[int, int]]:
    """Return the runs of columns through which no track leads, in order, first and last of each.

    Through every part of such a run a track leads; first and last are the same where a column has
    no free node at all.

    `blocked` are the sorted keys of the edges that are not free, int64.
    """
    free = ladder.free

    def edges(column: int) -> np.ndarray:
        rule = _edges(ladder.edge_rule, blocked, column)
        return np.asarray(rule & free[column][:, None] & free[column + 1])

    found = []
    start = 0
    while start < len(free):
        reach, last = free[start], start
        while reach.any() and last < len(free) - 1:
            reach = edges(last)[reach].any(axis=0)
            last += 1
        if reach.any():
            break  # it leads to the end
        reach, first = free[last], last
        while reach.any():
            first -= 1
            reach = edges(first)[:, reach].any(axis=1)
        found.append((first, last))
        start = first + 1
    return found


def passable(ladder: Ladder, blocked: np.ndarray, first: int, last: int) -> bool:
    """Return whether a track leads from one column to another, by the others between them.

    `blocked` as for `impasses`.
    """
    columns, edges = slice(first, last + 1), slice(first, last)
    part = replace(
        ladder,
        q=ladder.q[columns],
        free=np.ascontiguousarray(ladder.free[columns]),
        contact_position=ladder.t_of_nodes[columns],
        off_wheel=ladder.off_wheel[edges],
        max_contact_change=ladder.contact_changes[edges],
        sides=None if ladder.sides is None else ladder.sides[edges],
    )
    least, end = ladder.edge_key(first, 0, 0), ladder.edge_key(last, 0, 0)
    own = blocked[(least <= blocked) & (blocked < end)] - least
    dead = np.zeros_like(part.free)
    add_dead_ends(part, own, dead)
    return bool((part.free & ~dead)[0].any())


@kernel(f"boolean[:,::1]({EDGE_RULE},int64[::1],int64)")
def _edges(edge_rule, blocked, column):  # type: ignore[no-untyped-def]
    """Return which rows of a column lead to which of the next, were they all free."""
    n_rows = edge_rule[0].shape[2]
    edges = np.empty((n_rows, n_rows), dtype=np.bool_)
    for here in range(n_rows):
        for row in range(n_rows):
            edges[here, row] = allowed(edge_rule, blocked, column, here, row)
    return edges
