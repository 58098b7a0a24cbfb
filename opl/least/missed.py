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
        self._last: list[float] = []  # others, by the box looked at last, if it missed nothing else
        self.known: set[float] = set()

    def of(
        self, columns: Columns, box: JointBox, allowed: float
    ) -> tuple[list[float], list[float]]:
        """Return the places that a box misses, known ones and others, as `Columns.missed`."""
        known, others = columns.missed(box, self.known, allowed)
        self._last = [] if known else others
        return known, others

    def first(
        self, box: JointBox, placements: Sequence[Placement], allowed: float
    ) -> tuple[list[float], list[float]]:
        """Return which known places a box misses, and which others that one missed last, as `of`.

        These are looked at before all others are.
        """
        if not (places := {*self.known, *self._last}):
            return [], []
        return self.of(self._columns(box, placements, np.unique(list(places))), box, allowed)

    def shut(self, box: JointBox, placements: Sequence[Placement], allowed: float) -> list[float]:
        """Return which known places a box misses where collisions are left out: all may collide."""
        if not (self._sampler.collisions and self.known):
            return []
        columns = self._columns(box, placements, np.unique(list(self.known)))
        return columns.missed(box, self.known, allowed)[0]

    def _columns(self, box: JointBox, placements: Sequence[Placement], places: Array) -> Columns:
        passes = np.unique(self._pass_index[places.astype(int)])
        return self._sampler.columns(box, [placements[index] for index in passes.tolist()], places)
