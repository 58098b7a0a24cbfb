"""Which walls a subproblem might be split at, and into what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.search.bounding import distances
from opl.search.box import JointBox
from opl.search.cells import END, FIRST, KEY, SOURCE, WALL, Cells
from opl.search.hulls import nearest_point
from opl.search.joint_limits import cut_at
from opl.search.subproblems import Relaxation, Subproblem

SMALLEST = 1e-6  # along a wall: a cell that is not cut further
MOST_TRIED = 4  # walls at which it might be
OTHER_HALF = 0.5  # of the distance of the half that is farther counts
LEAST_SHARE = 8  # of cells or spans: one of so many on each side at the least


def where_to_split(
    node: Subproblem, cells: Cells, limits: Sequence[JointBox], settled: float
) -> list[int]:
    """Return the walls that might be split, the most promising first; none if that gains nothing.

    Args:
        node: The subproblem, bounded; what its box is beyond the limits by is cut off that.
        cells: Its cells.
        limits: As of `BoxProof`.
        settled: What a box may miss a wall by, and what the bend of its spans may lose, where it
            is not split further, in [rad].
    """
    assert node.found is not None
    walls, table = node.spans[:, WALL], cells.table
    if np.count_nonzero(walls == 0) > 1:
        return [0]
    # what is beyond the limits is no part of the box: walls that it meets there alone, it misses
    box = JointBox(node.found.low, node.found.high)
    inner = cut_at(box, limits, (node.low, node.high))
    if max(np.abs(inner.lower - box.lower).max(), np.abs(inner.upper - box.upper).max()) > settled:
        node.found = replace(node.found, low=inner.lower, high=inner.upper)
    found = node.found
    of_spans = distances(table, cells.shifts, node.spans, found.low, found.high)
    away = np.full(node.n_walls, np.inf)
    np.minimum.at(away, walls, of_spans)
    first, end = node.spans[:, FIRST], node.spans[:, END]
    tiny = walls[(end == first + 1) & (table[first, 25] - table[first, 24] < SMALLEST)]
    score = np.maximum(away, found.lost)
    score[tiny] = 0.0
    if (score <= settled).all():
        return _met_with_several_keys(node, cells, of_spans, settled)
    # a wall that holds a face up counts twice
    score = np.where(score > settled, score * (1.0 + np.minimum(found.pressed, 1.0)), 0.0)
    best = np.argsort(-score, kind="stable")[:MOST_TRIED]
    return [int(wall) for wall in best[score[best] > 0.0]]


def _met_with_several_keys(
    node: Subproblem, cells: Cells, away: Array, settled: float
) -> list[int]:
    """Return a wall of a pass all of whose walls a box meets, but not with one key.

    None if there is none; ``away`` is how far each span is from the box, in [rad].
    """
    keys, key = np.unique(node.spans[:, KEY], return_inverse=True)
    of_keys = np.full((len(keys), node.n_walls), np.inf)
    np.minimum.at(of_keys, (key, node.spans[:, WALL]), away)
    for index in np.unique(cells.pass_index[: node.n_walls]).tolist():
        own = np.flatnonzero(cells.pass_index[: node.n_walls] == index)
        missed = of_keys[:, own]
        best = int(np.argmin(missed.max(axis=1)))
        worst = int(np.argmax(missed[best]))
        if missed[best, worst] > settled and np.isfinite(missed[:, worst]).sum() > 1:
            return [int(own[worst])]
    return []


def parts(node: Subproblem, cells: Cells, wall: int) -> list[np.ndarray]:
    """Return the spans of the subproblems that one is split into at a wall."""
    before, end = np.searchsorted(node.spans[:, WALL], [wall, wall + 1])
    halves = _halves(node, cells, wall)
    return [np.concatenate([node.spans[:before], half, node.spans[end:]]) for half in halves]


def best_by_distance(node: Subproblem, cells: Cells, walls: Sequence[int]) -> int:
    """Return at which of some walls both halves are farthest from the box found.

    The half that is nearer counts first, and a wall that holds a face up twice: strong branching
    without its linear programs, as a box that one half leaves as it is bounds no better there.
    """
    assert node.found is not None
    gains = []
    for wall in walls:
        away = [_nearest(cells, half, node.found)[0] for half in _halves(node, cells, wall)]
        gain = min(away, default=np.inf) + OTHER_HALF * max(away, default=np.inf)
        gains.append((1.0 + min(node.found.pressed[wall], 1.0)) * gain)
    return walls[int(np.argmax(gains))]


def _halves(node: Subproblem, cells: Cells, wall: int) -> list[np.ndarray]:
    """Return the spans that those of a wall are split into; none if nothing is left of it."""
    before, end = np.searchsorted(node.spans[:, WALL], [wall, wall + 1])
    own = node.spans[before:end]
    assert node.found is not None
    _, place, source = _nearest(cells, own, node.found)
    starts, start = own[:, SOURCE], source
    if len(own) == 1 and own[0, END] == own[0, FIRST] + 1:
        own = cells.finer(own[0])
        starts, start = cells.table[own[:, FIRST], 24], place
    if len(own) == 0:
        return []
    if len(own) == 1:
        middle = own[0, FIRST] + _between(cells.table[own[0, FIRST] : own[0, END], 24], place)
        halves = [own.copy(), own.copy()]
        halves[0][0, END] = halves[1][0, FIRST] = middle
        return halves
    kinds = cells.kinds_of(own)
    if wall == 0 or (kinds != kinds[0]).any():
        # the nearest, or all of its image, and all others
        away = distances(cells.table, cells.shifts, own, node.found.low, node.found.high)
        nearest = int(np.argmin(away))
        alike = np.arange(len(own)) == nearest if wall == 0 else kinds == kinds[nearest]
        return [own[alike], own[~alike]]
    middle = _between(starts, start)
    return [own[:middle], own[middle:]]


def _nearest(cells: Cells, spans: np.ndarray, found: Relaxation) -> tuple[float, float, float]:
    """Return what `nearest_point` does for spans of a wall and the box found."""
    at = cells.table, cells.shifts, spans, found.low, found.high
    away, place, source = nearest_point(*at)
    return away, place, source


def _between(starts: np.ndarray, place: float) -> int:
    """Return how many of some that follow each other are split from the others at a place."""
    n, least = len(starts), max(len(starts) // LEAST_SHARE, 1)
    return min(max(int(np.searchsorted(starts, place)), least), n - least)
