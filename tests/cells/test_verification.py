"""The replay in PyBullet: it agrees with the other libraries, and catches every fault put in."""

import ast
import os
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import opl
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.part_tree import part_tree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.findings import Level
from opl.geometry.frames import pose
from opl.geometry.shapes import Body, Cylinder
from opl.motion.motion import MoveKind, TimedMotion, VerifiedMotion
from opl.verification.replay import replay
from opl.verification.stretch import HORIZON, STEP, TURN
from opl.verification.world import GAP_ACCURACY, World
from tests.support.bare_cells import (
    NO_POINTS,
    bare_cell,
    block,
    c_shape,
    convex_hull,
    free_move,
    random_configurations,
    with_obstacle,
)
from tests.support.fcl_scene import FclScene
from tests.support.planned import (
    replay_tiny,
    small_motion,
    tiny_motion,
    tiny_problem,
    tiny_timed,
    v_job,
    v_problem,
    v_timed,
)

PACKAGE = Path(opl.__file__).parent
STATED = 1e-3  # [m] Bullet rounds the edges and corners of the links' boxes by up to a millimetre


@cache
def v_verification():
    return replay(v_job().cell, v_problem().points, v_timed(), v_job().search.max_contact_error)


def kinds(verification):
    return {finding.kind for finding in verification.findings}


def refuses(verification, kind, *words):
    """Assert that a replay found a kind of fault, in words that name it, and proved nothing."""
    assert verification.verified is None
    told = [str(finding) for finding in verification.findings if finding.kind == kind]
    assert any(all(word in line for word in words) for line in told), verification.findings
    assert all(finding.level is Level.ERROR for finding in verification.findings)
    return True


def indices(motion, kind):
    return [k for k, each in enumerate(motion.kind) if each is kind]


# PyBullet against the other libraries


def test_bullets_link_poses_agree_with_forward_kinematics():
    cell = v_job().cell
    configurations = random_configurations(cell.robot, 200)
    with World(cell) as world:
        found = np.array([world.move_to(q) for q in configurations])
    wanted = forward_kinematics(cell.robot, configurations) @ cell.T_flange_workpiece
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-6)


def test_bullet_and_fcl_agree_on_what_is_too_near():
    cell = v_job().cell
    other = FclScene(cell)
    random = np.random.default_rng(0)
    near = small_motion().q[random.integers(0, len(small_motion()), 150)]
    near = near + random.normal(scale=0.15, size=near.shape)
    configurations = np.concatenate(
        [random_configurations(cell.robot, 150), np.clip(near, cell.robot.lower, cell.robot.upper)]
    )
    n_hits = 0
    with World(cell) as world:
        pairs = world.pairs()
        for q in configurations:
            margins = {frozenset(pair): margin for pair, margin in other.clearances(q).items()}
            world.move_to(q)
            for pair in pairs:
                margin = margins.get(frozenset([pair.first.name, pair.second.name]), np.inf)
                distance = world.distance(pair.first, pair.second, 0.05)
                hit = distance <= 0.0 or distance < pair.clearance
                n_hits += hit
                if hit != (margin <= 0.0):
                    # in penetration fcl tells no depth, so its 0 says little of how deep
                    away = distance - pair.clearance if hit else margin
                    met = distance if margin <= -pair.clearance else away
                    assert abs(met) < STATED, (pair, distance, margin, q.tolist())
                elif 0.0 < distance < 0.05 and margin + pair.clearance > 0.0:
                    assert distance == pytest.approx(margin + pair.clearance, abs=STATED)
    assert n_hits > 100


def test_every_pair_is_asked_that_the_rules_name():
    cell = v_job().cell
    with World(cell) as world:
        found = {
            (frozenset([pair.first.name, pair.second.name]), pair.clearance)
            for pair in world.pairs()
        }
    other = FclScene(cell)
    names = [piece[0] for piece in other.pieces]
    wanted = {(frozenset([names[a], names[b]]), needed) for a, b, needed in other.pairs}
    assert found == wanted


