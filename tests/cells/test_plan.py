"""Search and check together: what is in the way, the motion around a path, refusals."""

from dataclasses import replace
from functools import cache
from itertools import islice

import numpy as np
import pytest

from opl.cell.robot import forward_kinematics
from opl.errors import NoPathError
from opl.motion.collision_check import colliding_moves
from opl.motion.joint_lines import RESOLUTION, densify
from opl.motion.motion import MoveKind
from opl.motion.timing import Cause, time_motion
from opl.motion.whole_motion import UnreachableApproachError, whole_motion
from opl.planning.filling import BrokenEdgesError, fill_in
from opl.planning.fixed_contact import keep_contact, runs_of
from opl.planning.multi_start import (
    plan_recursive,
    tracks_from_best_start,
    try_recursive,
)
from opl.planning.open_matrix import open_matrices
from opl.planning.plan import Exhausted, Found, OutOfBudget, Pause, propose_and_check
from opl.planning.reasons import explain, unreachable_points
from opl.planning.settings import Start
from opl.planning.shut_ways import CLOSE
from opl.planning.survey import NodeState, survey_nodes
from opl.planning.turned import Kept
from opl.run import searches
from tests.support.bare_cells import Ghosts, with_obstacle
from tests.support.brute_force import printed_recursion
from tests.support.fcl_scene import FclScene
from tests.support.planned import (
    problem_of,
    small_job,
    small_motion,
    small_plan,
    small_problem,
    small_timed,
    v_job,
    v_plan,
    v_problem,
    v_timed,
    with_positions,
    with_problem_cell,
    with_scene,
)

PAPER_FIXED = [0.4711, 0.3512, 0.2951, 2.8134, 0.8810, 1.5024]  # [rad], table 2, S L U R B T
PAPER_RECURSIVE = 2.5287  # [rad]


def hits_anything(cell, motion, every=1):
    """Ask an independent scene about the configurations of a motion and the ways between them."""
    scene = FclScene(cell)
    dense, _ = densify(motion.q, RESOLUTION)
    return any(min(scene.clearances(q).values(), default=1.0) <= 0.0 for q in dense[::every])


# the figures of the paper


def test_with_the_contact_kept_the_joint_ranges_are_those_of_the_paper():
    fixed = keep_contact(v_problem())
    middle_row = v_problem().points.pass_index == 2  # the paper ground one row
    ranges = np.ptp(fixed.q[middle_row], axis=0)
    np.testing.assert_allclose(ranges, PAPER_FIXED, atol=0.015)
    assert ranges.sum() == pytest.approx(6.31, abs=0.03)
    assert fixed.feasible
    np.testing.assert_array_equal(fixed.joint_ranges, np.ptp(fixed.q, axis=0))


def test_with_the_contact_kept_every_configuration_grinds_at_the_middle():
    problem, fixed = v_problem(), keep_contact(v_problem())
    Ts = forward_kinematics(problem.cell.robot, fixed.q) @ problem.cell.T_flange_workpiece
    Ts_base_cutter = Ts @ problem.points.Ts_workpiece_cutter
    middle = problem.cell.wheel.T_base_contact0
    np.testing.assert_allclose(Ts_base_cutter - middle, 0.0, atol=1e-9)


@pytest.mark.parametrize("start", list(Start))
def test_the_recursive_search_does_no_worse_than_the_paper(start):
    plan = v_plan() if start is Start.BEST else plan_recursive(v_problem(), start)
    assert plan.path.joint_range_sum <= PAPER_RECURSIVE
    q = plan.path.q
    assert (q >= v_job().cell.robot.lower).all()
    assert (q <= v_job().cell.robot.upper).all()


def test_the_v_motion_is_free_in_an_independent_scene():
    assert not hits_anything(v_job().cell, v_plan().motion, every=4)


def test_the_best_start_is_no_worse_than_the_nearest():
    nearest = plan_recursive(small_problem(), Start.NEAREST)
    assert small_plan().path.joint_range_sum <= nearest.path.joint_range_sum + 1e-9


