"""Where the part sinks too deep though it does not at any contact position of the field around.

Of a place and a contact position between those of the field it is not measured how deep the part
is where all that is known around them is free. A motion that sinks at a place itself tells that
this is not so there.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem

BESIDE = (-1, 0, 1)  # intervals that are doubted with one


class Doubts:
    """What is measured at every place, by pass and by the interval between contact positions.

    Args:
        problem: What is to be planned.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self._positions = problem.field.contact_positions
        shape = problem.points.n_passes, len(self._positions) + 1
        self._doubted = np.zeros(shape, dtype=bool)

    @property
    def count(self) -> int:
        """How many intervals are doubted, of all passes."""
        return int(np.count_nonzero(self._doubted))

    def note(self, pass_index: np.ndarray, t: Array) -> bool:
        """Doubt the intervals around contact positions; return whether any of it is new.

        Both have shape (n,).
        """
        before, last = self.count, self._doubted.shape[1] - 1
        for beside in BESIDE:
            at = np.clip(self._after(t) + beside, 0, last)
            self._doubted[pass_index, at] = True
        return self.count > before

    def at(self, pass_index: np.ndarray, t: Array) -> np.ndarray:
        """Return which contact positions of some columns are to be measured, shape (n, m)."""
        return np.asarray(self._doubted[pass_index[:, None], self._after(t)])

    def _after(self, t: Array) -> np.ndarray:
        return np.searchsorted(self._positions, t)
