"""How much of the work allowed a proof has done: counted, so that it is the same on any machine.

A unit is what takes one to three milliseconds on two slow cores.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from opl.least.box_nodes import TrackSearch
from opl.planning.plan import WORK_OF_A_CHECK
from opl.planning.scene import QUERIES, PlanningScene
from opl.search.least_box import BoxProof
from opl.walls.columns import ColumnWalls
from opl.walls.families import Families

# what makes a unit, or how many units one makes
NUMBERS = 1.4e6  # worked on in linear programs
SUBPROBLEMS = 8
WORK_OF_A_WALL = 12.0
EARLY_SHARE = 0.3  # of the work: motions in boxes that are not proven to be the least
FIRST_WORK = 300  # units that may be spent on those at once


def work_of_proof(proof: BoxProof) -> float:
    """Return what was done in branch and bound, in units of work."""
    return proof.bounded / SUBPROBLEMS + proof.work / NUMBERS


class Work:
    """What was done, from when this was made.

    Args:
        scene: Asked about collisions and distances.
        walls: Made so far.
        families: Held against boxes.
        tracks: Sampled and checked.

    Attributes:
        proof: The proof that is worked on.
    """

    def __init__(
        self, scene: PlanningScene, walls: ColumnWalls, families: Families, tracks: TrackSearch
    ) -> None:
        self._scene, self._walls = scene, walls
        self._families, self._tracks = families, tracks
        self._before = -self._counted()
        self._early = 0.0  # work on early motions
        self._begun = 0.0  # what was done when the proof was begun
        self.proof: BoxProof | None = None

    @property
    def done(self) -> float:
        """All of it, in units."""
        proof = 0.0 if self.proof is None else work_of_proof(self.proof)
        return self._before + self._counted() + proof

    @property
    def share_of_proof(self) -> float:
        """How much of all work was done since the proof was begun again."""
        return 1.0 - self._begun / self.done

    @property
    def left_for_early(self) -> bool:
        """Whether motions may be sought in boxes that are not proven to be the least."""
        return self._early < FIRST_WORK + EARLY_SHARE * self.done

    @contextmanager
    def early(self) -> Iterator[None]:
        """Count what is done meanwhile as work on such motions."""
        before = self.done
        yield
        self._early += self.done - before

    def begin_again(self, proof: BoxProof) -> None:
        """Go on with another proof."""
        self._before += 0.0 if self.proof is None else work_of_proof(self.proof)
        self._begun = self._before + self._counted()
        self.proof = proof

    def _counted(self) -> float:
        asked = self._scene.work + self._tracks.push_away.queries / QUERIES
        made = self._walls.made * WORK_OF_A_WALL
        checked = self._tracks.places_checked * WORK_OF_A_CHECK
        sampler = self._tracks.sampler
        return asked + made + checked + self._families.work + sampler.work + sampler.leads.work