def test_bullet_prints_no_banners_nor_leaves_them_to_the_end():
    """In a pipe C code prints what it has gathered when the process ends, if not before."""
    script = "from opl.verification.engine import start; start(); print('told')"
    told = {key: value for key, value in os.environ.items() if key != "PYTHONUNBUFFERED"}
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=told)
    assert ended.stdout == "told\n" and ended.stderr == ""


def test_round_links_are_round():
    # a thin rod held against the flange disc, all round it: no facets
    robot = v_job().cell.robot
    T_base_flange = forward_kinematics(robot, np.zeros(6))
    distances = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 33):
        # 20 mm off the rim, half-way along the disc
        p = np.array([0.071 * np.cos(angle), 0.071 * np.sin(angle), -0.0065])
        T = T_base_flange @ pose(np.eye(3), p)
        rod = Body("rod", Cylinder(0.001, 0.004), T)
        with World(bare_cell(block((0.02, 0.02, 0.02)), [rod])) as world:
            pair = next(
                pair
                for pair in world.pairs()
                if (pair.first.name, pair.second.name) == ("T_link", "rod")
            )
            world.move_to(np.zeros(6))
            distances.append(world.distance(pair.first, pair.second, 0.1))
    np.testing.assert_allclose(distances, 0.019, atol=1e-4)


# concave parts


@pytest.mark.parametrize("hollow", [True, False], ids=["C", "its hull"])
def test_a_concave_part_does_not_collide_in_its_hollow(hollow):
    part = c_shape(width=0.2, wall=0.03, depth=0.1)
    cell = bare_cell(part if hollow else convex_hull(part))
    p = (forward_kinematics(cell.robot, np.zeros(6)) @ cell.T_flange_workpiece)[:3, 3]
    # a post that reaches into the C through its opening, which looks up
    cell = with_obstacle(cell, p + np.array([0.0, 0.0, 0.08]), (0.04, 0.04, 0.2))
    turn_a_little = np.zeros((2, 6))
    turn_a_little[1, 5] = np.radians(3.0)
    verification = replay(cell, NO_POINTS, free_move(turn_a_little), 1e-4)
    if hollow:
        assert verification.findings == ()
        assert verification.verified is not None
        # turned by 3 degrees, the walls 70 mm from the middle, the post 20 mm wide on either side
        assert 0.04 < verification.min_clearance < 0.05
    else:
        assert refuses(verification, "collision", "part and post", "into each other")


def test_a_concave_part_collides_with_its_walls():
    cell = bare_cell(c_shape(width=0.2, wall=0.03, depth=0.1))
    T_base_part = forward_kinematics(cell.robot, np.zeros(6)) @ cell.T_flange_workpiece
    p = T_base_part[:3, 3] - 0.085 * T_base_part[:3, 0]  # in the back of the C
    cell = with_obstacle(cell, p, (0.05, 0.05, 0.05))
    q = np.zeros((2, 6))
    q[1, 5] = 0.01
    assert refuses(replay(cell, NO_POINTS, free_move(q), 1e-4), "collision", "part and post")


def test_what_gets_inside_the_part_is_caught_on_its_way_in():
    # a mesh is a surface: what lies wholly within touches nothing, so the way in must be seen
    cell = bare_cell(block((0.1, 0.1, 0.1)), clearance=0.0)
    inside = np.zeros(6)
    p = (forward_kinematics(cell.robot, inside) @ cell.T_flange_workpiece)[:3, 3]
    cell = with_obstacle(cell, p, (0.002, 0.002, 0.002))
    q = np.zeros((2, 6))
    q[0, 0] = -0.3
    assert refuses(replay(cell, NO_POINTS, free_move(q), 1e-4), "collision", "part and post")


# the motion of the V part


def test_the_v_motion_is_proven():
    verification = v_verification()
    assert verification.findings == ()
    assert verification.collisions == 0
    assert verification.limit_violations == 0
    assert isinstance(verification.verified, VerifiedMotion)
    assert verification.max_contact_error <= v_job().search.max_contact_error
    assert verification.min_clearance >= v_job().cell.required_clearance
    assert verification.engine.startswith("PyBullet ")