def test_the_nearest_start_is_the_node_nearest_to_home():
    problem = small_problem()
    path = plan_recursive(problem, Start.NEAREST).path
    home = problem.process.home
    nearest = np.inf
    for nodes in problem.field.matrices:
        q = nodes.q[0][problem.free_nodes(nodes)[0]]
        if len(q):
            nearest = min(nearest, np.linalg.norm(q - home, axis=1).min())
    assert np.linalg.norm(path.q[0] - home) == pytest.approx(nearest)


def test_the_same_problem_gives_the_same_motion():
    again = plan_recursive(problem_of(small_job()))
    np.testing.assert_array_equal(again.motion.q, small_plan().motion.q)


# things in the way


@cache
def one_row_problem():
    job = small_job()
    job = with_positions(replace(job, passes=replace(job.passes, rows=1)), 15)
    return problem_of(job, points_of=slice(20, 40))


def by_printed_recursion(problem):
    """Return the node configurations that Algorithm 1 finds from the nearest start that leads
    through.

    Every step is filled in and asked about on its own, when the recursion comes to it.
    """
    home = problem.process.home
    fields = [(nodes, problem.free_nodes(nodes)) for nodes in problem.field.matrices]
    starts = sorted(
        (np.linalg.norm(nodes.q[0, row] - home), index, row)
        for index, (nodes, free) in enumerate(fields)
        for row in np.flatnonzero(free[0])
    )
    for _, index, row in starts:
        nodes, free = fields[index]
        known = {}

        def leads_on(column, here, there, nodes=nodes, free=free, known=known):
            key = (column, here, there)
            if key not in known:
                known[key] = step_is_free(problem, nodes, *key)
            return known[key]

        if problem.scene.collision.collides(nodes.q[0, row][None])[0]:
            continue
        rows = printed_recursion(nodes.q, free, leads_on, row)
        if rows is not None:
            return nodes.q[np.arange(len(rows)), rows]
    return None


def step_is_free(problem, nodes, column, here, there):
    rows = np.zeros(len(problem.points), dtype=int)
    pair = slice(column, column + 2)
    points = type(problem.points)(
        problem.points.Ts_workpiece_cutter[pair], np.zeros(2, dtype=int), np.array([0.0, 1.0])
    )
    cut = replace(nodes, configurations=Kept(nodes.q[pair]))
    rows = np.array([here, there])
    try:
        path = fill_in(problem.cell, points, cut, rows, problem.interpolation)
    except BrokenEdgesError:
        return False
    return not problem.scene.collision.collides(densify(path.q, RESOLUTION)[0]).any()


@pytest.mark.parametrize("seed", range(6))
def test_collisions_found_late_lead_to_the_track_of_the_printed_recursion(seed):
    problem = one_row_problem()
    free = plan_recursive(problem, Start.NEAREST).path
    # some nodes of the free track and some configurations between its nodes collide
    random = np.random.default_rng(seed)
    inner = np.flatnonzero((free.cutter_point > 3) & (free.cutter_point < 16))
    ghosts = Ghosts(free.q[random.choice(inner, 5, replace=False)], radius=0.02)
    haunted = with_scene(problem, collision=ghosts)
    wanted = by_printed_recursion(haunted)
    plan = plan_recursive(haunted, Start.NEAREST)
    assert plan.checks > 1
    at_node = plan.path.cutter_point % 1.0 == 0.0
    np.testing.assert_array_equal(plan.path.q[at_node], wanted)
    assert not ghosts.collides(densify(plan.motion.q, RESOLUTION)[0]).any()


def test_a_path_goes_round_an_obstacle():
    problem = small_problem()
    cell = with_obstacle(problem.cell, (0.58, 0.08, 0.24), (0.04, 0.04, 0.04))
    assert hits_anything(cell, small_motion(), every=3)
    plan = plan_recursive(with_problem_cell(problem, cell))
    assert plan.checks > 1
    assert not hits_anything(cell, plan.motion, every=3)


