"""Mesh bodies, pairs that may touch and clearances of single pairs: three libraries agree."""

import gc
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from opl.cell.collision import CollisionScene
from opl.cell.enclosing import enclosing_bodies
from opl.cell.robot import forward_kinematics
from opl.cell.robot_shapes import collision_shapes
from opl.cell.workcell import PairRules
from opl.geometry.frames import pose
from opl.geometry.mesh import TriangleMesh, winding_number
from opl.geometry.shapes import Body
from opl.verification.engine import start
from opl.verification.meshes import concave_shape, is_inside
from opl.verification.replay import replay
from opl.verification.world import World
from tests.support.bare_cells import (
    NO_POINTS,
    bare_cell,
    block,
    c_shape,
    convex_hull,
    cut_finer,
    free_move,
    random_configurations,
    with_obstacle,
)
from tests.support.fcl_scene import FclScene
from tests.support.planned import replay_tiny, small_motion, tiny_motion, tiny_problem, v_job

SAME = 1e-4  # [m] coal and fcl
STATED = 1e-3  # [m] Bullet rounds the edges of the links' boxes by up to a millimetre


def at(x, y, z):
    return pose(np.eye(3), np.array([x, y, z], dtype=float))


def pair(*names):
    return frozenset(names)


@cache
def meshed_cell():
    """Return the V cell with a gate and a jaw, both concave, and rules for some pairs."""
    cell = v_job().cell
    gate = Body("gate", c_shape(1.6, 0.1, 0.4), at(0.75, 0.1, 0.3))
    jaw = Body("jaw", c_shape(0.12, 0.02, 0.06), at(0.0, 0.0, 0.05))
    rules = PairRules(
        allowed=frozenset([pair("jaw", "belt run"), pair("R_link", "gate")]),
        required={
            pair("part", "gate"): 0.04,
            pair("jaw", "gate"): 0.0,
            pair("B_link", "floor"): 0.1,
            pair("part", "R_link"): 0.03,
            pair("L_link", "R_link"): 0.02,
        },
    )
    return replace(cell, obstacles=(*cell.obstacles, gate), fixture=(jaw,), pairs=rules)


