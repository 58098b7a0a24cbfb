"""Places whose configuration could not be named are moved on the wheel, by little, and grind on."""

import numpy as np

from opl.cell.robot import forward_kinematics
from opl.least.borders import MARGIN, clear_of_borders
from opl.least.equals import quickest_of_equals
from opl.motion.motion import MoveKind
from tests.support.planned import small_plan, small_problem


def beside(joint, border):
    """Return what names all configurations but those with a joint next to an angle."""
    return lambda q, margin: np.abs(q[:, joint] - border) >= margin


def test_places_at_a_border_are_moved_on_the_wheel_and_ground_all_the_same():
    problem, plan = small_problem(), small_plan()
    k = len(plan.path.q) // 3
    named = beside(5, plan.path.q[k, 5])
    assert not named(plan.path.q, MARGIN).all()
    cleared = clear_of_borders(problem, plan, named)
    path = cleared.path
    assert named(path.q, MARGIN).all()
    moved = np.flatnonzero((path.q != plan.path.q).any(axis=1))
    assert set(moved) == set(np.flatnonzero(~named(plan.path.q, MARGIN)))
    np.testing.assert_array_equal(path.cutter_point, plan.path.cutter_point)
    # the cutter frame is where the contact position says, on the same branch
    T_cutter = problem.points.frames_at(path.cutter_point[moved])
    T_part = forward_kinematics(problem.cell.robot, path.q[moved]) @ problem.cell.T_flange_workpiece
    wanted = problem.cell.wheel.T_base_contact(path.contact_position[moved])
    np.testing.assert_allclose((T_part @ T_cutter), wanted, atol=1e-9)
    assert np.abs(path.q - plan.path.q).max() < np.deg2rad(2.0)
    ground = [kind for kind in cleared.motion.kind if kind is MoveKind.GRIND]
    assert len(ground) == len(problem.points)


def test_plan_without_borders_stays_as_it_is():
    plan = small_plan()
    assert clear_of_borders(small_problem(), plan, beside(5, 100.0)) is plan


def test_of_equal_motions_one_that_can_be_named_comes_first():
    problem = small_problem()
    quickest = quickest_of_equals(problem, small_plan(), True)
    turned = quickest.path.q[:, 5].mean()
    other = quickest_of_equals(
        problem, small_plan(), True, lambda q, margin: np.abs(q[:, 5] - turned) > np.pi / 2.0
    )
    assert (np.abs(other.path.q[:, 5] - turned) > np.pi / 2.0).all()
    assert other.path.joint_range_sum == quickest.path.joint_range_sum or np.isclose(
        other.path.joint_range_sum, quickest.path.joint_range_sum
    )
