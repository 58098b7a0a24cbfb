"""What is learnt of contact positions that motions in a box pass between places.

One that they must pass, and nowhere can, becomes a wall of the proof. One that they can pass
somewhere is passed there: those places are looked at.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.box_columns import Columns, ColumnSampler
from opl.planning.rows import Bulges
from opl.search.box import JointBox
from opl.search.walls import Sweep

PLACE_DIGITS = 5  # of places, in cutter points


class Crossings:
    """Places and rows that tracks are sought along.

    Args:
        sampler: Samples rows.
        points: The cutter points.

    Attributes:
        places: Fractional cutter points, shape (n,).
        rows: Places of each row, its contact position, and whether motions must pass it there.
    """

    def __init__(self, sampler: ColumnSampler, points: CutterPoints) -> None:
        self._sampler = sampler
        self._pass_index = points.pass_index
        self._known: set[tuple[float, float, float]] = set()
        self.places = np.arange(len(points), dtype=float)
        self.rows: list[tuple[Array, float, bool]] = []

    def learn(
        self, columns: Columns, box: JointBox, room: float, allowed: float, bulges: Bulges
    ) -> tuple[bool, list[Sweep]]:
        """Take in where a track leaves a box; return whether that is new, and walls to be added.

        Args:
            columns: The places.
            box: The box.
            room: By how much a motion may leave it, in [rad] of its size.
            allowed: What the box may miss a row by that is no wall, in [rad].
            bulges: Where it leaves the box.
        """
        more, walls, known = [bulges.places], [], len(self.rows)
        last = len(self._pass_index) - 1
        for place, t, upwards in bulges.sweeps:
            before, after = columns.around(box, place, t, upwards)
            must = before is not None and after is not None
            first = float(np.floor(place)) if before is None else before
            end = float(min(np.floor(place) + 1.0, last)) if after is None else after
            key = first, end, round(t, 1)
            if key in self._known or self._pass_index[int(first)] != self._pass_index[int(end)]:
                continue
            self._known.add(key)
            row = self._sampler.row(first, end, key[2], must, columns, box)
            if must and row.missing(box) > allowed:
                walls.append(Sweep(first, end, key[2], upwards))
                continue
            self.rows.append((row.places, key[2], must))
            for begin, stop in row.inside(box.widened(room / 2.0)):
                if not ((self.places >= begin) & (self.places <= stop)).any():
                    more.append(np.array([(begin + stop) / 2.0]))
        places = np.union1d(self.places, np.round(np.concatenate(more), PLACE_DIGITS))
        new = len(places) > len(self.places) or len(self.rows) > known or bool(walls)
        self.places = places
        return new, walls
