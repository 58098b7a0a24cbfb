"""Filling in a track: against kinematics of the tests' own, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry.frames import pose
from opl.geometry.toolpath import CutterPoints
from opl.motion.path import GrindingPath
from opl.planning.filling import BrokenEdgesError, fill_in
from opl.planning.nodes import NodeMatrix
from opl.planning.turned import Kept
from tests.support.fcl_scene import FclScene
from tests.support.planned import small_plan, small_problem, v_plan, v_problem

PLANS = pytest.mark.parametrize(
    ("problem", "plan"), [(small_problem, small_plan), (v_problem, v_plan)], ids=["small", "V"]
)


def flange_poses(cell, q):
    """Return flange poses from the URDF, read and multiplied by the tests themselves."""
    scene = FclScene(cell)
    return np.array([scene.frames(configuration)["tool0"] for configuration in q])


def ground_points(cell, points, q, place):
    """Return where the ground point of each configuration is, the origin of its cutter frame."""
    origins = points.Ts_workpiece_cutter[:, :3, 3]
    p = np.stack([np.interp(place, np.arange(len(points)), axis) for axis in origins.T], axis=-1)
    Ts = flange_poses(cell, q) @ cell.T_flange_workpiece
    return np.einsum("nij,nj->ni", Ts[:, :3, :3], p) + Ts[:, :3, 3]


def contact_points(cell, t):
    """Return the contact point of each t in the base frame: on the rim's line, at most w/2 out."""
    T = cell.wheel.T_base_contact0
    half = cell.wheel.width / 2
    return T[:3, 3] + np.clip(-t / 1000.0, -half, half)[:, None] * T[:3, 0]


def rows_of(problem, plan):
    """Return the matrix and the rows that a plan's path went through."""
    path = plan.path
    at_node = path.cutter_point % 1.0 == 0.0
    for nodes in problem.field.matrices:
        if nodes.ik_branch[0] != path.ik_branches[0]:
            continue
        rows = []
        for column, q in enumerate(path.q[at_node]):
            rows += np.flatnonzero((nodes.q[column] == q).all(axis=1)).tolist()[:1]
        if len(rows) == len(problem.points):
            return nodes, np.array(rows)
    raise AssertionError("the path goes through no row of nodes")


@PLANS
def test_the_ground_point_lies_on_the_contact_point_at_every_configuration(problem, plan):
    cell, points, path = problem().cell, problem().points, plan().path
    ground = ground_points(cell, points, path.q, path.cutter_point)
    error = np.linalg.norm(ground - contact_points(cell, path.contact_position), axis=1)
    assert error.max() < 1e-9


@PLANS
def test_the_normal_of_the_part_points_into_the_wheel_as_t_says(problem, plan):
    cell, points, path = problem().cell, problem().points, plan().path
    at_node = path.cutter_point % 1.0 == 0.0
    Ts = flange_poses(cell, path.q[at_node]) @ cell.T_flange_workpiece @ points.Ts_workpiece_cutter
    flat = cell.wheel.width * 500.0
    t = path.contact_position[at_node]
    roll = t - np.clip(t, -flat, flat)
    R_contact0_contact = Rotation.from_euler("y", roll[:, None], degrees=True).as_matrix()
    wanted = cell.wheel.T_base_contact0[:3, :3] @ R_contact0_contact
    np.testing.assert_allclose(Ts[:, :3, :3], wanted, atol=1e-9)


@PLANS
def test_the_ground_point_stays_near_its_place_between_configurations(problem, plan):
    cell, points, path = problem().cell, problem().points, plan().path
    rule = problem().interpolation
    # the rule speaks of half-way; elsewhere the bow may be somewhat larger
    for share, more in ((0.5, 1.0), (0.25, 1.5), (0.75, 1.5)):
        q = path.q[:-1] + share * np.diff(path.q, axis=0)
        place = path.cutter_point[:-1] + share * np.diff(path.cutter_point)
        t = path.contact_position[:-1] + share * np.diff(path.contact_position)
        ground = ground_points(cell, points, q, place)
        error = np.linalg.norm(ground - contact_points(cell, t), axis=1)
        error = error[np.diff(path.pass_index) == 0]
        assert error.max() <= more * rule.max_contact_error + 1e-9


@PLANS
def test_t_changes_by_no_more_than_its_limit(problem, plan):
    path, rule = plan().path, problem().interpolation
    steps = np.abs(np.diff(path.contact_position))[np.diff(path.pass_index) == 0]
    assert steps.max() <= rule.max_contact_step + 1e-9


@PLANS
def test_joints_do_not_jump_within_a_pass(problem, plan):
    path, rule = plan().path, problem().interpolation
    steps = np.abs(np.diff(path.q, axis=0))[np.diff(path.pass_index) == 0]
    assert steps.max() <= rule.max_joint_step


