"""The cell as a planner uses it: bodies that collide, part against wheel, free moves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from opl.cell.collision import CollisionScene
from opl.cell.part_tree import PartTree, part_tree
from opl.cell.workcell import WorkCell
from opl.motion.collision_check import MoveCheck
from opl.motion.free_leads import FreeLeads
from opl.motion.free_move_search import FreeMoveSearch

# what makes a unit of work, which is counted so that it is the same on any machine
QUERIES = 60  # configurations that coal looks at for collisions
LOOKS = 10_000  # at spheres and triangles of the part, for its distance to the wheel


@dataclass(frozen=True)
class PlanningScene:
    """A cell with its geometry, owned by whoever plans in it.

    Attributes:
        cell: The cell.
        collision: Its collision geometry, with the reserve that the second opinion needs.
        part: The triangles of the part.
    """

    cell: WorkCell
    collision: CollisionScene
    part: PartTree

    @property
    def work(self) -> float:
        """What was asked so far, in units of work."""
        return self.collision.queries / QUERIES + float(self.part.looks[0]) / LOOKS

    @cached_property
    def free_moves(self) -> FreeMoveSearch:
        """Free moves of this scene, and what has been learnt of them."""
        return FreeMoveSearch(self.cell, self.collision, self.part)

    @cached_property
    def free_leads(self) -> FreeLeads:
        """Leads of this scene that are as long as they are free."""
        return FreeLeads(self.cell, self.collision, self.part, self.free_moves)

    @cached_property
    def moves(self) -> MoveCheck:
        """The check of motions in this scene, and what was found of the last one."""
        return MoveCheck(self.cell, self.collision, self.part)


def planning_scene(cell: WorkCell) -> PlanningScene:
    """Return the scene of a cell."""
    return PlanningScene(cell, CollisionScene(cell).for_second_opinion(), part_tree(cell.part))
