"""The subproblems that are open: the least is worked on first, but for a dive now and then.

Where many are all but equal, no box comes of any before all are split, least first: no wall is
learnt meanwhile that may rule most of them out. So after a while one is followed depth first, down
to a box: a dive, as solvers of mixed-integer programs make it.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable

import numpy as np

from opl.search.subproblems import Subproblem

LATE = 128  # subproblems taken since the last box: it is late
DIVE_AFTER = 64  # subproblems that were taken without a box
ALIKE = 1e-9  # [rad] by which bounds differ and count as the same


class OpenSubproblems:
    """The subproblems that are open.

    Args:
        root: The first.

    Attributes:
        diving: Whether the one that was taken last is on a dive.
    """

    def __init__(self, root: Subproblem) -> None:
        self._heap = [root]
        self._next_of_dive: Subproblem | None = None
        self._without_a_box = 0  # taken since the last box or dive
        self._since_box = 0  # taken, whatever dives there were
        self.diving = False

    @property
    def least_bound(self) -> float:
        """The least bound of all, in [rad]; infinite if none is open."""
        first = (self._next_of_dive, *self._heap[:1])
        return min((node.bound for node in first if node is not None), default=np.inf)

    @property
    def dive_is_due(self) -> bool:
        """Whether to follow what the one that was taken last is split into."""
        return self.diving or self._without_a_box >= DIVE_AFTER

    @property
    def box_is_late(self) -> bool:
        """Whether many subproblems were taken since the last box."""
        return self._since_box > LATE

    def take(self) -> Subproblem:
        """Take out the next of a dive, or the one with the least bound."""
        self.diving = self._next_of_dive is not None
        self._without_a_box = 0 if self.diving else self._without_a_box + 1
        self._since_box += 1
        node, self._next_of_dive = self._next_of_dive or heapq.heappop(self._heap), None
        return node

    def before(self, node: Subproblem) -> bool:
        """Return whether some subproblem is more promising than one that is not among them."""
        return node.bound > self.least_bound + ALIKE

    def leave(self, nodes: Iterable[Subproblem]) -> None:
        """Leave subproblems open."""
        for node in nodes:
            heapq.heappush(self._heap, node)

    def dive(self, nodes: Iterable[Subproblem]) -> None:
        """Leave subproblems open, of which the one with the least bound is taken next."""
        by_bound = sorted(nodes)
        self._next_of_dive = by_bound[0] if by_bound else None
        self.leave(by_bound[1:])

    def note_box(self) -> None:
        """Note that a box came of the one that was taken last."""
        self._without_a_box = self._since_box = 0
