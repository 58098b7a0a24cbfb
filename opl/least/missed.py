"""Places that boxes miss: what one box missed, the next is held against first.

Boxes that follow on each other are much alike. Of many places one box misses a few dozen, and only
the worst become walls; to hold the next box against the others takes no look at all places.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.least.box_columns import ColumnSampler
from opl.least.postures import Columns
from opl.search.box import JointBox
from opl.walls.families import few_columns
from opl.walls.placement import Placement


class Missed:
    """The places that boxes were held against.

    Args:
        sampler: Samples places.
        pass_index: Pass of each cutter point, shape (N,).

    Attributes:
        known: Places that are walls of the proof.
    """

    def __init__(self, sampler: ColumnSampler, pass_index: np.ndarray) -> None:
        self._sampler, self._pass_index = sampler, pass_index
        self._last: list[float] = []  # others, by the box looked at last
        self.known: set[float] = set()

    def of(
        self, columns: Columns, box: JointBox, allowed: float
    ) -> tuple[list[float], list[float]]:
        """Return the places that a box misses, known ones and others, as `Columns.missed`."""
        known, self._last = columns.missed(box, self.known, allowed)
        return known, self._last

    def again(self, box: JointBox, placements: Sequence[Placement], allowed: float) -> list[float]:
        """Return which of the others that a box missed last this one misses, the worst first."""
        if self._last:
            columns = self._columns(box, placements, np.unique(self._last))
            self.of(columns, box, allowed)
        return self._last

    def shut(self, box: JointBox, placements: Sequence[Placement], allowed: float) -> list[float]:
        """Return which known places a box misses where collisions are left out: all may collide."""
        if not self._sampler.collisions:
            return []
        places = np.union1d(list(self.known), few_columns(self._pass_index))
        return self._columns(box, placements, places).missed(box, self.known, allowed)[0]

    def _columns(self, box: JointBox, placements: Sequence[Placement], places: Array) -> Columns:
        passes = np.unique(self._pass_index[places.astype(int)])
        return self._sampler.columns(box, [placements[index] for index in passes.tolist()], places)
