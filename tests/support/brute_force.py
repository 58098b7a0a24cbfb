"""The paper's search as printed, and every track of a small field."""

from itertools import product

import numpy as np

from opl.search.ladder import Ladder


def printed_recursion(q, free, leads_on, start):
    """Return the rows that Algorithm 1 finds from a start node, or None.

    Written as the paper prints it: recursive, forgetting every dead end.

    Args:
        q: Joint positions, shape (n_columns, n_rows, 6).
        free: Which nodes are free, shape (n_columns, n_rows).
        leads_on: leads_on(column, row, next_row) tells whether a step can be made.
        start: Row of the start node.
    """
    track = [start]

    def ranges(row):
        on_track = np.array([q[k, r] for k, r in enumerate([*track, row])])
        return float((on_track.max(axis=0) - on_track.min(axis=0)).sum())

    def go_on():
        column = len(track) - 1
        if column == len(q) - 1:
            return True
        candidates = [row for row in range(q.shape[1]) if free[column + 1, row]]
        for row in sorted(candidates, key=ranges):  # stable: the lower row first among equals
            if leads_on(column, track[-1], row):
                track.append(row)
                if go_on():
                    return True
                track.pop()
        return False

    return track if go_on() else None


def range_sum(q, rows):
    on_track = np.array([q[k, row] for k, row in enumerate(rows)])
    return float((on_track.max(axis=0) - on_track.min(axis=0)).sum())


def may_step(ladder, blocked, column, row, following):
    """The rule for steps, written from its description."""
    if (column, row, following) in blocked:
        return False
    if ladder.off_wheel[column]:
        return True
    change = abs(ladder.contact_position[following] - ladder.contact_position[row])
    if change > ladder.contact_changes[column] + 1e-9:
        return False
    moves = max(int(np.ceil(change / ladder.max_contact_step - 1e-9)), 1)
    turned = np.abs(ladder.q[column + 1, following] - ladder.q[column, row]).max()
    return turned <= ladder.max_joint_step * moves


def all_tracks(ladder, blocked):
    n_columns, n_rows = ladder.free.shape
    for rows in product(range(n_rows), repeat=n_columns):
        if all(ladder.free[c, r] for c, r in enumerate(rows)) and all(
            may_step(ladder, blocked, c, rows[c], rows[c + 1]) for c in range(n_columns - 1)
        ):
            yield rows


def keys_of(ladder, blocked):
    return np.array(sorted(ladder.edge_key(*step) for step in blocked), dtype=np.int64)


def random_field(seed):
    """Return a small field with blocked nodes and blocked steps, some of it coarse (ties)."""
    random = np.random.default_rng(seed)
    n_columns, n_rows = int(random.integers(2, 6)), int(random.integers(1, 6))
    q = random.uniform(-1.0, 1.0, (n_columns, n_rows, 6))
    if seed % 3 == 0:
        q = np.round(q * 2.0) / 2.0
    free = random.random((n_columns, n_rows)) > 0.15
    q[~free & (random.random(free.shape) > 0.5)] = np.nan
    ladder = Ladder(
        q=q,
        free=free,
        contact_position=np.linspace(-3.0, 3.0, n_rows),
        off_wheel=random.random(n_columns - 1) < 0.2,
        max_contact_step=1.0,
        max_joint_step=random.uniform(0.3, 1.5),
        max_contact_change=random.choice([2.0, 4.0, np.inf]),
    )
    blocked = {
        (c, a, b)
        for c in range(n_columns - 1)
        for a in range(n_rows)
        for b in range(n_rows)
        if random.random() < 0.15
    }
    return ladder, blocked
