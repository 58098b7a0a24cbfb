"""What the search for the least looks at: walls, postures at cutter points, and places between."""

from __future__ import annotations

from dataclasses import dataclass

from opl.geometry.frames import Array
from opl.least.box_columns import ColumnSampler
from opl.least.passages import Rectangles
from opl.planning.problem import GrindingProblem
from opl.walls.barriers import all_sides
from opl.walls.columns import ColumnWalls
from opl.walls.cut_cells import whole_cells
from opl.walls.families import Families, few_columns
from opl.walls.images import Images, Seams, seams_of


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


def _few_postures(problem: GrindingProblem) -> Array:
    """Return inverse solutions at `few_columns` in [rad], shape (n, M, 8, 6)."""
    return problem.solutions(few_columns(problem.points.pass_index))
