"""Motions in boxes of joint space, and the best of all found so far."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from opl.least.box_nodes import TrackSearch
from opl.least.box_track import BoxTracks
from opl.least.passages import Passages
from opl.least.postures import Columns
from opl.least.rows import Bulge
from opl.least.search_space import SearchSpace
from opl.planning.plan import Plan
from opl.planning.settings import OptimalSettings
from opl.search.box import JointBox
from opl.walls.placement import Placement

# of a box that holds all, but no motion that is found: how much larger boxes are where one is
# sought instead, so that what cannot be proven is not left far from the bound
LARGER = tuple(0.0005 * 2.0**k for k in range(9))
MOST_LOOKS = 3  # at each of these, with places cut finer by what the look before told


class Motions:
    """Finds motions in boxes, and keeps the best.

    Args:
        space: What is looked at.
        search: By what tracks are sought.
        settings: How much larger than its box a motion may be.
        known: A motion that is known.
        largest: More than the joint range sum of any motion in [rad], that of the known one.

    Attributes:
        best: The best motion so far.
    """

    def __init__(
        self,
        space: SearchSpace,
        search: TrackSearch,
        settings: OptimalSettings,
        known: Plan | None,
        largest: float,
    ) -> None:
        self._search, self.best = search, known
        self._space, self._settings, self._largest = space, settings, largest
        self._tracks = BoxTracks(search)

    @property
    def value(self) -> float:
        """The joint range sum of the best, or more than that of any motion, in [rad]."""
        return self._largest if self.best is None else self.best.path.joint_range_sum

    @property
    def collided(self) -> int:
        """How many motions collided, those that sink aside."""
        return self._search.collided

    @property
    def stopped(self) -> Counter[tuple[float, str]]:
        """What stopped the motions checked last, as of `TrackSearch`."""
        return self._search.stopped

    def keep(self, found: Plan | None) -> bool:
        """Keep a motion that is better than the best; return whether it is."""
        better = found is not None and found.path.joint_range_sum < self.value
        self.best = found if better else self.best
        return better

    def learn_in(self, columns: Columns, passages: Passages, box: JointBox | None) -> bool:
        """Look for a motion in a box; return whether something was learnt of the box instead."""
        if box is None or self._tracks.tried(columns, passages, box):
            return False
        learnt, doubts = False, self._search.sampler.doubts.count

        def learn(bulges: Sequence[Bulge]) -> bool:
            nonlocal learnt
            learnt = self._space.rectangles.refine(bulges, box)
            return learnt

        room = self._settings.room(box.size)
        found = self._tracks.plan(columns, passages, box, room, learn)
        self.keep(found)
        learnt = learnt or self._search.sampler.doubts.count > doubts
        return learnt or (found is None and learn(passages.narrow))

    def look_about(
        self, box: JointBox, placements: Sequence[Placement], goes_on: Callable[[], bool]
    ) -> bool:
        """Look for a motion in larger and larger boxes about one; return whether a better one is.

        Up to the size of the best, and of what placements hold in the box. Places are cut finer as
        long as `goes_on` says so.
        """
        for share in LARGER if placements else ():
            larger = box.widened(share * box.size)
            if larger.size >= self.value:
                break
            best, looks = self.best, 0
            while looks == 0 or (looks < MOST_LOOKS and goes_on()):
                looks += 1
                columns, passages, inner = self._space.look(larger, placements, self._settings)
                learnt = self.learn_in(columns, passages, inner)
                if self.best is not best:
                    return True
                if not learnt:
                    break
        return False
