"""Which moves of a motion collide, as the planner sees it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from opl.cell.collision import CollisionScene
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.part_tree import part_tree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.motion.collision_check import MoveCheck, colliding_moves
from opl.motion.joint_lines import RESOLUTION, densify
from opl.motion.motion import MoveKind
from tests.support.bare_cells import bare_cell, block, free_move, with_obstacle
from tests.support.fcl_scene import FclScene
from tests.support.planned import small_motion, small_problem

configurations = arrays(float, st.tuples(st.integers(2, 6), st.just(6)), elements=st.floats(-3, 3))


@settings(max_examples=50, deadline=None)
@given(configurations, st.floats(0.01, 1.0))
def test_densified_configurations_lie_on_the_joint_lines_no_further_apart_than_asked(q, resolution):
    dense, move = densify(q, resolution)
    assert np.abs(np.diff(dense, axis=0)).max() <= resolution * (1 + 1e-9)
    assert move[0] == 0
    assert set(move.tolist()) == set(range(len(q)))
    assert (np.diff(move) >= 0).all()
    for k in range(1, len(q)):
        on_move = dense[move == k]
        np.testing.assert_allclose(on_move[-1], q[k], atol=1e-12)
        step = q[k] - q[k - 1]
        along = (on_move - q[k - 1]) @ step / max(step @ step, 1e-300)
        np.testing.assert_allclose(q[k - 1] + along[:, None] * step, on_move, atol=1e-9)
        assert (np.diff(along) > 0.0).all()


def test_a_configuration_held_is_one_configuration():
    dense, move = densify(np.ones((3, 6)), 0.1)
    assert len(dense) == 3
    assert move.tolist() == [0, 1, 2]


def faults_of(cell, timed):
    return colliding_moves(cell, CollisionScene(cell), part_tree(cell.part), timed.motion)


def test_a_planned_motion_has_no_faults():
    scene = small_problem().scene
    assert colliding_moves(scene.cell, scene.collision, scene.part, small_motion()) == []


def test_an_obstacle_between_two_free_configurations_is_found():
    cell = bare_cell(block((0.02, 0.02, 0.02)))
    q = np.zeros((3, 6))
    q[1, 0], q[2, 0] = 0.8, 1.6
    on_the_way = np.zeros(6)
    on_the_way[0] = 0.4
    p = (forward_kinematics(cell.robot, on_the_way) @ cell.T_flange_workpiece)[:3, 3]
    cell = with_obstacle(cell, p)
    assert not CollisionScene(cell).collides(q).any()
    (fault,) = faults_of(cell, free_move(q))
    assert fault.move == 1
    assert set(fault.pair) & {"post"}
    assert not fault.at_end


def test_a_configuration_that_collides_is_told_from_a_way_that_does():
    cell = bare_cell(block((0.02, 0.02, 0.02)))
    q = np.zeros((3, 6))
    q[1, 0], q[2, 0] = 0.8, 1.6
    p = (forward_kinematics(cell.robot, q[1]) @ cell.T_flange_workpiece)[:3, 3]
    first, second = faults_of(with_obstacle(cell, p), free_move(q))
    assert (first.move, first.at_end) == (1, True)
    assert (second.move, second.at_end) == (2, False)  # the way out of it


def test_a_fault_names_a_pair_that_collides_on_its_own_move():
    # asked about many configurations before: what those hit must not be told here
    cell = bare_cell(block((0.02, 0.02, 0.02)))
    q = np.zeros((4, 6))
    q[:, 0] = [0.0, 0.8, 1.6, 2.4]
    ahead = [
        (forward_kinematics(cell.robot, q[k]) @ cell.T_flange_workpiece)[:3, 3] for k in (1, 3)
    ]
    cell = with_obstacle(cell, ahead[0], name="first")
    cell = with_obstacle(cell, ahead[1], name="second")
    faults = faults_of(cell, free_move(q))
    assert [(fault.move, fault.pair[1]) for fault in faults] == [
        (1, "first"),
        (2, "first"),
        (3, "second"),
    ]


def shifted_along_normal(motion, index, depth):
    """Return a motion with one configuration moved towards the wheel by a depth."""
    cell = small_problem().cell
    T_base_flange = forward_kinematics(cell.robot, motion.q[index])
    # only moved: the contact normal is that of the contact frame at this t
    into = cell.wheel.T_base_contact(motion.contact_position[index])[:3, 2]
    T_base_flange[:3, 3] += depth * into
    found = inverse_kinematics(cell.robot.arm, T_base_flange, motion.q[index])
    found = found + 2 * np.pi * np.round((motion.q[index] - found) / (2 * np.pi))
    q = motion.q.copy()
    q[index] = found[np.nanargmin(np.abs(found - q[index]).max(axis=1))]
    return replace(motion, q=q)


@pytest.mark.parametrize(("depth", "found"), [(0.0003, False), (0.0007, True), (0.002, True)])
def test_the_part_may_sink_into_the_belt_by_the_penetration(depth, found):
    problem, motion = small_problem(), small_motion()
    # on the flat: an edge of the wheel can sink in between two samples of the part
    grind = np.array([kind is MoveKind.GRIND for kind in motion.kind])
    index = int(np.argmin(np.where(grind, np.abs(motion.contact_position), np.inf)))
    assert abs(motion.contact_position[index]) < 20.0
    moved = shifted_along_normal(motion, index, depth)
    faults = colliding_moves(problem.cell, problem.scene.collision, problem.scene.part, moved)
    assert bool(faults) == found
    if found:
        assert faults[0].pair == ("part", "wheel")
        assert index in [fault.move for fault in faults if fault.at_end]


def test_the_deepest_place_of_a_long_line_counts_wherever_it_is():
    problem, motion = small_problem(), small_motion()
    cell, part = problem.cell, problem.scene.part
    on_wheel = np.flatnonzero(motion.on_wheel)
    tried = 0
    for start, end in zip(on_wheel[:-16:24], on_wheel[16::24], strict=True):
        line = motion.take(np.array([start, end]))
        q = line.q[0] + np.linspace(0.0, 1.0, 3001)[:, None] * (line.q[1] - line.q[0])
        Ts = cell.Ts_contact0_workpiece(forward_kinematics(cell.robot, q))
        depth = -signed_wheel_distance(part, cell.wheel, Ts, 0.0)
        if not 0.0003 < depth.max() < 0.05 or depth.argmax() in (0, 3000):
            continue
        tried += 1
        for more, found in ((-5e-5, True), (5e-5, False)):
            # the planner keeps 0.1 mm back
            other = replace(cell, max_belt_penetration=depth.max() + 1e-4 + more)
            faults = colliding_moves(other, problem.scene.collision, part, line)
            assert [fault.pair for fault in faults if not fault.at_end] == [
                ("part", "wheel")
            ] * found
    assert tried > 3


def test_what_is_known_of_the_last_motion_changes_no_fault():
    problem, motion = small_problem(), small_motion()
    scene, asked = problem.scene, motion.grinding
    check = MoveCheck(scene.cell, scene.collision, scene.part)
    random = np.random.default_rng(0)
    faulty = 0
    for _ in range(6):
        q = motion.q.copy()
        for index in random.choice(len(q), 4):
            # out of the wheel or into it, a little or a lot
            q[index] += random.normal(0.0, random.choice([1e-4, 1e-3, 0.1]), 6)
        moved = replace(motion, q=q)
        faults = colliding_moves(scene.cell, scene.collision, scene.part, moved)
        assert check.colliding(moved) == faults
        assert check.colliding(moved, asked) == [one for one in faults if asked[one.move]]
        faulty += len(faults)
        motion = moved if random.random() < 0.5 else motion
    assert faulty > 20


def test_a_move_that_is_known_is_not_looked_at_again():
    problem, motion = small_problem(), small_motion()
    scene = problem.scene
    check = MoveCheck(scene.cell, scene.collision, scene.part)
    check.colliding(motion)
    before = scene.collision.queries
    check.colliding(motion)
    assert scene.collision.queries == before


def test_a_free_move_keeps_the_clearance_from_the_wheel():
    problem, motion = small_problem(), small_motion()
    on_wheel = next(k for k, s in enumerate(motion.kind) if s is MoveKind.GRIND)
    hold = free_move(motion.q[[on_wheel, on_wheel]]).motion
    faults = colliding_moves(problem.cell, problem.scene.collision, problem.scene.part, hold)
    assert [fault.pair for fault in faults] == [("part", "wheel")] * 2


def test_faults_are_those_an_independent_scene_finds():
    # a sweep through a narrow gap, asked at the same configurations
    cell = bare_cell(block((0.05, 0.05, 0.05)))
    p = (forward_kinematics(cell.robot, np.zeros(6)) @ cell.T_flange_workpiece)[:3, 3]
    cell = with_obstacle(cell, p + np.array([0.0, 0.3, 0.06]), (0.05, 0.05, 0.05))
    q = np.zeros((12, 6))
    q[:, 0] = np.linspace(-0.2, 0.7, 12)
    q[:, 4] = np.linspace(0.0, 0.1, 12)
    dense, move = densify(q, RESOLUTION)
    scene = FclScene(cell)
    hits = np.array([min(scene.clearances(one).values(), default=1.0) <= 0.0 for one in dense])
    wanted = sorted(set(move[hits].tolist()))
    assert 0 < len(wanted) < 11
    assert [fault.move for fault in faults_of(cell, free_move(q))] == wanted