def test_every_extreme_names_its_pair_its_place_and_its_joints():
    found, cell = replay_tiny(), tiny_problem().cell
    assert found.nearest.amount == found.min_clearance
    assert found.worst_contact.amount == found.max_contact_error
    assert "cutter point" in found.worst_contact.place
    assert " and " in found.nearest.subject and found.deepest.subject == "part and wheel"
    assert (found.nearest.q >= cell.robot.lower).all()
    # the closed form sees the same depth there, and nowhere more
    Ts_base_flange = forward_kinematics(cell.robot, np.vstack([found.deepest.q, tiny_motion().q]))
    Ts_contact0_workpiece = cell.Ts_contact0_workpiece(Ts_base_flange)
    exact = signed_wheel_distance(part_tree(cell.part), cell.wheel, Ts_contact0_workpiece, 0.1)
    assert found.deepest.amount == pytest.approx(-exact[0], abs=GAP_ACCURACY)
    assert -exact.min() <= found.deepest.amount + GAP_ACCURACY
    assert found.allowed_penetration == cell.max_belt_penetration >= found.deepest.amount


def test_the_verified_motion_is_the_motion_with_its_clearances():
    verified = v_verification().verified
    assert verified.timed is v_timed()
    assert verified.clearance.min() == v_verification().min_clearance
    assert (verified.clearance <= HORIZON).all()


def test_the_replay_is_dense():
    # no joint turns by more than half a degree between two poses, so there are at least so many
    turned = np.abs(np.diff(v_timed().motion.q, axis=0)).max(axis=1)
    assert v_verification().poses >= np.ceil(turned / TURN).sum()
    Ts = (
        forward_kinematics(v_job().cell.robot, v_timed().motion.q) @ v_job().cell.T_flange_workpiece
    )
    way = np.linalg.norm(np.diff(Ts[:, :3, 3], axis=0), axis=1)
    assert v_verification().poses >= way.sum() / STEP


def test_clearances_are_those_of_an_independent_scene():
    verified = v_verification().verified
    motion = verified.motion
    scene = FclScene(v_job().cell)
    needed = {
        (scene.pieces[a][0], scene.pieces[b][0]): clearance for a, b, clearance in scene.pairs
    }
    for k in range(3, len(motion), 97):
        margins = scene.clearances(motion.q[k])
        nearest = min(
            margin + needed[pair] for pair, margin in margins.items() if needed[pair] > 0.0
        )
        # that of the move is the least on the way to the configuration
        assert verified.clearance[k] <= min(nearest, HORIZON) + STATED


def test_progress_is_told():
    told = []
    q = np.zeros((120, 6))
    replay(bare_cell(block((0.02, 0.02, 0.02))), NO_POINTS, free_move(q), 1e-4, told.append)
    assert told == [0.0, 1 / 3, 2 / 3]


# faults put in, each of which must be found


def moved_into_wheel(index, depth):
    """Return the tiny motion with one configuration moved towards the wheel."""
    cell, motion = tiny_problem().cell, tiny_motion()
    T_base_flange = forward_kinematics(cell.robot, motion.q[index])
    into = cell.wheel.T_base_contact(motion.contact_position[index])[:3, 2]
    T_base_flange[:3, 3] += depth * into
    found = inverse_kinematics(cell.robot.arm, T_base_flange, motion.q[index])
    found = found + 2 * np.pi * np.round((motion.q[index] - found) / (2 * np.pi))
    q = motion.q.copy()
    q[index] = found[np.nanargmin(np.abs(found - q[index]).max(axis=1))]
    return TimedMotion(replace(motion, q=q), np.maximum(tiny_timed().duration, 1.0))


def test_the_tiny_motion_is_proven():
    assert replay_tiny().findings == ()


@pytest.mark.parametrize("which", [2, 8, 15])
def test_a_configuration_that_cuts_into_the_wheel_is_caught(which):
    index = indices(tiny_motion(), MoveKind.GRIND)[which]
    verification = replay_tiny(moved_into_wheel(index, 0.002))
    assert refuses(verification, "collision", "part and wheel", "into each other")
    assert verification.collisions > 0
    depth = max(
        float(str(f).split(": ")[-1].split(" mm")[0])
        for f in verification.findings
        if f.kind == "collision"
    )
    # at an edge of the wheel the nearest way out is a shorter one
    assert 1.0 < depth < 2.2


