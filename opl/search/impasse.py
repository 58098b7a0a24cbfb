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
    free, rule = np.ascontiguousarray(ladder.free), ladder.edge_rule
    found = []
    start = 0
    while start < len(free):
        reach, last = free[start], start
        while reach.any() and last < len(free) - 1:
            reach = _reached(rule, blocked, free, last, reach, False)
            last += 1
        if reach.any():
            break  # it leads to the end
        reach, first = free[last], last
        while reach.any():
            first -= 1
            reach = _reached(rule, blocked, free, first, reach, True)
        found.append((first, last))
        start = first + 1
    return found


def barred(ladder: Ladder, blocked: np.ndarray, back: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return over which edges no track gets, from the start on or back from the end.

    Beyond one it is as if tracks came from every free node. `blocked` as for `impasses`.

    Returns:
        Which edges, shape (n_columns - 1,), and which nodes are reached, shape (n_columns, n_rows).
    """
    free = np.ascontiguousarray(ladder.free)
    shut, reached = np.zeros(len(free) - 1, dtype=bool), np.zeros_like(free)
    _walk(ladder.edge_rule, blocked, free, back, shut, reached)
    return shut, reached


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


@kernel(
    f"boolean[::1]({EDGE_RULE},int64[::1],boolean[:,::1],int64,boolean[::1],boolean)",
    makes_arrays=True,
)
def _reached(edge_rule, blocked, free, column, reach, back):  # type: ignore[no-untyped-def]
    """Return which free rows an edge leads to that begins at a column, from some rows of it.

    Or back: at which free rows of the column one begins that leads to some rows of the next.
    """
    ends, rows = free[column if back else column + 1], np.flatnonzero(reach)
    found = np.zeros(len(ends), dtype=np.bool_)
    for end in np.flatnonzero(ends):
        for row in rows:
            here, there = (end, row) if back else (row, end)
            if allowed(edge_rule, blocked, column, here, there):
                found[end] = True
                break
    return found


@kernel(
    f"void({EDGE_RULE},int64[::1],boolean[:,::1],boolean,boolean[::1],boolean[:,::1])",
    makes_arrays=True,
)
def _walk(edge_rule, blocked, free, back, shut, reached):  # type: ignore[no-untyped-def]
    """Fill in what `barred` returns."""
    n = len(free)
    reached[n - 1 if back else 0] = free[n - 1 if back else 0]
    for step in range(n - 1):
        edge = n - 2 - step if back else step
        here, there = (edge + 1, edge) if back else (edge, edge + 1)
        if edge_rule[2][edge]:  # off the wheel
            reached[there] = free[there]
            continue
        reached[there] = _reached(edge_rule, blocked, free, edge, reached[here], back)
        if not reached[there].any():
            shut[edge] = True
            reached[there] = free[there]