def test_a_search_ends_with_a_plan_or_without_proposals_or_with_its_budget_spent():
    problem = one_row_problem()
    found = try_recursive(problem, Start.NEAREST, most_checks=1)
    assert isinstance(found, Found) and found.plan.checks == 1
    shut = with_scene(problem, collision=Ghosts(np.zeros(6), radius=100.0))
    assert isinstance(try_recursive(shut, Start.NEAREST, most_checks=1), OutOfBudget)
    assert isinstance(try_recursive(shut, Start.NEAREST, most_checks=1000), Exhausted)


class GhostsOfPostures(Ghosts):
    """Ghosts of which no cell of postures is surely full."""

    def collides_throughout(self, q, turned):
        return np.zeros(len(q), dtype=bool)


def test_a_search_that_finds_nothing_in_its_work_says_so_and_ends(monkeypatch):
    monkeypatch.setattr(searches, "MOST_FIRST_CHECKS", 2)
    job = small_job()
    optimal = replace(job.search.optimal, max_subproblems=1)
    shut = with_scene(one_row_problem(), collision=GhostsOfPostures(np.zeros(6), radius=100.0))
    with pytest.raises(NoPathError, match="the 2 best motions of the recursive search") as caught:
        searches.search_path(replace(job.search, optimal=optimal), shut)
    least = caught.value.lower_bound
    assert 0.0 <= least <= plan_recursive(one_row_problem()).path.joint_range_sum
    assert f"below {least:.4f} rad" in str(caught.value)


def test_that_all_collides_is_proven_before_any_work_is_done(monkeypatch):
    monkeypatch.setattr(searches, "MOST_FIRST_CHECKS", 1)
    job = small_job()
    optimal = replace(job.search.optimal, max_subproblems=1)
    shut = with_scene(one_row_problem(), collision=Ghosts(np.zeros(6), radius=100.0))
    with pytest.raises(NoPathError, match="it is proven that no motion"):
        searches.search_path(replace(job.search, optimal=optimal), shut)


def test_a_motion_is_found_where_neither_the_recursive_search_nor_the_proof_has_one(monkeypatch):
    problem = one_row_problem()
    free = plan_recursive(problem).path
    ghosts = Ghosts(free.q[(free.cutter_point > 3) & (free.cutter_point < 16)], radius=0.02)
    haunted = with_scene(problem, collision=ghosts)
    monkeypatch.setattr(searches, "MOST_FIRST_CHECKS", 1)
    job = small_job()
    little = replace(job.search.optimal, max_subproblems=1)
    found = searches.search_path(replace(job.search, optimal=little), haunted)
    assert found.recursive is None
    assert not ghosts.collides(found.plan.motion.q).any()
    assert ghosts.collides(free.q).any()