def test_a_pass_that_is_touched_down_for_from_the_end_of_a_free_move_is_proven():
    """Leads are cut short: of an approach nothing may be left but where it begins."""
    approach = indices(tiny_motion(), MoveKind.APPROACH)
    kept = np.setdiff1d(np.arange(len(tiny_motion())), approach)
    near = tiny_timed().take(kept)
    after = np.searchsorted(kept, approach[0])
    assert near.motion.kind[after] is MoveKind.GRIND and near.motion.kind[after - 1].is_free
    verification = replay_tiny(near)
    assert not [finding for finding in verification.findings if finding.kind == "contact"]


def test_a_configuration_that_leaves_the_wheel_is_caught():
    index = indices(tiny_motion(), MoveKind.GRIND)[8]
    verification = replay_tiny(moved_into_wheel(index, -0.001))
    assert refuses(verification, "contact", "part and wheel", "do not touch")
    assert verification.collisions == 0
    assert verification.max_contact_error == pytest.approx(0.001, abs=2e-4)
    farther = replay_tiny(moved_into_wheel(index, -0.008))
    assert refuses(farther, "contact", "part and wheel", "more than 5 mm from the wheel")


@pytest.mark.parametrize("kind", [MoveKind.HOME, MoveKind.LINK])
def test_an_obstacle_on_a_free_move_is_caught(kind):
    motion, problem = tiny_motion(), tiny_problem()
    move = indices(motion, kind)[1 if kind is MoveKind.HOME else 0]
    middle = (motion.q[move - 1] + motion.q[move]) / 2.0
    p = (forward_kinematics(problem.cell.robot, middle) @ problem.cell.T_flange_workpiece)[:3, 3]
    cell = with_obstacle(problem.cell, p, (0.01, 0.01, 0.01))
    verification = replay_tiny(cell=cell)
    assert refuses(verification, "collision", "post")
    place = "free move from home" if kind is MoveKind.HOME else "link of pass 2"
    assert any(finding.where == place for finding in verification.findings)


def test_a_collision_that_exists_only_between_two_configurations_is_caught():
    ends = small_motion().q[:2]  # from home to the first pass, a long way
    middle = ends.mean(axis=0)
    cell = v_job().cell
    p = (forward_kinematics(cell.robot, middle) @ cell.T_flange_workpiece)[:3, 3]
    cell = with_obstacle(cell, p, (0.02, 0.02, 0.02))
    scene = FclScene(cell)
    assert all(min(scene.clearances(q).values()) > 0.0 for q in ends)
    assert min(scene.clearances(middle).values()) <= 0.0
    verification = replay(cell, NO_POINTS, free_move(ends), 1e-4)
    assert refuses(verification, "collision", "post")


def test_an_obstacle_thinner_than_a_large_step_is_caught():
    # 1 mm thick, across the way of a part that is 20 mm wide, moved by 1.6 rad in one move
    cell = bare_cell(block((0.02, 0.02, 0.02)), clearance=0.0)
    q = np.zeros((2, 6))
    q[1, 0] = 1.6
    middle = np.array([0.83, 0, 0, 0, 0, 0])
    p = (forward_kinematics(cell.robot, middle) @ cell.T_flange_workpiece)[:3, 3]
    cell = with_obstacle(cell, p, (0.001, 0.001, 0.001))
    verification = replay(cell, NO_POINTS, free_move(q), 1e-4)
    assert refuses(verification, "collision", "part and post")
    assert not FclScene(cell).clearances(q[0]).get(("part", "post"), 1.0) <= 0.0


def test_a_configuration_beyond_a_joint_limit_is_caught():
    motion, robot = tiny_motion(), tiny_problem().cell.robot
    q = motion.q.copy()
    q[0, 5] = robot.lower[5] - np.radians(0.5)
    moved = TimedMotion(replace(motion, q=q), np.maximum(tiny_timed().duration, 20.0))
    verification = replay_tiny(moved)
    assert refuses(verification, "limit", "joint T", "0.500 deg beyond its limit")
    assert verification.limit_violations == 1


