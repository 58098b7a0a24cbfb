"""Which wall a subproblem is split at, and into what."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.search.bounding import distances
from opl.search.box import JointBox
from opl.search.cells import END, FIRST, SOURCE, WALL, Cells
from opl.search.joint_limits import torn
from opl.search.subproblems import Subproblem

SMALLEST = 1e-6  # along a wall: a cell that is not cut further
LEAST_SHARE = 8  # of cells or spans: one of so many on each side at the least


def where_to_split(
    node: Subproblem, cells: Cells, limits: Sequence[JointBox], settled: float
) -> int | None:
    """Return the wall to be split; None if that gains nothing.

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
        return 0
    missed = np.full(node.n_walls, np.inf)
    np.minimum.at(missed, walls, distances(table, cells.shifts, node.spans, found.low, found.high))
    first, end = node.spans[:, FIRST], node.spans[:, END]
    tiny = walls[(end == first + 1) & (table[first, 25] - table[first, 24] < SMALLEST)]
    score = np.maximum(missed, found.lost)
    box = JointBox(found.low, found.high)
    np.maximum.at(score, walls, torn(table, cells.shifts, node.spans, box, limits, settled))
    score[tiny] = 0.0
    wall = int(np.argmax(score))
    return wall if score[wall] > settled else None


def parts(node: Subproblem, cells: Cells, wall: int) -> list[np.ndarray]:
    """Return the spans of the subproblems that one is split into at a wall."""
    before, end = np.searchsorted(node.spans[:, WALL], [wall, wall + 1])
    own = node.spans[before:end]
    assert node.found is not None
    place, source = node.found.place[wall].tolist()
    starts, start = own[:, SOURCE], source
    if len(own) == 1 and own[0, END] == own[0, FIRST] + 1:
        own = cells.finer(own[0])
        starts, start = cells.table[own[:, FIRST], 24], place
    kinds = cells.kinds_of(own)
    if len(own) == 0:
        halves = []
    elif len(own) == 1:
        middle = own[0, FIRST] + _between(cells.table[own[0, FIRST] : own[0, END], 24], place)
        halves = [own.copy(), own.copy()]
        halves[0][0, END] = halves[1][0, FIRST] = middle
    elif wall == 0 or (kinds != kinds[0]).any():
        # the nearest, or all of its image, and all others
        away = distances(cells.table, cells.shifts, own, node.found.low, node.found.high)
        nearest = int(np.argmin(away))
        alike = np.arange(len(own)) == nearest if wall == 0 else kinds == kinds[nearest]
        halves = [own[alike], own[~alike]]
    else:
        middle = _between(starts, start)
        halves = [own[:middle], own[middle:]]
    return [np.concatenate([node.spans[:before], half, node.spans[end:]]) for half in halves]


def _between(starts: np.ndarray, place: float) -> int:
    """Return how many of some that follow each other are split from the others at a place."""
    n, least = len(starts), max(len(starts) // LEAST_SHARE, 1)
    return min(max(int(np.searchsorted(starts, place)), least), n - least)