def test_no_track_passes_a_contact_position_that_is_shut_on_the_way(monkeypatch):
    problem = one_row_problem()
    n, m = problem.wheel_distance.shape
    layer = problem.wheel_distance.copy()
    layer[:, m // 2] = -1.0
    # told to be shut at cutter points alone, it is open between them, where the part is measured
    assert (np.diff(problem.points.arc_length) > CLOSE).all()
    assert replace(problem, wheel_distance=layer).sides is None
    monkeypatch.setattr("opl.planning.shut_ways.MOST_PARTS", 1)
    monkeypatch.setattr("opl.planning.shut_ways.CLOSE_IN_BAND", 1.0)
    shut = replace(problem, wheel_distance=layer)
    matrices = open_matrices(shut)
    tracks = list(islice(tracks_from_best_start(matrices), 5))
    assert tracks
    for track in tracks:
        above = matrices[track.matrix].nodes.position_index[track.rows] > m // 2
        assert above.all() or not above.any()
    # where it is shut at one of two cutter points only, it can be passed between them
    every_other = np.where(np.arange(n)[:, None] % 2, problem.wheel_distance, layer)
    assert replace(problem, wheel_distance=every_other).sides is None
    grid = np.broadcast_to(problem.field.contact_positions, (n, m))
    free = ~shut.cuts
    sides = shut.sides_at(np.arange(float(n)), grid)
    np.testing.assert_array_equal(sides[:, 0][free[:-1]], shut.sides[:, 0][free[:-1]])
    np.testing.assert_array_equal(sides[:, 1][free[1:]], shut.sides[:, 1][free[1:]])


def test_another_scene_finds_free_moves_of_its_own():
    scene = small_problem().scene
    other = replace(scene, collision=Ghosts(np.zeros(6), radius=0.1))
    assert scene.free_moves is scene.free_moves
    assert other.free_moves is not scene.free_moves
    assert other.free_moves.scene is other.collision


def test_a_wall_at_the_wheel_is_named_with_the_points_it_shuts():
    problem = one_row_problem()
    # just in front of the wheel: wherever the part touches, it is in the wall
    p = problem.cell.wheel.T_base_contact0[:3, 3] - [0.02, 0.0, 0.0]
    walled = with_problem_cell(problem, with_obstacle(problem.cell, p, (0.01, 0.4, 0.4), "wall"))
    with pytest.raises(NoPathError) as caught:
        plan_recursive(walled)
    error = caught.value
    assert error.exit_status == 3
    assert error.message.startswith("no path")
    assert "cutter points 0 to 19 (pass 1): nothing is free" in error.reasons[0]
    assert "part hits wall" in error.reasons[0]
    assert str(error).splitlines() == [error.message, *error.reasons]


def test_a_way_that_only_ends_in_a_collision_is_named():
    problem = one_row_problem()
    home = problem.process.home
    ghosts = Ghosts(home + np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0]), radius=0.02)
    # home itself is in it, so is every way from and to home
    with pytest.raises(NoPathError, match=r"R_link and ghost"):
        plan_recursive(with_scene(problem, collision=ghosts))


def test_what_is_in_the_way_of_a_free_move_is_led_around():
    problem, plan = small_problem(), small_plan()
    n = len(plan.motion)
    links = [k for k in range(n) if plan.motion.kind[k] is MoveKind.LINK]
    assert len(links) == 1
    moves = [1, *links, n - 1]
    middles = np.array([(plan.motion.q[k - 1] + plan.motion.q[k]) / 2.0 for k in moves])
    ghosts = Ghosts(middles, radius=0.015)
    faults = colliding_moves(problem.cell, ghosts, problem.scene.part, plan.motion)
    assert [fault.move for fault in faults] == moves
    other = plan_recursive(with_scene(problem, collision=ghosts))
    assert other.checks == 1
    np.testing.assert_array_equal(other.path.q, plan.path.q)
    assert not ghosts.collides(densify(other.motion.q, RESOLUTION)[0]).any()
    along = [(s, p) for s, p in zip(other.motion.kind, other.motion.pass_index, strict=True)]
    # the configurations on the way are of the kind of the move that they are inserted into
    assert along.count((MoveKind.HOME, 0)) >= 2
    assert along.count((MoveKind.LINK, 1)) >= 2
    assert along.count((MoveKind.HOME, -1)) >= 3


def test_a_part_that_cannot_touch_without_being_cut_is_told_how_deep():
    problem = small_problem()
    layer = problem.wheel_distance.copy()
    layer[30:40] = -0.003
    layer[35, 4] = -0.0012
    with pytest.raises(NoPathError) as caught:
        plan_recursive(replace(problem, wheel_distance=layer))
    error = caught.value
    assert error.message == "no path beyond cutter point 29 (30 of 120 reached)"
    assert error.reasons[1:] == ("looked for at 60 contact positions, not between them",)
    assert error.reasons[0].startswith("cutter points 30 to 39 (pass 1): nothing is free: ")
    assert "part cuts into wheel" in error.reasons[0]
    assert error.reasons[0].endswith("the part cuts 1.20 mm into the wheel at best")


