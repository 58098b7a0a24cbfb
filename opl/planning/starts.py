"""The recursive search from many start nodes: tracks in the order in which to check them."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from enum import Enum

import numpy as np

from opl.geometry.frames import Array
from opl.planning.branch import Branch, Track
from opl.search.recursive import Descent, add_dead_ends, descend


class Start(str, Enum):
    """Where the search starts in the first column."""

    BEST = "best"  # every start node is tried, the one with the least joint range sum is kept
    NEAREST = "nearest"  # Node_1 of the paper: nearest to the home posture


def tracks_from_best_start(branches: list[Branch]) -> Iterator[Track]:
    """Yield tracks by increasing joint range sum over all start nodes of all branches.

    A start node is given up as soon as its sum reaches the best known. The caller may block what
    it finds on a track before it asks for the next: only then a start node can yield again.
    """
    searches = [_Search(branch) for branch in branches]
    # (joint range sum, branch, start row, rows); where a start was given up, its sum then and None
    queue: list[tuple[float, int, int, np.ndarray | None]] = []
    bound = np.inf
    for index, search in enumerate(searches):
        for row in np.flatnonzero(search.branch.free[0]).tolist():
            descent = search.descend(row, bound)
            queue.append((descent.joint_range_sum, index, row, descent.rows))
            if descent.rows is not None:
                bound = min(bound, descent.joint_range_sum)
    queue = [entry for entry in queue if np.isfinite(entry[0])]
    heapq.heapify(queue)
    while queue:
        _, index, row, rows = heapq.heappop(queue)
        if rows is not None and branches[index].allows(rows):
            yield Track(index, rows)
            if branches[index].allows(rows):
                continue  # nothing was blocked: the same search would find the same track
        descent = searches[index].descend(row, np.inf)
        if descent.rows is not None:
            heapq.heappush(queue, (descent.joint_range_sum, index, row, descent.rows))


def tracks_from_nearest_start(branches: list[Branch], home: Array) -> Iterator[Track]:
    """Yield tracks from the start node nearest to the home posture, then the next nearest.

    Args:
        branches: All branches.
        home: The initial posture of the robot in [rad], shape (6,).
    """
    starts = [
        (float(np.linalg.norm(branch.nodes.q[0, row] - home)), index, row)
        for index, branch in enumerate(branches)
        for row in np.flatnonzero(branch.free[0]).tolist()
    ]
    searches = [_Search(branch) for branch in branches]
    for _, index, row in sorted(starts):
        while True:
            descent = searches[index].descend(row, np.inf)
            if descent.rows is None:
                break
            yield Track(index, descent.rows)
            if branches[index].allows(descent.rows):
                break


class _Search:
    """The recursive search on one branch; remembers its dead ends."""

    def __init__(self, branch: Branch) -> None:
        self.branch = branch
        self._dead = np.zeros_like(branch.free)
        self._blocked = np.empty(0, dtype=np.int64)
        # of the ladder as it was; a search that finds them itself also finds how far it can come
        self._dead_ends = np.zeros_like(branch.free)
        add_dead_ends(branch.ladder, self._blocked, self._dead_ends)

    def descend(self, start: int, bound: float) -> Descent:
        branch = self.branch
        if not branch.free[0, start]:
            return Descent(None, np.inf, 0)
        if len(self._blocked) != len(branch.blocked):
            self._blocked = np.array(sorted(branch.blocked), dtype=np.int64)
        # to stop at a bound is right only where the search would not have turned back
        dead = self._dead_ends if np.isfinite(bound) else self._dead
        descent = descend(branch.ladder, start, self._blocked, dead, bound)
        branch.reached = max(branch.reached, descent.reached)
        return descent
