"""Postures of places along the passes near to a box of joint space, and what the box misses."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.search.box import JointBox
from opl.search.in_box import missing_chords
from opl.walls.placement import Placement

BESIDE = 0.02  # cutter points: what is so near to a place that is missed as well is beside it


@dataclass(frozen=True)
class Columns:
    """The postures of places near to a box.

    Attributes:
        places: Fractional cutter points, shape (n,).
        points: The places as points of their own.
        placements: The image that each pass uses.
        t: Contact positions, shape (n, m).
        q: Placed postures in [rad], NaN where there are none, shape (n, m, 6).
        free: Which are within reach and limits and do not cut into the wheel, as far as the field
            tells, shape (n, m).
    """

    places: Array
    points: CutterPoints
    placements: tuple[Placement, ...]
    t: Array
    q: Array
    free: np.ndarray

    def missed(
        self, box: JointBox, known: Collection[float], allowed: float
    ) -> tuple[list[float], list[float]]:
        """Return the places that a box misses by more than allowed in [rad], the worst first.

        Those in ``known``, which may be shut all over the box; and others, but for those beside
        them, which tell no more.
        """
        missing = missing_chords(self.q, self.free, box)
        worst = np.argsort(-missing, kind="stable")
        places = [float(self.places[k]) for k in worst if missing[k] > allowed]
        shut = [place for place in places if place in known]
        new = [place for place in places if all(abs(place - wall) > BESIDE for wall in shut)]
        return shut, new
