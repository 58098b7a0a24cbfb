"""Which joint lines of a run hit something, sought beside those that a chain of lines takes.

Next to a line that hits something others mostly do too. Found one choice of lines after the other,
each would cost a choice: in a hollow, where most lines sink too deep, up to a thousand.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from opl.motion.collision_check import MoveCheck
from opl.motion.fewest import Lines
from opl.motion.motion import Motion

Line = tuple[int, int]  # indices of the configurations at its ends


class CollidingLines:
    """Tells which lines of a run are known to hit something, of one chain after the other.

    Args:
        check: Tells which moves collide.
        motion: The configurations of the run.
        lines: Its lines that keep their contact.
    """

    def __init__(self, check: MoveCheck, motion: Motion, lines: Lines) -> None:
        self._check, self._motion, self._lines = check, motion, lines
        self._looked_at: set[Line] = set()
        self._hitting: set[Line] = set()

    def known_after(self, chain: NDArray[np.intp]) -> frozenset[Line]:
        """Return all lines that are known to hit something once those of a chain are looked at.

        Where some of its lines do, those beside them are looked at, and those beside the ones of
        them that do, until as many more are found as were known: so few choices are made, and few
        lines looked at in vain. Lines between neighbouring configurations are looked at in chains
        only: there is no other to take instead.

        Args:
            chain: Indices of the configurations that its lines join, in order, shape (k,).
        """
        found = self._look_at(pairwise(chain.tolist()))
        most = 2 * len(self._hitting)
        while found and len(self._hitting) < most:
            beside = self._lines.beside(np.array(sorted(found)))
            found = self._look_at(line for line in beside if line[1] > line[0] + 1)
        return frozenset(self._hitting)

    def _look_at(self, lines: Iterable[Line]) -> set[Line]:
        """Return which lines hit something, of those that were not looked at before."""
        new = sorted(set(lines) - self._looked_at)
        if not new:
            return set()
        self._looked_at.update(new)
        moves = np.zeros(2 * len(new), dtype=bool)
        moves[1::2] = True
        ends = self._motion.take(np.array(new).ravel())
        hitting = {new[fault.move // 2] for fault in self._check.colliding(ends, moves)}
        self._hitting |= hitting
        return hitting