@PLANS
def test_configurations_of_nodes_are_kept_to_the_bit(problem, plan):
    nodes, rows = rows_of(problem(), plan())
    at_node = plan().path.cutter_point % 1.0 == 0.0
    np.testing.assert_array_equal(plan().path.q[at_node], nodes.q[np.arange(len(rows)), rows])
    np.testing.assert_array_equal(plan().path.contact_position[at_node], nodes.t_along(rows))


@PLANS
def test_every_cutter_point_is_there_once_and_in_order(problem, plan):
    path, points = plan().path, problem().points
    at_node = path.cutter_point % 1.0 == 0.0
    assert path.cutter_point[at_node].tolist() == list(range(len(points)))
    assert (np.diff(path.cutter_point) > 0.0).all()
    np.testing.assert_array_equal(path.pass_index[at_node], points.pass_index)
    assert path.n_intermediate == np.count_nonzero(~at_node)


def test_there_are_no_configurations_between_two_passes():
    path = small_plan().path
    last = np.flatnonzero(np.diff(path.pass_index))[0]
    assert path.cutter_point[last] % 1.0 == path.cutter_point[last + 1] % 1.0 == 0.0
    assert path.cutter_point[last + 1] == path.cutter_point[last] + 1.0


def test_figures_are_those_of_the_configurations():
    path = v_plan().path
    ranges = path.q.max(axis=0) - path.q.min(axis=0)
    np.testing.assert_array_equal(path.joint_ranges, ranges)
    assert path.joint_range_sum == pytest.approx(ranges.sum())
    travel = contact_travel = 0.0
    for k in range(1, len(path.q)):
        if path.pass_index[k] == path.pass_index[k - 1]:
            travel += np.abs(path.q[k] - path.q[k - 1]).sum()
            contact_travel += abs(path.contact_position[k] - path.contact_position[k - 1])
    assert path.joint_travel == pytest.approx(travel)
    assert path.contact_travel == pytest.approx(contact_travel)


def test_figures_leave_out_the_way_from_pass_to_pass():
    q = np.zeros((4, 6))
    q[2:] = 1.0
    path = GrindingPath(
        np.zeros(2, dtype=int), q, np.array([0.0, 1, 9, 9]), np.arange(4.0), np.array([0, 0, 1, 1])
    )
    assert path.joint_travel == 0.0
    assert path.contact_travel == 1.0
    assert path.joint_range_sum == 6.0  # but the box holds both


# a made-up track over two cutter points


def two_points(p_first=None, p_second=None, t=(0.0, 3.0)):
    """Return points, nodes and rows of a two-point track that steps from one t to another."""
    problem = small_problem()
    frames = problem.points.Ts_workpiece_cutter[30:32].copy()
    q = problem.cell.Ts_base_flange(np.array(t), frames)
    q = inverse_kinematics(problem.cell.robot.arm, q)[:, small_plan().path.ik_branches[0]]
    for k, p in enumerate((p_first, p_second)):
        if p is not None:
            frames[k, :3, 3] = p
    points = CutterPoints(frames, np.zeros(2, dtype=int), np.array([0.0, 0.004]))
    nodes = NodeMatrix(
        small_plan().path.ik_branches[[0, 0]],
        Kept(np.repeat(q[:, None], 2, axis=1)),
        np.tile(t, (2, 1)),
        np.arange(2),
    )
    return problem.cell, points, nodes, np.array([0, 1])


def test_a_step_gets_as_many_nodes_as_t_needs():
    cell, points, nodes, rows = two_points()
    rule = replace(small_problem().interpolation, max_contact_error=1.0)
    path = fill_in(cell, points, nodes, rows, rule)
    np.testing.assert_allclose(path.contact_position, [0.0, 1.0, 2.0, 3.0], atol=1e-12)
    np.testing.assert_allclose(path.cutter_point, [0.0, 1 / 3, 2 / 3, 1.0], atol=1e-12)


def test_a_smaller_error_gets_more_nodes():
    cell, points, nodes, rows = two_points(t=(0.0, 0.9))
    rule = small_problem().interpolation
    coarse = fill_in(cell, points, nodes, rows, replace(rule, max_contact_error=1.0))
    fine = fill_in(cell, points, nodes, rows, replace(rule, max_contact_error=1e-6))
    assert coarse.n_intermediate == 0
    assert fine.n_intermediate > 0
    np.testing.assert_array_equal(fine.q[[0, -1]], coarse.q)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_contact_that_begins_to_roll_has_a_node_there(side):
    # halved alone, the move across the end of the flat kept over 5 micrometres of error, and was
    # given up as a jump of the joints
    end = small_problem().cell.wheel.flat_end
    cell, points, nodes, rows = two_points(t=(side * (end - 2.0), side * (end + 3.0)))
    rule = replace(small_problem().interpolation, max_contact_step=10.0)
    coarse = fill_in(cell, points, nodes, rows, replace(rule, max_contact_error=1.0))
    np.testing.assert_allclose(coarse.cutter_point, [0.0, 0.4, 1.0], rtol=1e-9)
    assert coarse.contact_position[1] == pytest.approx(side * end, abs=1e-9)
    fine = fill_in(cell, points, nodes, rows, replace(rule, max_contact_error=1e-6))
    assert fine.n_intermediate < 64