def test_points_beyond_the_limits_are_told_with_the_joint():
    problem = one_row_problem()
    robot = problem.cell.robot
    upper = robot.upper.copy()
    upper[1] = np.radians(-30.0)  # L bends forward at the wheel
    narrow = replace(problem.cell, robot=replace(robot, upper=upper))
    matrices = tuple(
        replace(nodes, configurations=Kept(np.where(within[..., None], nodes.q, np.nan)))
        for nodes in problem.field.matrices
        for within in [(nodes.q <= upper).all(axis=-1)]
    )
    field = replace(problem.field, matrices=matrices)
    changed = replace(with_scene(problem, cell=narrow), field=field)
    with pytest.raises(NoPathError, match="beyond the limits of L"):
        plan_recursive(changed)


def test_many_shut_runs_are_not_all_listed():
    problem = one_row_problem()
    layer = problem.wheel_distance.copy()
    layer[::2] = -1.0
    reasons = explain(replace(problem, wheel_distance=layer), [])
    assert len(reasons) == 9
    assert reasons[-1] == "and 2 more runs of cutter points"


def test_points_out_of_reach_are_found():
    problem = one_row_problem()
    reached = problem.field.reached.copy()
    reached[7] = 0
    reached[8, :5] = 0  # reached by others
    found = unreachable_points(replace(problem, field=replace(problem.field, reached=reached)))
    assert found.tolist() == [7]


def test_a_fixed_contact_that_cuts_is_told():
    # the part is larger than its surface by 1 mm
    problem = small_problem()
    part = problem.scene.part
    larger = replace(part, triangles=part.triangles * 1.01, spheres=part.spheres * 1.01)
    fixed = keep_contact(with_scene(problem, part=larger))
    assert not fixed.feasible
    assert fixed.reason.startswith("part cuts into wheel at 120 of 120 cutter points (0-119), ")
    assert fixed.reason.endswith(" mm deep at most")
    assert len(fixed.q) == 120


@pytest.mark.parametrize(
    ("numbers", "told"),
    [([3], "3"), ([3, 4, 5], "3-5"), ([1, 3, 4, 9], "1, 3-4, 9")],
)
def test_runs_are_written_short(numbers, told):
    assert runs_of(np.array(numbers)) == told


# what each node is


