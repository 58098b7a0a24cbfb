"""Collision of robot, part and scene: coal against python-fcl, with nothing shared between them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from opl.cell.collision import CollisionScene
from opl.cell.nearest import nearest_pairs
from opl.cell.robot import forward_kinematics
from opl.cell.robot_loading import load_robot
from opl.geometry.frames import pose
from opl.geometry.shapes import Body, Box, Cylinder
from tests.support.bare_cells import bare_cell, block, random_configurations, with_obstacle
from tests.support.fcl_scene import FclScene
from tests.support.planned import small_motion, v_job

MH24 = load_robot("mh24")
SMALL = block((0.02, 0.02, 0.02))
STATED = 1e-4  # [m] the two libraries may differ where a pair is this near to its margin


def configurations_of_interest(cell, n=300, seed=0):
    """Return random configurations, half of them anywhere and half near a motion at the wheel."""
    random = np.random.default_rng(seed)
    on_motion = small_motion().q[random.integers(0, len(small_motion()), n // 2)]
    near = on_motion + random.normal(scale=0.15, size=on_motion.shape)
    anywhere = random_configurations(cell.robot, n - n // 2, seed)
    return np.concatenate([anywhere, np.clip(near, cell.robot.lower, cell.robot.upper)])


def unordered(pairs):
    return {tuple(sorted(pair)) for pair in pairs}


def at_the_margin(scene, free, colliding):
    """Return configurations to either side of where one that is free begins to collide."""
    while np.abs(colliding - free).max() > 1e-7:
        middle = (free + colliding) / 2.0
        if scene.collides(middle[None])[0]:
            colliding = middle
        else:
            free = middle
    return np.linspace(free, colliding, 9)


def test_what_was_looked_at_before_changes_no_answer():
    cell = v_job().cell
    scene = CollisionScene(cell)
    around = configurations_of_interest(cell)
    hits = scene.collides(around)
    pairs = zip(around[~hits][:20], around[hits][:20], strict=True)
    margins = np.concatenate([at_the_margin(scene, *pair) for pair in pairs])
    first = CollisionScene(cell).collides(margins)
    distances = nearest_pairs(CollisionScene(cell), margins).distance
    for before in np.split(around, 30):
        scene.collides(before)
        np.testing.assert_array_equal(scene.collides(margins), first)
        nearest_pairs(scene, before)
        np.testing.assert_array_equal(nearest_pairs(scene, margins).distance, distances)
    assert [bool(scene.colliding_pairs(q)) for q in margins] == first.tolist()


@pytest.mark.parametrize("clearance", [0.0, 0.005, 0.02])
def test_an_independent_scene_finds_the_same_pairs(clearance):
    cell = replace(v_job().cell, required_clearance=clearance)
    scene, other = CollisionScene(cell), FclScene(cell)
    configurations = configurations_of_interest(cell)
    collides = scene.collides(configurations)
    assert 50 < collides.sum() < 250
    for q, hit in zip(configurations, collides, strict=True):
        margins = {tuple(sorted(pair)): m for pair, m in other.clearances(q).items()}
        found = unordered(scene.colliding_pairs(q))
        assert bool(found) == hit
        wanted = {pair for pair, margin in margins.items() if margin <= 0.0}
        for pair in found ^ wanted:
            assert abs(margins.get(pair, np.inf)) < STATED, f"{pair} at {q.tolist()}"


def test_the_broad_phase_misses_no_pair_however_large_the_clearance():
    # with 80 mm the boxes that the broad phase compares are apart long before the margins are
    cell = replace(v_job().cell, required_clearance=0.08, fixture=())
    lifted = cell.T_flange_workpiece.copy()
    lifted[2, 3] += 0.25  # else the part is always within 80 mm of the forearm
    cell = replace(cell, T_flange_workpiece=lifted)
    scene, other = CollisionScene(cell), FclScene(cell)
    configurations = configurations_of_interest(cell, seed=1)
    collides = scene.collides(configurations)
    wanted = np.array(
        [min(other.clearances(q).values(), default=1.0) <= 0.0 for q in configurations]
    )
    assert 20 < wanted.sum() < 280
    np.testing.assert_array_equal(collides, wanted)


def test_asking_every_pair_agrees_with_asking_whether_any_collides():
    cell = replace(v_job().cell, required_clearance=0.03)
    scene = CollisionScene(cell)
    configurations = configurations_of_interest(cell, seed=2)
    one_by_one = [bool(scene.colliding_pairs(q)) for q in configurations]
    np.testing.assert_array_equal(scene.collides(configurations), one_by_one)


def test_the_answer_does_not_depend_on_what_was_asked_before():
    cell = v_job().cell
    configurations = configurations_of_interest(cell, n=60, seed=3)
    scene = CollisionScene(cell)
    for q in [*configurations, *configurations[::-1]]:
        fresh = CollisionScene(cell)
        assert scene.colliding_pairs(q) == fresh.colliding_pairs(q)
        assert scene.collides(q[None])[0] == fresh.collides(q[None])[0]


def test_the_home_configuration_of_the_job_is_free():
    job = v_job()
    scene = CollisionScene(job.cell)
    assert not scene.collides(job.process.home[None])[0]
    assert scene.colliding_pairs(job.process.home) == []


def test_no_configuration_is_no_answer():
    assert CollisionScene(v_job().cell).collides(np.empty((0, 6))).shape == (0,)


# what keeps which distance


# at the zero configuration the turret disc of S reaches y = 0.229, and lies 0.354 to 0.215 below
# the base
@pytest.mark.parametrize(("gap", "hit"), [(0.003, True), (0.0049, True), (0.0051, False)])
def test_the_first_link_keeps_the_clearance_from_obstacles(gap, hit):
    cell = with_obstacle(bare_cell(SMALL), (0.0, 0.229 + gap + 0.05, -0.28), (0.1, 0.1, 0.1))
    found = unordered(CollisionScene(cell).colliding_pairs(np.zeros(6)))
    assert (("S_link", "post") in found) == hit


@pytest.mark.parametrize(("gap", "hit"), [(0.003, True), (0.0051, False)])
def test_a_far_link_keeps_the_clearance_from_obstacles(gap, hit):
    q = np.zeros(6)
    cell = bare_cell(SMALL)
    T_base_flange = forward_kinematics(MH24, q)
    # above the flange disc, radius 51 mm about the flange axis (x of the base at zero)
    p = T_base_flange[:3, 3] + np.array([-0.0065, 0.0, 0.051 + gap + 0.05])
    found = unordered(CollisionScene(with_obstacle(cell, p, (0.01, 0.1, 0.1))).colliding_pairs(q))
    assert (("T_link", "post") in found) == hit


def test_the_foot_may_stand_on_what_does_not_move():
    cell = with_obstacle(bare_cell(SMALL), (0, 0, -0.52), (2, 2, 0.05))
    assert CollisionScene(cell).colliding_pairs(np.zeros(6)) == []


def test_the_part_may_touch_the_wheel_but_the_fixture_may_not():
    cell = bare_cell(block((0.06, 0.06, 0.06)))
    T_base_part = forward_kinematics(MH24, np.zeros(6)) @ cell.T_flange_workpiece
    cell = replace(cell, wheel=replace(cell.wheel, T_base_contact0=T_base_part, radius=0.02))
    assert ("part", "wheel") not in unordered(CollisionScene(cell).colliding_pairs(np.zeros(6)))
    stem = Body("stem", Cylinder(0.01, 0.1), cell.T_flange_workpiece)
    cell = replace(cell, fixture=(stem,))
    found = unordered(CollisionScene(cell).colliding_pairs(np.zeros(6)))
    assert ("stem", "wheel") in found
    assert ("part", "stem") not in found


def test_the_part_hits_what_stands_around():
    cell = bare_cell(block((0.06, 0.06, 0.06)))
    p = (forward_kinematics(MH24, np.zeros(6)) @ cell.T_flange_workpiece)[:3, 3]
    # the post is 30 mm wide
    near, far = (with_obstacle(cell, p + np.array([0, 0, 0.045 + gap])) for gap in (0.0049, 0.0051))
    assert CollisionScene(near).colliding_pairs(np.zeros(6)) == [("part", "post")]
    assert CollisionScene(far).colliding_pairs(np.zeros(6)) == []


def test_pairs_are_named_once_by_link_and_body():
    # a slab through the forearm meets several of its boxes
    cell = with_obstacle(bare_cell(SMALL), (0.7, 0, 0.96), (0.8, 0.02, 0.4))
    found = CollisionScene(cell).colliding_pairs(np.zeros(6))
    assert len(found) == len(set(found))
    assert ("R_link", "post") in unordered(found)
    names = {name for pair in found for name in pair}
    assert names <= {"S_link", "L_link", "U_link", "R_link", "B_link", "T_link", "part", "post"}


# the fork of the forearm


def test_the_fork_is_open_over_the_whole_travel_of_b():
    at_flange = pose(np.eye(3), np.array([0.0, 0.0, 0.01]))
    cell = replace(bare_cell(block((0.002, 0.002, 0.002))), T_flange_workpiece=at_flange)
    scene = CollisionScene(cell)
    configurations = np.zeros((301, 6))
    configurations[:, 4] = np.radians(np.linspace(-150.0, 150.0, 301))
    for wrist in np.radians([0.0, 77.0]):
        configurations[:, 5] = wrist
        assert not scene.collides(configurations).any()


def test_a_wide_part_meets_the_fork_when_the_wrist_is_bent_back():
    cell = bare_cell(block((0.4, 0.4, 0.05)))
    scene = CollisionScene(cell)
    q = np.zeros(6)
    assert scene.colliding_pairs(q) == []
    q[4] = np.radians(120.0)
    assert ("R_link", "part") in unordered(scene.colliding_pairs(q))


def test_margins_are_distances_not_box_overlaps():
    # two boxes corner to corner: their axis-aligned boxes overlap although they are 5.2 mm apart
    cell = bare_cell(block((0.04, 0.04, 0.04)))
    T_base_part = forward_kinematics(MH24, np.zeros(6)) @ cell.T_flange_workpiece
    turned = pin.SE3(pin.utils.rotate("x", np.pi / 4), np.zeros(3)).homogeneous
    apart = 0.02 + 0.02 * np.sqrt(2.0)
    for gap, hit in [(0.0048, True), (0.0052, False)]:
        T = turned.copy()
        T[:3, 3] = T_base_part[:3, 3] + np.array([0.0, 0.0, apart + gap])
        body = Body("post", Box((0.04, 0.04, 0.04)), T)
        ready = replace(cell, obstacles=(body,))
        found = unordered(CollisionScene(ready).colliding_pairs(np.zeros(6)))
        assert (("part", "post") in found) == hit


def test_what_collides_throughout_collides_wherever_the_joints_turn():
    cell = v_job().cell
    scene = CollisionScene(cell.widened(0.03))
    q = configurations_of_interest(cell, n=600, seed=4)
    random = np.random.default_rng(4)
    turned = random.uniform(0.0, 0.03, q.shape) * random.integers(0, 2, q.shape)
    sure = scene.collides_throughout(q, turned)
    assert sure.any() and (scene.collides(q) & ~sure).any()
    # to every corner of what the joints may turn, where bodies come apart farthest
    for _ in range(40):
        there = q[sure] + turned[sure] * random.choice([-1.0, 1.0], turned[sure].shape)
        assert scene.collides(there).all()
    np.testing.assert_array_equal(scene.collides_throughout(q, np.zeros_like(q)), scene.collides(q))
