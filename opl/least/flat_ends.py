"""Where the flat of the wheel ends: a part may be deeper there than on either side.

So it is always measured there. A motion that sinks just where it passes such an end tells that this
matters to its pass, and if it does so again, how much depth is to be spared there.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem

MORE = 1.25  # times what was too deep: what is spared for it


class FlatEnds:
    """What is known of passes where the flat ends.

    Args:
        problem: What is to be planned.

    Attributes:
        sank: Which passes sank there, shape (n_passes,).
        count: How often any did.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self._end = problem.cell.wheel.flat_end
        self._spared = np.zeros(problem.points.n_passes)  # [m]
        self.sank = np.zeros(problem.points.n_passes, dtype=bool)
        self.count = 0

    def are_at(self, t: Array) -> np.ndarray:
        """Return which contact positions are those where the flat ends, of the same shape."""
        return np.asarray(np.abs(t) == self._end)

    def note(self, pass_index: int, sunk: float) -> None:
        """Note that a pass sank there, by so much in [m]; it spares more if it did before."""
        if self.sank[pass_index]:
            self._spared[pass_index] += MORE * sunk
        self.sank[pass_index] = True
        self.count += 1

    def spared(self, pass_index: np.ndarray) -> Array:
        """Return what places of some passes spare there of the depth allowed in [m], shape (n,)."""
        return np.asarray(self._spared[pass_index])

    def contact_positions(self, count: int) -> Array:
        """Return both ends for each of some places, shape (count, 2); (count, 0) if none sank."""
        ends = [-self._end, self._end] if self.sank.any() else []
        return np.tile(np.array(ends), (count, 1))