def test_states_say_what_rules_a_node_out():
    problem = one_row_problem()
    codes = {state: code for code, state in enumerate(NodeState)}
    branch = small_plan().path.ik_branches[0]
    layer = problem.wheel_distance.copy()
    layer[5, 3] = -0.1
    angles = problem.field.angles[branch].copy()
    angles[6, 4] = np.nan
    angles = {**problem.field.angles, branch: angles}
    nodes = next(n for n in problem.field.matrices if n.ik_branch[0] == branch and n.exists.any())
    column, row = np.argwhere(nodes.exists)[len(np.argwhere(nodes.exists)) // 2]
    ghost = Ghosts(nodes.q[column, row], 1e-3, haunted=problem.scene.collision)
    haunted = with_scene(problem, collision=ghost)
    changed = replace(haunted, wheel_distance=layer, field=replace(problem.field, angles=angles))
    states = survey_nodes(changed, branch, np.zeros(6)).states
    assert states.shape == layer.shape
    assert states[5, 3] == codes[NodeState.WHEEL]
    assert states[6, 4] == codes[NodeState.REACH]
    assert (states == codes[NodeState.FREE]).any()


# the motion around the path


MOTIONS = pytest.mark.parametrize(
    ("problem", "timed"),
    [(small_problem, small_timed), (v_problem, v_timed)],
    ids=["small", "V"],
)


@MOTIONS
def test_a_motion_starts_and_ends_at_home(problem, timed):
    motion = timed().motion
    np.testing.assert_array_equal(motion.q[[0, -1]], np.array([problem().process.home] * 2))
    assert motion.kind[0] is motion.kind[-1] is MoveKind.HOME


@MOTIONS
def test_a_pass_is_approached_ground_and_left(problem, timed):
    order = []
    for kind in timed().motion.kind:
        kind = MoveKind.GRIND if kind is MoveKind.BETWEEN else kind
        if order[-1:] != [kind]:
            order.append(kind)
    one = [MoveKind.APPROACH, MoveKind.GRIND, MoveKind.RETRACT]
    n = problem().points.n_passes
    assert order == [MoveKind.HOME, *([*one, MoveKind.LINK] * n)[:-1], MoveKind.HOME]


@MOTIONS
def test_the_path_is_in_the_motion_as_it_is(problem, timed):
    plan = small_plan() if problem is small_problem else v_plan()
    motion = timed().motion
    on_wheel = ~np.isnan(motion.cutter_point)
    np.testing.assert_array_equal(motion.q[on_wheel], plan.path.q)
    np.testing.assert_array_equal(motion.contact_position[on_wheel], plan.path.contact_position)


@MOTIONS
def test_approach_and_retract_move_on_along_the_pass_and_off_the_wheel(problem, timed):
    cell, motion, process = problem().cell, timed().motion, problem().process
    kinds = np.array([kind.value for kind in motion.kind])
    for index in range(problem().points.n_passes):
        on_pass = motion.pass_index == index
        on_wheel = np.flatnonzero(on_pass & ~np.isnan(motion.cutter_point))
        at = problem().points.Ts_workpiece_cutter[problem().points.pass_index == index, :3, 3]
        T = problem().points.Ts_workpiece_cutter[problem().points.pass_index == index]
        for kind, touch, end, ahead in (
            ("approach", on_wheel[0], 0, at[1] - at[0]),
            ("retract", on_wheel[-1], -1, at[-1] - at[-2]),
        ):
            lead = np.flatnonzero(on_pass & (kinds == kind))
            if kind == "approach":  # the free move ends at its start
                lead = np.concatenate([[lead[0] - 1], lead])[::-1]
            Ts = forward_kinematics(cell.robot, motion.q[np.insert(lead, 0, touch)])
            T_base_contact = cell.wheel.T_base_contact(motion.contact_position[touch])
            away = (Ts[:, :3, 3] - Ts[0, :3, 3]) @ T_base_contact[:3, :3]
            np.testing.assert_allclose(Ts[:, :3, :3], Ts[[0] * len(Ts), :3, :3], atol=1e-9)
            np.testing.assert_allclose(away[:, 1], 0.0, atol=1e-9)
            assert -away[-1, 2] == pytest.approx(process.approach_length)
            # what comes next on the part comes to the wheel when the part moves the other way
            along = np.sign(ahead @ T[end, :3, 0]) * (1.0 if kind == "approach" else -1.0)
            on, off, run = along * away[:, 0], -away[:, 2], process.approach_run
            assert (np.diff(on) >= -1e-12).all() and (np.diff(off) > 0.0).all()
            circle = run - np.sqrt(np.maximum(run**2 - on**2, 0.0))
            np.testing.assert_allclose(off[off < run], circle[off < run], atol=1e-9)
            assert on[-1] == pytest.approx(run)


@MOTIONS
def test_the_last_move_of_an_approach_touches(problem, timed):
    motion = timed().motion
    for k, kind in enumerate(motion.kind):
        if kind is MoveKind.APPROACH and motion.kind[k + 1] is not MoveKind.APPROACH:
            assert motion.kind[k + 1] is MoveKind.GRIND
            assert motion.cutter_point[k + 1] % 1.0 == 0.0


@MOTIONS
def test_no_joint_is_asked_for_more_than_its_speed(problem, timed):
    motion, duration = timed().motion, timed().duration
    speed = np.abs(np.diff(motion.q, axis=0)) / duration[1:, None]
    assert (speed <= problem().cell.robot.max_speed * (1 + 1e-9)).all()
    assert duration[0] == 0.0
    assert (duration[1:] > 0.0).all()


@MOTIONS
def test_the_feed_is_kept_on_the_wheel_unless_a_joint_could_not_follow(problem, timed):
    process, points = problem().process, problem().points
    # what slow acceleration does to the feed is told in test_timing.py
    robot = replace(problem().cell.robot, max_acceleration=np.full(6, 1e6))
    motion = timed().motion
    timing = time_motion(motion, points, process, robot)
    duration, evened = timing.timed.duration, 0
    fastest = robot.max_speed
    arc_length = problem().points.arc_length
    arc = np.interp(motion.cutter_point, np.arange(len(arc_length)), arc_length)
    checked = 0
    for k in range(1, len(motion)):
        on_wheel = not np.isnan(motion.cutter_point[[k - 1, k]]).any()
        if on_wheel:
            needed = abs(arc[k] - arc[k - 1]) / process.feed
            least = (np.abs(motion.q[k] - motion.q[k - 1]) / fastest).max()
            t = motion.contact_position
            over_wheel = abs(t[k] - t[k - 1]) / process.contact_speed
            wanted = max(needed, least, over_wheel)
            assert duration[k] >= wanted * (1.0 - 1e-6)
            if duration[k] > wanted * 1.011:
                assert timing.cause[k] is Cause.NEIGHBOUR
                evened += 1
            checked += 1
    assert checked > 100 and evened < checked / 8


@MOTIONS
def test_free_moves_run_at_their_share_of_the_joint_speeds(problem, timed):
    motion, duration, process = timed().motion, timed().duration, problem().process
    for k, kind in enumerate(motion.kind):
        if k and kind in (MoveKind.HOME, MoveKind.LINK):
            speed = np.abs(motion.q[k] - motion.q[k - 1]) / duration[k]
            share = (speed / problem().cell.robot.max_speed).max()
            if duration[k] > 0.05:  # a shorter one is over before a robot is at its speed
                assert share == pytest.approx(process.air_speed)
            else:
                assert duration[k] == 0.05 and share < process.air_speed


def test_a_slow_robot_takes_the_time_it_needs():
    problem, plan = small_problem(), small_plan()
    robot = replace(problem.cell.robot, max_speed=np.full(6, 0.01))
    slow = time_motion(plan.motion, problem.points, problem.process, robot).timed
    speed = np.abs(np.diff(plan.motion.q, axis=0)) / slow.duration[1:, None]
    assert speed.max() == pytest.approx(0.01)


def test_a_retract_beyond_a_limit_is_refused():
    problem, plan = small_problem(), small_plan()
    leads = [k for k, s in enumerate(plan.motion.kind) if s is MoveKind.RETRACT]
    last = plan.motion.q[leads[-1]]
    robot, joint = problem.cell.robot, 2
    # only the limits of the leads are looked at here: nodes beyond them were never made
    lower = robot.lower.copy()
    lower[joint] = last[joint] + 1e-6
    cell = replace(problem.cell, robot=replace(robot, lower=lower))
    with pytest.raises(UnreachableApproachError) as caught:
        whole_motion(cell, problem.points, plan.path, problem.process)
    assert caught.value.cause == "limits of U"


def test_an_approach_from_out_of_reach_is_refused():
    problem, plan = small_problem(), small_plan()
    process = replace(problem.process, approach_length=5.0)
    with pytest.raises(UnreachableApproachError, match="approach to cutter point 0: reach"):
        whole_motion(problem.cell, problem.points, plan.path, process)


def test_work_on_proposals_counts_where_none_is_made():
    problem = small_problem()
    matrices, pauses = open_matrices(problem), [Pause(10.0)] * 5
    assert propose_and_check(problem, matrices, pauses, most_work=25.0) == OutOfBudget(0, matrices)
    assert isinstance(propose_and_check(problem, matrices, pauses, most_work=51.0), Exhausted)
    track = next(tracks_from_best_start(matrices))
    found = propose_and_check(problem, matrices, [Pause(10.0), track], most_work=25.0)
    assert isinstance(found, Found)
