"""What the search for the least looks at: walls, postures at cutter points, and places between."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from opl.geometry.frames import Array
from opl.least.box_columns import ColumnSampler
from opl.least.passages import Passages, Rectangles
from opl.least.postures import Columns
from opl.planning.problem import GrindingProblem
from opl.planning.settings import OptimalSettings
from opl.search.box import JointBox
from opl.walls.barriers import all_sides
from opl.walls.columns import ColumnWalls
from opl.walls.cut_cells import whole_cells
from opl.walls.families import Families, few_columns, grown
from opl.walls.images import Images, Seams, seams_of
from opl.walls.placement import Placement


def seams_in(problem: GrindingProblem) -> Seams:
    """Return where the full turns of a problem are counted from."""
    return seams_of(_few_postures(problem))


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """The same problem in the forms that a proof and a motion need.

    Attributes:
        walls: Makes the walls of the proof.
        families: The postures at cutter points spread over the passes.
        sampler: Samples the postures of places.
        rectangles: Between which places motions are held against boxes.
    """

    walls: ColumnWalls
    families: Families
    sampler: ColumnSampler
    rectangles: Rectangles

    @classmethod
    def of(cls, problem: GrindingProblem, seams: Seams, largest: float) -> SearchSpace:
        """Return that of a problem with its seams, for boxes up to a size in [rad]."""
        cell, points, q = problem.cell, problem.points, _few_postures(problem)
        images = Images(cell.robot, seams, largest)
        sides, t = all_sides(problem), problem.field.contact_positions
        walls = ColumnWalls(cell, problem.scene.part, points, images, sides)
        families = Families(images, q, problem.cuts, points.pass_index, t, sides)
        sampler = ColumnSampler(problem, seams, images.limits)
        return cls(walls, families, sampler, Rectangles(sampler, points, whole_cells(cell.wheel)))

    def look(
        self, box: JointBox, placements: Sequence[Placement], settings: OptimalSettings
    ) -> tuple[Columns, Passages, JointBox | None]:
        """Return places near a box, the ways between them, and the box grown for both.

        Args:
            box: The box.
            placements: The image that each pass uses.
            settings: What a box may miss, and how much larger a motion may be.
        """
        allowed, room = settings.missed(box.size), settings.room(box.size)
        columns = self.sampler.columns(box, placements, self.rectangles.places)
        inner = grown(columns.q, columns.free, box)
        passages = self.rectangles.held(inner or box, placements, allowed, room)
        return columns, passages, None if inner is None else passages.grown(inner)


def _few_postures(problem: GrindingProblem) -> Array:
    """Return inverse solutions at `few_columns` in [rad], shape (n, M, 8, 6)."""
    return problem.solutions(few_columns(problem.points.pass_index))
