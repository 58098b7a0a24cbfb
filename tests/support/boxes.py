"""A box of joint space about a motion of the small problem. Made once."""

from functools import cache

import numpy as np

from opl.least.box_columns import ColumnSampler
from opl.search.joint_limits import UNLIMITED
from opl.walls.families import Families, few_columns
from opl.walls.images import Images, seams_of
from opl.walls.sides import ANY_SIDE
from tests.support.planned import small_problem


@cache
def small_families():
    """Return the families of the small problem, and where their angles are cut open."""
    problem = small_problem()
    points, t = problem.points, problem.field.contact_positions
    q = problem.solutions(few_columns(points.pass_index))
    seams, none = seams_of(q), [[ANY_SIDE]] * points.n_passes
    images = Images(problem.cell.robot, seams, 10.0)
    return Families(images, q, problem.cuts, points.pass_index, t, none), seams


@cache
def near_a_box():
    """Return a small box for the small problem, and the postures of its places near to that."""
    problem, (families, seams) = small_problem(), small_families()
    points, box = problem.points, families.smallest_grown()
    placements, _ = families.hold(box, {}, set(), 0.1)
    sampler = ColumnSampler(problem, seams, UNLIMITED)
    return box, sampler, sampler.columns(box, placements, np.arange(len(points), dtype=float))
