"""Which wall a subproblem is split at, where along it, and into what."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.search.bounding import distances
from opl.search.box import JointBox
from opl.search.cells import END, FIRST, WALL, Cells
from opl.search.joint_limits import torn
from opl.search.subproblems import Subproblem

SMALLEST = 1e-6  # along a wall: a cell that is not cut further
LEAST_SHARE = 8  # of the cells of a span: one of so many on each side at the least


def where_to_split(
    node: Subproblem, cells: Cells, limits: Sequence[JointBox], settled: float
) -> tuple[int, float] | None:
    """Return the wall to be split, and where along it; None if that gains nothing.

    Args:
        node: The subproblem, bounded.
        cells: Its cells.
        limits: As of `BoxProof`.
        settled: What a box may miss a wall by, and what the bend of its spans may lose, where it
            is not split further, in [rad].
    """
    found, walls, table = node.found, node.spans[:, WALL], cells.table
    assert found is not None
    if np.count_nonzero(walls == 0) > 1:
        return 0, float(found.place[0])
    missed = np.full(node.n_walls, np.inf)
    np.minimum.at(missed, walls, distances(table, node.spans, found.low, found.high))
    first, end = node.spans[:, FIRST], node.spans[:, END]
    tiny = walls[(end == first + 1) & (table[first, 25] - table[first, 24] < SMALLEST)]
    score = np.maximum(missed, found.lost)
    box = JointBox(found.low, found.high)
    np.maximum.at(score, walls, torn(table, node.spans, box, limits, settled))
    score[tiny] = 0.0
    wall = int(np.argmax(score))
    if score[wall] > settled:
        return wall, float(found.place[wall])
    return None


def parts(node: Subproblem, cells: Cells, wall: int, place: float) -> list[np.ndarray]:
    """Return the spans of the subproblems that one is split into at a place along a wall."""
    before, end = np.searchsorted(node.spans[:, WALL], [wall, wall + 1])
    own = node.spans[before:end]
    if len(own) > 1:
        # the nearest, and all others
        assert node.found is not None
        away = distances(cells.table, own, node.found.low, node.found.high)
        k = int(np.argmin(away))
        halves = [own[k : k + 1], np.delete(own, k, axis=0)]
    else:
        if own[0, END] == own[0, FIRST] + 1:
            own = cells.finer(own[0])
        halves = [own]
        if len(own) == 0:
            return []
    if len(own) == 1:
        at = cells.table[own[0, FIRST] : own[0, END], 24]
        n, least = len(at), max(len(at) // LEAST_SHARE, 1)
        middle = own[0, FIRST] + min(max(int(np.searchsorted(at, place)), least), n - least)
        halves = [own.copy(), own.copy()]
        halves[0][0, END] = halves[1][0, FIRST] = middle
    return [np.concatenate([node.spans[:before], half, node.spans[end:]]) for half in halves]
