"""Images that all passes might use: each has a posture of every cutter point in the box."""

import numpy as np

from opl.search.box import JointBox
from opl.walls.families import Families, few_columns
from opl.walls.images import Images
from opl.walls.sides import ANY_SIDE
from tests.support.boxes import small_families
from tests.support.planned import small_problem


def joint_limits():
    """Return the limits of the joints."""
    robot = small_problem().cell.robot
    return JointBox(robot.lower.copy(), robot.upper.copy())


def ground(placement, box):
    """Return at which of few columns a placement has a free posture in a box."""
    problem, (_, seams) = small_problem(), small_families()
    columns = few_columns(problem.points.pass_index)
    q, start = problem.solutions(columns)[:, :, placement.family], seams.start[placement.family]
    placed = placement.of(start + np.remainder(q - start, 2.0 * np.pi))
    inside = ((placed >= box.lower) & (placed <= box.upper)).all(axis=-1)
    return (inside & ~problem.cuts[columns]).any(axis=1)


def test_every_family_that_grinds_all_within_the_limits_is_placed_once():
    problem, (families, _) = small_problem(), small_families()
    limits = joint_limits()
    found = families.anywhere(limits)
    passes = problem.points.pass_index[few_columns(problem.points.pass_index)]
    for placements in found:
        assert len(placements) == problem.points.n_passes
        for index, placement in enumerate(placements):
            assert ground(placement, limits)[passes == index].all()
    of_all = [
        placements[0].family for placements in found if len({p.family for p in placements}) == 1
    ]
    assert of_all and len(set(of_all)) == len(of_all)


def test_nothing_is_placed_where_a_cutter_point_is_ground_in_no_posture():
    problem, (_, seams) = small_problem(), small_families()
    points, cuts = problem.points, problem.cuts.copy()
    cuts[-1] = True
    q = problem.solutions(few_columns(points.pass_index))
    images, sides = Images(problem.cell.robot, seams, 10.0), [[ANY_SIDE]] * points.n_passes
    given = points.pass_index, problem.field.contact_positions, sides
    assert Families(images, q, cuts, *given).anywhere(joint_limits()) == []
