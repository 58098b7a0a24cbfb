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
from opl.planning.plan import AT_REST, Plan
from opl.planning.settings import OptimalSettings
from opl.search.box import JointBox
from opl.walls.placement import Placement

# of a box that holds all, but no motion that is found: how much larger boxes are where one is
# sought instead, so that what cannot be proven is not left far from the bound
LARGER = tuple(0.0005 * 2.0**k for k in range(14))
SETTLED = 0.02  # by which fraction a motion may be larger than a box in which none is found
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
        # what was sought anywhere: the motion, whether its wrist is flipped, the image of each pass
        self._large: tuple[Plan | None, bool, Sequence[Placement]] | None = None

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

    def keep(self, found: Plan | None) -> None:
        """Keep a motion that is better than the best."""
        if found is not None and found.path.joint_range_sum < self.value:
            self.best = found

    def learn_in(self, columns: Columns, passages: Passages, box: JointBox | None) -> bool:
        """Look for a motion in a box; return whether something was learnt of the box instead."""
        if box is None or self._tracks.tried(columns, passages, box):
            return False
        learnt, before = False, self._search.sampler.learnt

        def learn(bulges: Sequence[Bulge]) -> bool:
            nonlocal learnt
            learnt = self._space.rectangles.refine(bulges, box)
            return learnt

        room = self._settings.room(box.size)
        self.keep(self._tracks.plan(columns, passages, box, room, learn))
        return learnt or self._search.sampler.learnt > before

    def look_about(
        self, box: JointBox, placements: Sequence[Placement], goes_on: Callable[[], bool]
    ) -> bool:
        """Look for a motion in larger and larger boxes about one; return whether a better one is.

        Up to the size of the best, and of what placements hold in the box. Places are cut finer as
        long as `goes_on` says so.
        """
        larger = self._larger(box, placements)
        return any(self._look_in(one, placements, goes_on) for one in larger)

    def look_far_about(
        self, box: JointBox, placements: Sequence[Placement], goes_on: Callable[[], bool]
    ) -> bool:
        """Do the same in few of those boxes, as long as `goes_on` says so.

        For the smallest that holds a motion by bisection, as if all that are larger held one.
        """
        boxes, found = self._larger(box, placements), False
        while boxes and goes_on():
            middle = len(boxes) // 2
            if self._look_in(boxes[middle], placements, goes_on):
                boxes, found = boxes[:middle], True
            else:
                boxes = boxes[middle + 1 :]
        return found

    def look_anywhere(self, goes_on: Callable[[], bool]) -> bool:
        """Look for a motion in a box of all joint positions; return whether one is found.

        In every posture in turn, as long as `goes_on` says so. The smoothest track over places is
        sought there, which knows what collides and not how small the box might be.
        """
        sampler, space = self._search.sampler, self._space
        for flip, limits in enumerate(space.walls.images.limits):
            sampler.mirrored = flip > 0
            for placements in space.families.anywhere(limits):
                if not goes_on():
                    return False
                if self._look_in(limits, placements, goes_on):
                    self._large = self.best, sampler.mirrored, placements
                    return True
        return False

    @property
    def may_be_smaller(self) -> bool:
        """Whether the best is the one that was sought anywhere, and none was sought about it."""
        return self._large is not None and self._large[0] is self.best

    def make_smaller(self, goes_on: Callable[[], bool], least: float) -> None:
        """Bisect boxes about the middle of the motion that was sought anywhere for smaller ones.

        Between its size and a least one in [rad], as long as `goes_on` says so; as if no box held a
        motion that is smaller than one in which none is found.
        """
        if self._large is None:
            return
        _, self._search.sampler.mirrored, placements = self._large
        self._large = None
        while self.value - least > max(SETTLED * self.value, AT_REST) and goes_on():
            about = self._about_best((least + self.value) / 2.0, placements)
            if not self._look_in(about, placements, goes_on):
                least = about.size

    def _about_best(self, size: float, placements: Sequence[Placement]) -> JointBox:
        """Return a box of a size in [rad] about the middle of the best motion.

        Of the image that placements make of it.
        """
        assert self.best is not None
        sampler, path = self._search.sampler, self.best.path
        there, t = sampler.there(path.cutter_point), path.contact_position[:, None]
        q = sampler.at(path.cutter_point, there, placements, t).q[:, 0]
        return JointBox(q.min(axis=0), q.max(axis=0)).scaled(size)

    def _larger(self, box: JointBox, placements: Sequence[Placement]) -> list[JointBox]:
        """Return the larger boxes about one that are smaller than the best motion."""
        larger = [box.widened(share * box.size) for share in LARGER] if placements else []
        return [one for one in larger if one.size < self.value]

    def _look_in(
        self, box: JointBox, placements: Sequence[Placement], goes_on: Callable[[], bool]
    ) -> bool:
        """Look for a motion in a box, with places cut finer; return whether a better one is."""
        best, looks, learnt = self.best, 0, True
        while looks == 0 or (learnt and looks < MOST_LOOKS and goes_on()):
            looks += 1
            columns, passages, inner = self._space.look(box, placements, self._settings)
            learnt = self.learn_in(columns, passages, inner) and self.best is best
        return self.best is not best