def configurations(n=240, seed=5):
    robot, random = meshed_cell().robot, np.random.default_rng(seed)
    on_motion = small_motion().q[random.integers(0, len(small_motion()), n // 2)]
    near = on_motion + random.normal(scale=0.3, size=on_motion.shape)
    anywhere = random_configurations(robot, n - n // 2, seed)
    return np.concatenate([anywhere, np.clip(near, robot.lower, robot.upper)])


def test_coal_and_fcl_find_the_same_pairs():
    cell = meshed_cell()
    scene, other = CollisionScene(cell), FclScene(cell)
    met = set()
    for q in configurations():
        margins = {frozenset(names): margin for names, margin in other.clearances(q).items()}
        found = {frozenset(names) for names in scene.colliding_pairs(q)}
        met |= found
        for names in found ^ {names for names, margin in margins.items() if margin <= 0.0}:
            assert abs(margins.get(names, np.inf)) < SAME, (names, q.tolist())
    # what the rules speak of was met, what may touch was not
    assert {pair("part", "gate"), pair("jaw", "gate"), pair("part", "R_link")} <= met
    assert not met & cell.pairs.allowed


def test_bullet_and_fcl_agree_on_meshes_and_rules():
    cell = meshed_cell()
    other = FclScene(cell)
    hits, near_gate = 0, 0
    with World(cell) as world:
        pairs = world.pairs()
        for q in configurations():
            margins = {frozenset(names): margin for names, margin in other.clearances(q).items()}
            world.move_to(q)
            for asked in pairs:
                names = pair(asked.first.name, asked.second.name)
                margin = margins.get(names, np.inf)
                distance = world.distance(asked.first, asked.second, 0.15)
                hit = distance <= 0.0 or distance < asked.clearance
                hits += hit
                if 0.0 < distance < 0.14 and margin + asked.clearance > 0.0:
                    rounded = STATED * sum(name.endswith("_link") for name in names) + SAME
                    assert distance == pytest.approx(margin + asked.clearance, abs=rounded), names
                    near_gate += "gate" in names
                elif hit != (margin <= 0.0):
                    assert abs(distance) < STATED, (names, distance, margin, q.tolist())
    assert hits > 100 and near_gate > 100


def test_every_pair_is_asked_as_the_rules_say():
    cell = meshed_cell()
    with World(cell) as world:
        bullet = {(pair(p.first.name, p.second.name), p.clearance) for p in world.pairs()}
    other = FclScene(cell)
    names = [piece[0] for piece in other.pieces]
    assert bullet == {(pair(names[a], names[b]), needed) for a, b, needed in other.pairs}
    assert not {names for names, _ in bullet} & cell.pairs.allowed
    assert (pair("B_link", "floor"), 0.1) in bullet and (pair("L_link", "R_link"), 0.02) in bullet


def test_a_mesh_is_as_far_away_however_many_triangles_it_has():
    # of two bodies PyBullet can hand over 47 661 points that it finds, some four of each triangle
    part, post = block((0.2, 0.16, 0.1)), block((0.5, 0.4, 0.3))
    random, found = np.random.default_rng(3), []
    q = np.radians([10.0, 20.0, -20.0, 30.0, -70.0, 40.0]) + random.normal(scale=0.2, size=(40, 6))
    for few_parts, few_posts in ((True, True), (False, True), (True, False)):
        shape = post if few_posts else cut_finer(post, 6)
        standing = Body("post", shape, at(1.0, 0.2, 0.5))
        cell = bare_cell(part if few_parts else cut_finer(part, 6), [standing])
        with World(cell) as world:
            pairs, told = world.pairs(), []
            for one in q:
                world.move_to(one)
                told += [world.distance(asked.first, asked.second, 0.13) for asked in pairs]
        found.append(np.array(told))
    coarse, *finer = found
    for fine in finer:
        apart = coarse > 0.0  # how deep bodies are in each other is told of one triangle
        assert np.isfinite(coarse[apart]).sum() > 40
        assert fine[apart] == pytest.approx(coarse[apart], abs=STATED)
        assert (fine[~apart] <= 0.0).all() and (fine[~apart] > -1.0).all()


# a hollow stays a hollow, whatever is in it


def only_the_part_meets(name):
    """Return rules by which a body may be in the way of every link."""
    return PairRules(frozenset(pair(name, f"{joint}_link") for joint in "SLURBT"))


def in_front_of(cell, part_to_body):
    """Return the pose of a body so far from the part at the zero configuration."""
    T_base_part = forward_kinematics(cell.robot, np.zeros(6)) @ cell.T_flange_workpiece
    return pose(np.eye(3), T_base_part[:3, 3] + part_to_body)


@pytest.mark.parametrize("part", [block((0.04, 0.04, 0.04)), c_shape(0.06, 0.01, 0.04)])
def test_a_part_may_be_in_the_hollow_of_a_mesh_but_not_in_its_walls(part):
    cell = bare_cell(part)
    frame = c_shape(0.4, 0.05, 0.5)
    for shift, shape, free in (
        (0.0, frame, True),
        (0.0, convex_hull(frame), False),  # a hull hides the hollow: this is what must not be
        (0.165, frame, False),
    ):
        body = Body("frame", shape, in_front_of(cell, np.array([0.0, shift, 0.0])))
        ready = replace(cell, obstacles=(body,), pairs=only_the_part_meets("frame"))
        hits = CollisionScene(ready).colliding_pairs(np.zeros(6))
        hidden = enclosing_bodies(ready, np.zeros(6))
        assert (("part", "frame") in [*hits, *hidden]) != free
        nothing = replay_nothing(ready)
        told = {finding.message.split(":")[0] for finding in nothing.findings}
        assert bool(told & {"part and frame", "robot and frame"}) != free


def replay_nothing(cell):

    return replay(cell, NO_POINTS, free_move(np.zeros((2, 6))), 1e-4)


def test_two_meshes_that_meet_are_found_by_both():
    # Bullet finds nothing between two meshes that it was told to keep concave
    cell = bare_cell(c_shape(0.1, 0.02, 0.05))
    for gap, hit in ((0.002, True), (0.0048, True), (0.0052, False)):
        T = in_front_of(cell, np.array([0.0, 0.2 + 0.05 + gap, 0.0]))
        frame = Body("frame", c_shape(0.4, 0.05, 0.5), T)
        ready = replace(cell, obstacles=(frame,), pairs=only_the_part_meets("frame"))
        assert (("part", "frame") in CollisionScene(ready).colliding_pairs(np.zeros(6))) == hit
        assert (replay_nothing(ready).collisions > 0) == hit
        with World(ready) as world:
            world.move_to(np.zeros(6))
            found = {
                (p.first.name, p.second.name): world.distance(p.first, p.second, 0.1)
                for p in world.pairs()
            }
        assert found["part", "frame"] == pytest.approx(gap, abs=SAME)


@settings(max_examples=60, deadline=None)
@given(arrays(float, 3, elements=st.floats(-0.13, 0.13, allow_subnormal=False)))
def test_inside_is_inside(p):
    mesh = c_shape(0.2, 0.03, 0.1)
    x, y, z = p
    walls = np.array([abs(x) - 0.1, abs(y) - 0.1, abs(z) - 0.05])
    hollow = np.array([-0.07 - x, abs(y) - 0.07])
    if np.abs(np.concatenate([walls, hollow])).min() < 1e-6:
        return  # on a face
    inside = bool((walls < 0.0).all() and not (hollow < 0.0).all())
    assert is_inside(mesh.triangles, p) == inside
    assert winding_number(mesh, p) == pytest.approx(float(inside), abs=1e-9)


def test_an_arm_inside_a_solid_is_told_though_no_surface_meets():
    cell = replace(v_job().cell, obstacles=())
    hall = Body("hall", block((20.0, 20.0, 20.0)), np.eye(4))
    ready = replace(cell, obstacles=(hall,))
    home = v_job().process.home
    assert CollisionScene(ready).colliding_pairs(home) == []
    assert enclosing_bodies(ready, home) == [("flange", "hall"), ("part", "hall")]
    assert replay_nothing(ready).verified is None
    inside_out = TriangleMesh(hall.shape.vertices, hall.shape.faces[:, ::-1])
    turned = replace(cell, obstacles=(Body("hall", inside_out, np.eye(4)),))
    assert len(enclosing_bodies(turned, home)) == 2


# rules and the proof


def test_a_clearance_of_one_pair_is_proven():
    # a post in 30 to 60 mm from the part somewhere on its way
    cell, motion = tiny_problem().cell, tiny_motion()
    T = forward_kinematics(cell.robot, motion.q[1]) @ cell.T_flange_workpiece
    away = cell.part.vertices.max(axis=0) + np.array([0.06, 0.0, 0.0])
    ready = with_obstacle(cell, (T @ [*away, 1.0])[:3])
    assert replay_tiny(cell=ready).verified is not None
    strict = PairRules(required={pair("post", "part"): 0.08})
    refused = replay_tiny(cell=replace(ready, pairs=strict))
    assert refused.verified is None
    told = [f.message for f in refused.findings if f.kind == "collision"]
    assert told and all(line.startswith("part and post") for line in told)
    assert any("80 mm needed" in line for line in told)
    near = with_obstacle(cell, T[:3, 3] + 0.02)
    assert replay_tiny(cell=near).verified is None
    held = frozenset(pair("post", name) for name in ("part", "stem"))
    may = PairRules(only_the_part_meets("post").allowed | held)
    assert replay_tiny(cell=replace(near, pairs=may)).verified is not None


def test_the_wheel_keeps_a_clearance_of_its_own_on_free_moves():
    cell = tiny_problem().cell
    far = PairRules(required={pair("part", "wheel"): 0.3})
    found = replay_tiny(cell=replace(cell, pairs=far))
    assert any("part and wheel" in f.message and "300 mm" in f.message for f in found.findings)


def test_rules_widen_with_the_clearance():
    cell = meshed_cell().widened(0.01)
    assert cell.required_clearance == pytest.approx(v_job().cell.required_clearance + 0.01)
    assert cell.pairs.between("gate", "part", 1.0) == pytest.approx(0.05)
    assert cell.pairs.between("R_link", "gate", 1.0) is None
    assert cell.pairs.between("T_link", "gate", 1.0) == 1.0


def test_shapes_that_are_gone_leave_no_objects_behind():
    corners = np.arange(900.0).reshape(300, 3)

    def objects():
        client = start()
        assert concave_shape(client, corners) >= 0
        client.disconnect()
        for _ in range(20):
            collision_shapes(v_job().cell.robot)
        gc.collect()
        return len(gc.get_objects())

    before = [objects() for _ in range(2)][-1]
    assert objects() < before + 10