@pytest.mark.parametrize("kind", [MoveKind.HOME, MoveKind.GRIND, MoveKind.RETRACT])
def test_a_move_that_is_too_fast_is_caught(kind):
    motion, robot = tiny_motion(), tiny_problem().cell.robot
    move = indices(motion, kind)[1]
    turned = np.abs(motion.q[move] - motion.q[move - 1])
    least = (turned / robot.max_speed).max()
    duration = tiny_timed().duration.copy()
    duration[move] = 0.99 * least
    verification = replay_tiny(TimedMotion(motion, duration))
    joint = robot.joint_names[int(np.argmax(turned / robot.max_speed))]
    assert refuses(verification, "speed", f"joint {joint}", "deg/s")
    duration[move] = 1.001 * least
    assert replay_tiny(TimedMotion(motion, duration)).findings == ()


def test_a_move_that_takes_no_time_is_caught():
    duration = tiny_timed().duration.copy()
    duration[15] = 0.0
    assert refuses(replay_tiny(TimedMotion(tiny_motion(), duration)), "speed")


@pytest.mark.parametrize("which", [0, 7, -1])
def test_a_missing_cutter_point_is_caught(which):
    motion = tiny_motion()
    missing = indices(motion, MoveKind.GRIND)[which]
    rest = np.delete(np.arange(len(motion)), missing)
    left = TimedMotion(motion.take(rest), np.maximum(tiny_timed().duration[rest], 5.0))
    point = int(motion.cutter_point[missing])
    verification = replay_tiny(left)
    told = [finding for finding in verification.findings if finding.kind == "order"]
    assert [finding.where for finding in told] == [f"cutter point {point}"]
    assert "20 cutter points expected in order, 19 ground" in told[0].message
    assert verification.verified is None


def test_cutter_points_out_of_order_are_caught():
    motion = tiny_motion()
    place = motion.cutter_point.copy()
    one, other = indices(motion, MoveKind.GRIND)[5:7]
    place[[one, other]] = place[[other, one]]
    mixed = replace(tiny_timed(), motion=replace(motion, cutter_point=place))
    assert refuses(replay_tiny(mixed), "order", "cutter point 5")


@pytest.mark.parametrize(
    ("shift", "kind"), [(0.001, "collision"), (-0.001, "contact"), (-0.01, "contact")]
)
def test_a_shifted_wheel_is_caught(shift, kind):
    problem = tiny_problem()
    T = problem.cell.wheel.T_base_contact0.copy()
    T[:3, 3] -= shift * T[:3, 2]  # towards the part
    wheel = replace(problem.cell.wheel, T_base_contact0=T)
    verification = replay_tiny(cell=replace(problem.cell, wheel=wheel))
    assert refuses(verification, kind, "part and wheel")


def test_another_part_than_was_planned_for_is_caught():
    problem = tiny_problem()
    larger = replace(problem.cell.part, vertices=problem.cell.part.vertices * 1.02)
    cell = replace(problem.cell, part=larger)
    assert refuses(replay_tiny(cell=cell), "collision", "part and wheel")


def test_a_free_move_too_near_the_wheel_is_caught():
    # retracted by 3 mm only, where 5 mm are to be kept
    problem, motion = tiny_problem(), tiny_motion()
    index = indices(motion, MoveKind.GRIND)[8]
    q = moved_into_wheel(index, -0.003).motion.q[[index, index]]
    verification = replay(problem.cell, NO_POINTS, free_move(q), 1e-4)
    assert refuses(verification, "collision", "part and wheel", " mm apart, 5 mm needed")


@pytest.mark.parametrize("clearance", [0.005, 0.02])
def test_too_near_is_a_collision(clearance):
    cell = bare_cell(block((0.06, 0.06, 0.06)), clearance=clearance)
    p = (forward_kinematics(cell.robot, np.zeros(6)) @ cell.T_flange_workpiece)[:3, 3]
    for gap, hit in [(0.9 * clearance, True), (1.1 * clearance, False)]:
        near = with_obstacle(cell, p + np.array([0.0, 0.0, 0.045 + gap]))
        verification = replay(near, NO_POINTS, free_move(np.zeros((2, 6))), 1e-4)
        assert bool(verification.findings) == hit
        assert verification.min_clearance == pytest.approx(gap, abs=STATED)
        if hit:
            assert f"{1e3 * clearance:g} mm needed" in str(verification.findings[0])


