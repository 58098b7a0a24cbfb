"""Places at rows of contact positions: what was solved and measured of them, known once.

Boxes that follow on each other are much alike, and so are the samples near to them: of ten rows
that are asked for nine were asked for before.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.planning.nodes import inverse_solutions
from opl.planning.problem import GrindingProblem

MOST_KNOWN = 2**23  # numbers; beyond that all are forgotten

Key = tuple[Hashable, ...]


class KnownRows:
    """The rows that were asked for so far.

    Args:
        problem: What is to be planned.

    Attributes:
        solved: How many contact positions were, of all places.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self._problem = problem
        self._known: dict[Key, Array] = {}
        self._numbers = 0
        self.solved = 0

    def angles(self, places: Array, t: Array, families: np.ndarray) -> Array:
        """Return principal angles in [rad], NaN where there is no posture, shape (n, m, 6).

        Args:
            places: Fractional cutter points, shape (n,).
            t: Contact positions of each in belt units, shape (n, m).
            families: The posture of each, shape (n,).
        """

        def solve(new: list[int]) -> Array:
            self.solved += t[new].size
            frames = self._problem.points.frames_at(places[new])[:, None]
            q = inverse_solutions(self._problem.cell, frames, t[new])
            return q[np.arange(len(new)), :, families[new]]

        return self._rows(places, t, families.tolist(), solve)

    def cuts(self, places: Array, t: Array, doubted: np.ndarray) -> np.ndarray:
        """Return where the part would sink too deep into the wheel, shape (n, m).

        As `GrindingProblem.cuts_at` does, with what is doubted of each place, shape (n, m).
        """

        def measure(new: list[int]) -> np.ndarray:
            points = self._problem.points.at_places(places[new])
            return self._problem.cuts_at(places[new], points, t[new], doubted[new])

        return self._rows(places, t, [row.tobytes() for row in doubted], measure)

    def _rows(
        self,
        places: Array,
        t: Array,
        kinds: Sequence[Hashable],
        find: Callable[[list[int]], np.ndarray],
    ) -> np.ndarray:
        """Return what is known of rows, by place, contact positions and kind, after new ones."""
        rows = (row.tobytes() for row in t)
        keys: list[Key] = list(zip(places.tolist(), rows, kinds, strict=True))
        known = self._known
        if not keys:
            return find([])
        if new := [k for k, key in enumerate(keys) if key not in known]:
            found = find(new)
            self._numbers += found.size
            known.update(zip((keys[k] for k in new), found, strict=True))
        together = np.array([known[key] for key in keys])
        if self._numbers > MOST_KNOWN:
            known.clear()
            self._numbers = 0
        return together