def test_a_node_at_the_end_of_the_flat_is_no_second_one():
    end = small_problem().cell.wheel.flat_end
    cell, points, nodes, rows = two_points(t=(end - 1.5, end + 1.5))
    rule = replace(small_problem().interpolation, max_contact_step=1.5, max_contact_error=1.0)
    path = fill_in(cell, points, nodes, rows, rule)
    np.testing.assert_allclose(path.cutter_point, [0.0, 0.5, 1.0], atol=1e-9)


def test_nothing_is_interpolated_between_passes_on_opposite_sides():
    cell, points, nodes, rows = two_points()
    frames = points.Ts_workpiece_cutter.copy()
    frames[1, :3, :3] = frames[0, :3, :3] @ np.diag([1.0, -1.0, -1.0])
    points = replace(points, Ts_workpiece_cutter=frames, pass_index=np.array([0, 1]))
    with np.errstate(all="raise"):
        path = fill_in(cell, points, nodes, rows, small_problem().interpolation)
    assert path.n_intermediate == 0


def test_a_joint_turned_by_more_than_half_a_turn_is_followed():
    # the same wrist one turn further: nodes between must be turned as well
    cell, points, nodes, rows = two_points()
    q = nodes.q.copy()
    turn = np.where(q[0, 0, 5] > 0.0, -2 * np.pi, 2 * np.pi)
    q[..., 5] += turn
    path = fill_in(cell, points, nodes, rows, small_problem().interpolation)
    turned = fill_in(
        cell, points, replace(nodes, configurations=Kept(q)), rows, small_problem().interpolation
    )
    np.testing.assert_allclose(turned.q[:, 5], path.q[:, 5] + turn, atol=1e-12)
    np.testing.assert_allclose(turned.q[:, :5], path.q[:, :5], atol=1e-12)


def broken(cell, points, nodes, rows, rule=None):
    with pytest.raises(BrokenEdgesError) as caught:
        fill_in(cell, points, nodes, rows, rule or small_problem().interpolation)
    return caught.value


def test_a_step_out_of_reach_is_refused():
    # both ends are said to be fine; between them the part would have to be metres away
    error = broken(*two_points(p_first=np.array([0, 0, 4.0]), p_second=np.array([0, 0, 4.0])))
    assert error.causes == {0: "reach"}
    assert "edge from cutter point 0: reach" in str(error)


def test_a_step_beyond_the_limits_is_refused():
    cell, points, nodes, rows = two_points()
    between = fill_in(cell, points, nodes, rows, small_problem().interpolation).q[1]
    joint = 4
    upper = cell.robot.upper.copy()
    upper[joint] = between[joint] - 1e-6
    error = broken(replace(cell, robot=replace(cell.robot, upper=upper)), points, nodes, rows)
    assert error.causes == {0: "limits of B"}


def test_a_jump_is_refused():
    cell, points, nodes, rows = two_points()
    rule = replace(small_problem().interpolation, max_joint_step=1e-6)
    assert broken(cell, points, nodes, rows, rule).causes == {0: "continuity"}


def test_steps_too_large_between_nodes_are_made_smaller():
    cell, points, nodes, rows = two_points()
    coarse = fill_in(cell, points, nodes, rows, small_problem().interpolation)
    largest = np.abs(np.diff(coarse.q, axis=0)).max()
    rule = replace(small_problem().interpolation, max_joint_step=largest / 3.0)
    finer = fill_in(cell, points, nodes, rows, rule)
    assert np.abs(np.diff(finer.q, axis=0)).max() <= largest / 3.0
    assert len(finer.q) > len(coarse.q)


def test_an_error_that_no_density_keeps_is_refused():
    cell, points, nodes, rows = two_points()
    rule = replace(small_problem().interpolation, max_contact_error=1e-16)
    assert broken(cell, points, nodes, rows, rule).causes == {0: "continuity"}


def test_all_refused_steps_are_told_at_once_by_where_they_start():
    problem = small_problem()
    nodes, rows = rows_of(problem, small_plan())
    Ts = problem.points.Ts_workpiece_cutter.copy()
    for far in (20, 30):
        Ts[far] = pose(Ts[far, :3, :3], np.array([0.0, 0.0, 4.0]))
    points = CutterPoints(Ts, problem.points.pass_index, problem.points.arc_length)
    rule = replace(problem.interpolation, max_contact_step=0.05, max_joint_step=9.0)
    causes = broken(problem.cell, points, nodes, rows, rule).causes
    assert causes == dict.fromkeys([19, 20, 29, 30], "reach")