# skipping what cannot have come near


@pytest.mark.parametrize("seed", [1, 3])
def test_skipping_pairs_leaves_out_nothing(seed, monkeypatch):
    """Compare with levers so long that every pair is measured at every pose."""
    random = np.random.default_rng(seed)
    problem = tiny_problem()
    start = tiny_motion().q[random.integers(len(tiny_motion()))]
    q = np.clip(
        start + np.cumsum(random.normal(scale=0.12, size=(6, 6)), axis=0),
        problem.cell.robot.lower,
        problem.cell.robot.upper,
    )
    p = forward_kinematics(problem.cell.robot, q)[3, :3, 3] + random.uniform(-0.15, 0.15, 3)
    cell = with_obstacle(problem.cell, p, (0.02, 0.02, 0.02))
    skipping = replay(cell, NO_POINTS, free_move(q), 1e-4)
    monkeypatch.setattr(World, "levers", lambda self, pairs: np.full((len(pairs), 6), 1e12))
    measuring = replay(cell, NO_POINTS, free_move(q), 1e-4)
    assert skipping.poses == measuring.poses
    assert skipping.collisions == measuring.collisions
    assert skipping.min_clearance == measuring.min_clearance
    assert skipping.findings == measuring.findings


def test_skipping_leaves_the_proven_motion_its_clearances(monkeypatch):
    skipping = replay_tiny()
    monkeypatch.setattr(World, "levers", lambda self, pairs: np.full((len(pairs), 6), 1e12))
    measuring = replay_tiny()
    np.testing.assert_array_equal(skipping.verified.clearance, measuring.verified.clearance)
    assert skipping.findings == measuring.findings == ()


def test_levers_are_as_long_as_anything_moves():
    cell = v_job().cell
    with World(cell) as world:
        (levers,) = world.levers([world.part_and_wheel()])
        random = np.random.default_rng(0)
        corners = np.array(
            np.meshgrid(*zip(cell.part.vertices.min(0), cell.part.vertices.max(0), strict=True))
        )
        corners = corners.reshape(3, -1).T
        for q in random_configurations(cell.robot, 100):
            for joint in range(6):
                turned = q.copy()
                turned[joint] += 1e-3 * random.choice([-1, 1])
                before, after = world.move_to(q), world.move_to(turned)
                moved = np.linalg.norm(
                    corners @ (after - before)[:3, :3].T + (after - before)[:3, 3], axis=1
                )
                assert moved.max() <= 1e-3 * levers[joint] + 2e-6  # Bullet's own digits


# who may say that a motion is proven


def called_names(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            target = node.func
            yield target.id if isinstance(target, ast.Name) else getattr(target, "attr", None)


def test_only_verification_makes_a_verified_motion():
    makers = {
        path.relative_to(PACKAGE).parts[0]
        for path in PACKAGE.rglob("*.py")
        if "VerifiedMotion" in set(called_names(ast.parse(path.read_text())))
    }
    assert makers == {"verification"}


def test_the_second_opinion_shares_no_code_with_the_first():
    allowed_of_cell = {"workcell"}
    allowed_of_planning = {"motion"}
    for path in (PACKAGE / "verification").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            modules = []
            if isinstance(node, ast.ImportFrom):
                modules = [node.module, *(f"{node.module}.{name.name}" for name in node.names)]
            elif isinstance(node, ast.Import):
                modules = [name.name for name in node.names]
            for module in modules:
                parts = module.split(".")
                assert parts[0] not in ("coal", "pinocchio", "hppfcl", "fcl"), path
                if parts[:2] == ["opl", "cell"] and len(parts) > 2:
                    assert parts[2] in allowed_of_cell, f"{path.name}: {module}"
                if parts[:2] == ["opl", "planning"] and len(parts) > 2:
                    assert parts[2] in allowed_of_planning, f"{path.name}: {module}"
