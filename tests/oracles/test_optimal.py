"""The certified method on real cells: value, bound and motion, against searches of other kinds."""

from dataclasses import replace
from functools import cache
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from opl.cell.collision import CollisionScene
from opl.cell.full_turns import full_turns
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.job.load import load_job
from opl.least.least_cost import least_cost
from opl.least.least_range import NoMotionError, plan_optimal
from opl.least.optimal import OptimalSearch
from opl.least.weighted import plan_weighted
from opl.motion.collision_check import colliding_moves
from opl.motion.figures import figures_of_path
from opl.motion.free_leads import FreeLeads
from opl.motion.free_move_search import FreeMoveSearch
from opl.motion.joint_lines import RESOLUTION, densify
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import PassEnd
from opl.motion.whole_motion import UnreachableApproachError
from opl.planning import plan as plan_module
from opl.planning.depths import nearer_nodes
from opl.planning.multi_start import plan_recursive
from opl.planning.settings import ObjectiveWeights
from opl.planning.so_far import ENDED
from opl.planning.track_check import NoMotion
from opl.verification.replay import replay
from opl.walls.columns import ColumnWalls
from opl.walls.images import Images, seams_of
from opl.walls.obstructed import Obstructions
from opl.walls.shut_leads import ShutLeads
from tests.support.bare_cells import Ghosts
from tests.support.fcl_scene import FclScene
from tests.support.jobs import opl, write_job, write_trough
from tests.support.planned import (
    problem_of,
    small_job,
    timed,
    v_job,
    with_positions,
    with_problem_cell,
    with_scene,
)

SETTINGS = v_job().search.optimal
ONLY_TRAVEL = ObjectiveWeights(joint_range=0.0, travel=1.0, time=0.0)
ONLY_TIME = ObjectiveWeights(joint_range=0.0, travel=0.0, time=1.0)


def one_row_job():
    return replace(small_job(), passes=replace(small_job().passes, rows=1))


@cache
def one_row():
    """Return one pass over the tip of the V part, 20 cutter points at 40 contact positions."""
    return problem_of(with_positions(one_row_job(), 40), slice(20, 40))


@cache
def v_row():
    """Return the middle row of the V part as it is: 60 cutter points at 140 contact positions."""
    return problem_of(replace(v_job(), passes=replace(v_job().passes, rows=1)))


@cache
def two_rows():
    """Return the end of one pass and the beginning of the next."""
    return problem_of(with_positions(small_job(), 40), slice(50, 70))


@cache
def recursive(make):
    return plan_recursive(make())


@cache
def optimal(make):
    return plan_optimal(make(), SETTINGS, recursive(make))


def on_wheel(motion):
    return motion.q[~np.isnan(motion.cutter_point)]


def free_tracks(problem):
    """Yield (q at each cutter point, t at each) of every continuous track of a tiny field."""
    rule = problem.interpolation
    for nodes in problem.field.matrices:
        free = problem.free_nodes(nodes)
        for rows in product(*(np.flatnonzero(column) for column in free)):
            q = nodes.q[np.arange(len(rows)), list(rows)]
            t = nodes.contact_position[0, list(rows)]
            moves = np.maximum(np.ceil(np.abs(np.diff(t)) / rule.max_contact_step - 1e-9), 1.0)
            turned = np.abs(np.diff(q, axis=0)).max(axis=1)
            if (turned <= rule.max_joint_step * moves).all():
                yield q, t


CELLS = pytest.mark.parametrize("make", [v_row, two_rows], ids=["V row", "two rows"])


@CELLS
def test_the_motion_attains_the_value_and_the_bound_lies_below_it(make):
    plan = optimal(make)
    value = np.ptp(on_wheel(plan.motion), axis=0).sum()
    assert plan.path.joint_range_sum == pytest.approx(value, abs=1e-12)
    assert value <= recursive(make).path.joint_range_sum
    assert 0.0 < plan.lower_bound <= plan.path.joint_range_sum
    assert plan.gap == pytest.approx(1.0 - plan.lower_bound / plan.path.joint_range_sum)


@CELLS
def test_every_cutter_point_is_ground_where_the_path_says(make):
    problem, plan = make(), optimal(make)
    whole = plan.path.cutter_point % 1.0 == 0.0
    np.testing.assert_array_equal(plan.path.cutter_point[whole], np.arange(len(problem.points)))
    np.testing.assert_array_equal(plan.path.pass_index[whole], problem.points.pass_index)


def test_a_row_of_the_v_part_is_within_a_thousandth_of_the_least_there_is():
    found, other = optimal(v_row).path, recursive(v_row).path
    assert found.joint_range_sum <= 1.895
    assert optimal(v_row).gap <= 1e-3
    assert found.joint_travel <= other.joint_travel
    assert found.contact_travel <= 1.01 * other.contact_travel


def test_the_motion_is_free_in_two_other_scenes():
    problem, plan = two_rows(), optimal(two_rows)
    scene = FclScene(problem.cell)
    dense, _ = densify(plan.motion.q, RESOLUTION)
    assert all(min(scene.clearances(q).values(), default=1.0) > 0.0 for q in dense[::4])
    allowed = small_job().search.max_contact_error
    verification = replay(problem.cell, problem.points, timed(problem, plan.motion), allowed)
    assert verification.verified is not None, verification.findings


def test_the_same_problem_gives_the_same_bytes():
    problem = problem_of(with_positions(one_row_job(), 40), slice(20, 40))
    again = plan_optimal(problem, SETTINGS, plan_recursive(problem))
    assert again.motion.q.tobytes() == optimal(one_row).motion.q.tobytes()
    assert again.lower_bound == optimal(one_row).lower_bound


@pytest.mark.parametrize("first", [22, 36, 57])
def test_the_bound_of_a_tiny_field_is_the_least_sum_of_all_its_tracks_as_t_becomes_finer(first):
    coarse, fine = (
        problem_of(with_positions(small_job(), count), slice(first, first + 4)) for count in (7, 41)
    )
    plan = plan_optimal(coarse, SETTINGS, plan_recursive(coarse))
    q, free = fine.solutions(np.arange(len(fine.points))), ~fine.cuts
    least = least_range_sum(fine, q, free)
    assert plan.lower_bound <= least + 1e-12
    assert plan.lower_bound <= plan.path.joint_range_sum <= least * (1.0 + SETTINGS.widen)
    assert plan.gap <= 0.1  # of a hundredth of a radian


def least_range_sum(problem, q, free):
    """Return the least sum of the tracks of a field of four columns that jump as they like."""
    within = problem.cell.within_limits(q) & free[:, :, None]
    best = np.inf
    for branch in range(8):
        nodes = [q[column, within[column, :, branch], branch] for column in range(len(q))]
        if any(len(column) == 0 for column in nodes):
            continue
        a, b = nodes[0][:, None], nodes[1][None]
        low, high = np.minimum(a, b).reshape(-1, 6), np.maximum(a, b).reshape(-1, 6)
        for point in nodes[2]:
            low3, high3 = np.minimum(low, point), np.maximum(high, point)
            kept = (high3 - low3).sum(axis=1) < best
            for last in nodes[3]:
                sums = np.maximum(high3[kept], last) - np.minimum(low3[kept], last)
                best = min(best, float(sums.sum(axis=1).min(initial=np.inf)))
    return best


def test_what_collides_is_avoided_and_the_bound_still_holds():
    problem, free = one_row(), optimal(one_row)
    inner = free.path.q[(free.path.cutter_point > 5) & (free.path.cutter_point < 15)]
    ghosts = Ghosts(inner[:: len(inner) // 4], radius=0.02)
    haunted = with_scene(problem, collision=ghosts)
    plan = plan_optimal(haunted, SETTINGS, plan_recursive(haunted))
    assert not ghosts.collides(densify(plan.motion.q, RESOLUTION)[0]).any()
    assert plan.lower_bound <= plan.path.joint_range_sum
    assert plan.lower_bound <= free.path.joint_range_sum  # what collides is not in the bound


def test_an_interrupted_search_returns_what_there_was_and_a_bound_that_holds():
    problem = one_row()
    plan = plan_optimal(problem, replace(SETTINGS, max_subproblems=1), recursive(one_row))
    assert plan.motion is recursive(one_row).motion
    assert 0.0 <= plan.lower_bound <= optimal(one_row).lower_bound + 1e-12


def test_a_search_can_be_stopped_after_every_step():
    def follow(so_far):
        assert 0.0 <= so_far.done <= 1.0
        assert so_far.lower_bound <= optimal(one_row).path.joint_range_sum <= so_far.value
        seen.append(so_far)
        if len(seen) == 3:
            raise InterruptedError
        return True

    seen = []
    with pytest.raises(InterruptedError):
        plan_optimal(one_row(), SETTINGS, recursive(one_row), follow)
    for name in ("done", "lower_bound"):
        values = [getattr(one, name) for one in seen]
        assert values == sorted(values)


def test_a_search_that_is_ended_has_its_best_motion_and_the_bound_of_that_moment():
    def follow(so_far):
        seen.append(so_far)
        return len(seen) < 3

    seen = []
    plan = plan_optimal(one_row(), SETTINGS, recursive(one_row), follow)
    assert len(seen) == 3
    assert plan.path.joint_range_sum == seen[-1].value
    assert plan.lower_bound == seen[-1].lower_bound <= optimal(one_row).path.joint_range_sum
    assert plan.open_because == ENDED


def test_what_was_proven_at_any_moment_is_in_the_bound():
    seen = []
    plan = plan_optimal(
        one_row(), SETTINGS, recursive(one_row), lambda one: seen.append(one) or True
    )
    bounds = [one.lower_bound for one in seen]
    assert bounds == sorted(bounds) and plan.lower_bound == bounds[-1]
    assert bounds[-1] > plan.path.joint_range_sum * (1.0 - SETTINGS.gap)  # it was looked for less


def test_a_search_without_a_motion_is_not_ended_before_it_has_one():
    seen = []
    plan = plan_optimal(one_row(), SETTINGS, None, lambda so_far: seen.append(so_far))
    assert [one.value for one in seen[:-1]] == [None] * (len(seen) - 1)
    assert plan.path.joint_range_sum == seen[-1].value


@pytest.mark.parametrize("weights", [ONLY_TRAVEL, ObjectiveWeights(1.0, 0.3, 0.01)])
def test_what_is_known_of_another_objective_is_true_at_any_moment(weights):
    def follow(so_far):
        seen.append(so_far)
        return len(seen) < most

    known, seen, most = [optimal(one_row), recursive(one_row)], [], np.inf
    best = plan_weighted(one_row(), weights, SETTINGS.costs, known, follow).objective
    for name, sign in (("done", 1.0), ("lower_bound", 1.0), ("value", -1.0)):
        values = [sign * getattr(one, name) for one in seen]
        assert values == sorted(values)
    assert all(one.lower_bound <= best.value for one in seen)
    assert seen[-1].value == best.value and len(seen) > 4
    for most in (1, len(seen) // 2):
        seen = []
        plan = plan_weighted(one_row(), weights, SETTINGS.costs, known, follow)
        assert plan.objective.value == seen[-1].value and len(seen) == most
        assert plan.objective.lower_bound == pytest.approx(seen[-1].lower_bound)
        assert plan.open_because == ENDED


@pytest.mark.parametrize("untried", [False, True])
def test_without_a_motion_that_is_known_the_proof_finds_one(untried):
    search = OptimalSearch(one_row(), SETTINGS, None, untried=untried)
    assert (search.forbidden is None) == untried  # else those tried would have collided
    plan = plan_optimal(one_row(), SETTINGS, None, untried=untried)
    assert plan.gap <= SETTINGS.widen
    assert plan.lower_bound <= optimal(one_row).path.joint_range_sum


def test_collisions_are_minded_once_the_first_track_collides_before_any_motion_is_made():
    everywhere = Ghosts(np.zeros(6), radius=1e3)
    search = OptimalSearch(
        with_scene(one_row(), collision=everywhere), SETTINGS, None, untried=True
    )
    while search.forbidden is None:
        assert not search.finished
        search.step()
    assert search.motions.collided > 0
    assert search.motions.stopped.total() == 0  # of motions that were checked


def test_where_the_work_is_done_a_motion_of_whatever_size_is_found_below_no_bound():
    plan = plan_optimal(one_row(), replace(SETTINGS, max_subproblems=1), None)
    assert plan.path.joint_range_sum > optimal(one_row).path.joint_range_sum
    assert 0.0 <= plan.lower_bound <= optimal(one_row).path.joint_range_sum
    assert plan.open_because == "the work allowed for the proof was done before it was complete"
    scene = FclScene(one_row().cell)
    dense, _ = densify(plan.motion.q, RESOLUTION)
    assert all(min(scene.clearances(q).values()) > 0.0 for q in dense[::3])


def test_why_nothing_nearer_to_the_bound_was_found_names_what_stopped_motions(monkeypatch):
    def check_track(problem, nodes, rows):
        column = 0 if len(asked) % 3 == 0 else len(rows) - 1
        asked.append(column)
        return NoMotion(UnreachableApproachError(column, "limits of U"))

    asked = []
    known = recursive(one_row)  # before nothing is free any more
    monkeypatch.setattr(plan_module, "check_track", check_track)
    plan = plan_optimal(one_row(), SETTINGS, known)
    assert plan.path is known.path and asked
    assert plan.open_because == (
        "no motion was found nearer to the bound; those tried last were stopped above all at "
        "cutter point 19: approach: limits of U"
    )


def test_what_is_left_out_of_a_wall_collides_all_over():
    problem = one_row()
    cell = problem.cell
    images = Images(cell.robot, seams_of(problem.solutions(np.arange(len(problem.points)))), 10.0)
    walls = ColumnWalls(cell, problem.scene.part, problem.points, images)
    wall = walls.columns([7.0])[0]
    narrow = with_problem_cell(problem, cell.widened(0.036))
    obstructions = Obstructions(narrow, ShutLeads(problem), walls)
    T_workpiece_cutter = problem.points.Ts_workpiece_cutter[7]
    left_out, kept = [], 0
    for piece in wall.pieces:
        t = np.linspace(piece.at[0], piece.at[-1], 400)
        q = inverse_kinematics(cell.robot.arm, cell.Ts_base_flange(t, T_workpiece_cutter))
        for flip, branch in enumerate((piece.family, piece.family + 4)):
            for looks in (1, 2, 3):
                low, high = obstructions.clear(piece, flip, 0, len(piece.pad_low), looks)
            step = np.diff(piece.at)
            ends = piece.at[:-1] + low * step, piece.at[:-1] + high * step
            inside = np.zeros(len(t), dtype=bool)
            for begin, end in zip(*ends, strict=True):
                inside |= (t >= begin) & (t <= end)
            left_out.append(q[~inside, branch])
            kept += int(inside.sum())
    left_out = np.concatenate(left_out)
    assert kept > 50 and len(left_out) > 100
    assert narrow.scene.collision.collides(left_out).all()


def test_what_is_left_out_of_a_wall_on_a_closer_look_is_too_deep_in_the_wheel(tmp_path):
    problem = problem_of(load_job(write_trough(tmp_path, width_mm=80.0, depth_mm=5.0)))
    cell, place, n = problem.cell, 1.0, len(problem.points)
    points = problem.points.at_places(np.array([place]))
    images = Images(cell.robot, seams_of(problem.solutions(np.arange(n))), 10.0)
    # walls of a belt into which the part may sink as deep as it likes
    soft = replace(cell, max_belt_penetration=0.02)
    walls = ColumnWalls(soft, problem.scene.part, problem.points, images)
    obstructions = Obstructions(problem, ShutLeads(problem), walls)
    left_out, left = np.zeros(3), np.zeros(3)
    for piece in walls.columns([place])[0].pieces:
        t = np.linspace(piece.at[0], piece.at[-1], 5000)
        deep = nearer_nodes(problem.scene, points, t[None], np.ones((1, len(t)), dtype=bool))[0]
        cells = np.minimum(np.searchsorted(piece.at, t, side="right") - 1, len(piece.pad_low) - 1)
        share = (t - piece.at[cells]) / np.diff(piece.at)[cells]
        for looks in (1, 2, 3):
            low, high = obstructions.clear(piece, 0, 0, len(piece.pad_low), looks)
            inside = (share >= low[cells]) & (share <= high[cells])
            assert deep[~inside].all()
            left_out[looks - 1] += np.count_nonzero(~inside)
            left[looks - 1] += np.count_nonzero(inside & deep)
    # the first look does not ask about the wheel, the others leave hardly anything that is too deep
    assert left_out[0] == 0 and left[0] > 1000
    assert left[2] <= left[1] < 0.01 * left[0]


def in_a_narrow_cell(problem):
    """Everything must stay far apart: leads collide."""
    cell = problem.cell.widened(0.03)
    return with_scene(problem, cell=cell, collision=CollisionScene(cell).for_second_opinion())


def with_a_lazy_elbow(problem):
    """Joint 3 comes to its limit on the way off the wheel for some contact positions."""
    cell = problem.cell
    q = problem.solutions(np.arange(len(problem.points)))[:, :, :4, 2]
    upper = cell.robot.upper.copy()
    upper[2] = np.nanquantile(q, 0.6)
    cell = replace(cell, robot=replace(cell.robot, upper=upper))
    return with_scene(problem, cell=cell)


def at_the_end_of_reach(problem):
    """The wheel stands where the arm reaches it at some contact positions only."""
    cell = problem.cell
    T_base_contact0 = cell.wheel.T_base_contact0.copy()
    T_base_contact0[:3, 3] += [0.83, -0.24, 0.56]
    wheel = replace(cell.wheel, T_base_contact0=T_base_contact0)
    robot = replace(cell.robot, lower=np.full(6, -4.0), upper=np.full(6, 4.0))
    return with_scene(problem, cell=replace(cell, wheel=wheel, robot=robot))


@pytest.mark.parametrize("changed", [in_a_narrow_cell, with_a_lazy_elbow, at_the_end_of_reach])
def test_no_lead_is_free_where_it_is_surely_shut(changed):
    problem = changed(one_row())
    cell, points, random = problem.cell, problem.points, np.random.default_rng(3)
    scene = problem.scene
    free_moves = FreeMoveSearch(cell, scene.collision, scene.part)
    leads = FreeLeads(cell, scene.collision, scene.part, free_moves)
    shut_leads = ShutLeads(problem)
    images = Images(cell.robot, seams_of(problem.solutions(np.arange(len(points)))), 10.0)
    walls = ColumnWalls(cell, scene.part, points, images)
    shut, asked, all_cells = 0, 0, 0
    for kind, column in ((MoveKind.APPROACH, 0), (MoveKind.RETRACT, len(points) - 1)):
        (wall,) = walls.columns([float(column)])
        for piece, flip in product(wall.pieces, range(2)):
            corners = np.arange(len(piece.at))
            at = np.interp(np.linspace(0.0, corners[-1], 8 * corners[-1] + 1), corners, piece.at)
            surely, near = shut_leads.surely(
                piece.line.T_workpiece_cutter, piece.family, flip, at[:-1], at[1:]
            )
            assert not (surely & ~near).any()
            all_cells += len(surely)
            branch = piece.family + 4 * flip
            shut += np.count_nonzero(surely)
            for k in random.permutation(np.flatnonzero(surely))[:5]:
                t = random.uniform(at[k], at[k + 1])
                Ts = cell.Ts_base_flange(t, points.Ts_workpiece_cutter[column])
                q = inverse_kinematics(cell.robot.arm, Ts)[branch]
                for turns in full_turns(cell.robot.lower, cell.robot.upper):
                    if not cell.within_limits((q + turns)[None])[0]:
                        continue
                    asked += 1
                    end = PassEnd(kind, branch, column, t, q + turns)
                    try:
                        found = leads.find(points, problem.process, end)
                    except UnreachableApproachError:
                        continue
                    motion = Motion.off_wheel(np.vstack([end.q, found]), kind, 0)
                    faults = colliding_moves(cell, scene.collision, scene.part, motion)
                    assert faults or free_moves.blocked_at(found[-1]) is not None
    assert shut > 10
    assert asked > 5
    assert shut < 0.8 * all_cells


def test_leads_that_leave_the_reach_at_once_are_shut_up_to_its_end():
    problem = at_the_end_of_reach(one_row())
    cell, points, scene = problem.cell, problem.points, problem.scene
    free_moves = FreeMoveSearch(cell, scene.collision, scene.part)
    leads = FreeLeads(cell, scene.collision, scene.part, free_moves)
    shut_leads = ShutLeads(problem)
    t = np.linspace(-cell.wheel.last_position, cell.wheel.last_position, 4000)
    asked = 0
    for kind, column in ((MoveKind.APPROACH, 0), (MoveKind.RETRACT, len(points) - 1)):
        T_workpiece_cutter = points.Ts_workpiece_cutter[column]
        q = inverse_kinematics(cell.robot.arm, cell.Ts_base_flange(t, T_workpiece_cutter))
        for branch in range(4):
            reached = ~np.isnan(q[:, branch, 0])
            for k in np.flatnonzero(reached[1:] != reached[:-1]):
                last = k if reached[k] else k + 1
                end = PassEnd(kind, branch, column, t[last], q[last, branch])
                try:
                    leads.find(points, problem.process, end)
                except UnreachableApproachError:
                    asked += 1
                    assert shut_leads.at(T_workpiece_cutter, branch, 0, t[[last]]).all()
    assert asked > 3


def test_leads_are_looked_at_where_they_are_asked_about_and_are_the_same_in_any_order():
    problem = in_a_narrow_cell(one_row())
    T = problem.points.Ts_workpiece_cutter[0]
    last = problem.cell.wheel.last_position
    t = np.concatenate([np.linspace(-last, last, 801), problem.field.contact_positions])
    at_once = ShutLeads(problem)
    wanted = [at_once.at(T, branch, 0, t) for branch in range(4)]
    assert any(shut.any() and not shut.all() for shut in wanted)
    in_groups = ShutLeads(problem)
    for group in np.array_split(np.random.default_rng(7).permutation(len(t)), 60):
        for branch in range(4):
            assert (in_groups.at(T, branch, 0, t[group]) == wanted[branch][group]).all()
    few = ShutLeads(problem)
    few.at(T, 0, 0, t[400:403])
    assert 0.0 < few.work < 0.1 * at_once.work


def test_every_motion_crosses_a_chain_within_the_pads_of_its_pieces():
    problem = one_row()
    cell, points = problem.cell, problem.points
    images = Images(cell.robot, seams_of(problem.solutions(np.arange(len(problem.points)))), 10.0)
    last = cell.wheel.last_position
    chain = ((5.0, -last), (5.0, -20.3), (7.4, -20.3), (7.4, 12.0), (6.0, 12.0), (6.0, 3.0))
    chain = (*chain, (6.6, 3.0), (6.6, last))
    (wall,) = ColumnWalls(cell, problem.scene.part, points, images).walls([chain])
    random, held = np.random.default_rng(5), 0
    for _ in range(60):
        # on along the pass, never back
        place, t = np.sort(random.uniform(4.0, 9.0, 6)), random.uniform(-last, last, 6)
        place[0], place[-1] = 4.0, 9.0
        crossings = []
        for (one, low), (other, top) in pairwise(chain):
            if one == other and top > low:
                there = float(np.interp(one, place, t))
                crossings += [(one, there)] if low <= there <= top else []
            elif low == top:
                for a, b in pairwise(zip(place, t, strict=True)):
                    if min(a[1], b[1]) <= low <= max(a[1], b[1]):
                        at = a[0] + (b[0] - a[0]) * (low - a[1]) / (b[1] - a[1])
                        crossings += [(at, low)] if min(one, other) <= at <= max(one, other) else []
        assert crossings
        for at, there in crossings:
            T = points.frames_at(np.array([at]))
            q = inverse_kinematics(cell.robot.arm, cell.Ts_base_flange(np.array([there]), T))[0]
            for piece in wall.pieces:
                row = piece.line.T_workpiece_cutter is None
                own = piece.line.contact_position == there if row else True
                own &= row or np.allclose(piece.line.T_workpiece_cutter, T[0], atol=1e-12)
                along = at if row else there
                if not own or not piece.at[0] <= along <= piece.at[-1]:
                    continue
                k = min(int(np.searchsorted(piece.at, along, side="right")) - 1, len(piece.low) - 1)
                middle = (piece.low[k] + piece.high[k]) / 2.0
                away = q[piece.family] - middle
                away -= 2.0 * np.pi * np.round(away / (2.0 * np.pi))
                assert (np.abs(away) <= (piece.high[k] - piece.low[k]) / 2.0 + 1e-12).all()
                held += 1
    assert held > 40


def test_an_interrupted_proof_still_leaves_a_verified_program(tmp_path):
    job = write_job(tmp_path / "job", {"search.max_subproblems": 1})
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "0 collisions" in ended.out
    assert "no motion along these passes has a joint range sum below" in ended.out
    assert (tmp_path / "out" / "V_SHAPE.JBI").is_file()


# least travel, least time


def shortest(problem, price):
    """Return the least price of all tracks of a field, by scipy, every step an edge.

    Args:
        problem: The problem.
        price: price(q_here, q_there, t_here, t_there, column) of a step on the wheel.
    """
    rule = problem.interpolation
    best = np.inf
    for nodes in problem.field.matrices:
        free, (n, m) = problem.free_nodes(nodes), nodes.q.shape[:2]
        tails, heads, prices = [], [], []
        for column in range(n - 1):
            here, there = np.flatnonzero(free[column]), np.flatnonzero(free[column + 1])
            a, b = (grid.ravel() for grid in np.meshgrid(here, there, indexing="ij"))
            q_a, q_b = nodes.q[column, a], nodes.q[column + 1, b]
            t_a, t_b = nodes.contact_position[0, a], nodes.contact_position[0, b]
            moves = np.maximum(np.ceil(np.abs(t_b - t_a) / rule.max_contact_step - 1e-9), 1.0)
            small = np.abs(q_b - q_a).max(axis=1) <= rule.max_joint_step * moves
            tails.append((column * m + a)[small])
            heads.append(((column + 1) * m + b)[small])
            prices.append(1.0 + price(q_a, q_b, t_a, t_b, column)[small])
        starts, ends = np.flatnonzero(free[0]), np.flatnonzero(free[-1])
        tails += [np.full(len(starts), n * m), (n - 1) * m + ends]
        heads += [starts, np.full(len(ends), n * m + 1)]
        prices += [np.ones(len(starts)), np.ones(len(ends))]
        edges = (np.concatenate(tails), np.concatenate(heads))
        graph = csr_array((np.concatenate(prices), edges), shape=(n * m + 2, n * m + 2))
        best = min(best, dijkstra(graph, indices=n * m)[n * m + 1] - (n + 1))
    return best


def at_cutter_points(path):
    whole = path.cutter_point % 1.0 == 0.0
    return path.q[whole], path.contact_position[whole]


def weighted(problem, weights, fallback):
    known = [fallback]
    if weights.joint_range:
        known.insert(0, plan_optimal(problem, SETTINGS, fallback))
    return plan_weighted(problem, weights, SETTINGS.costs, known)


@cache
def least_travel_of_one_row():
    return weighted(one_row(), ONLY_TRAVEL, recursive(one_row))


def test_travel_is_less_than_on_any_track_over_the_contact_positions_of_the_field():
    problem, plan = one_row(), least_travel_of_one_row()
    q, _ = at_cutter_points(plan.path)
    on_field = shortest(problem, lambda a, b, *_: np.abs(b - a).sum(axis=1))
    assert plan.checks == 1  # nothing was in the way, so the field is scipy's
    assert np.abs(np.diff(q, axis=0)).sum() < 0.999 * on_field
    assert plan.objective.value == pytest.approx(plan.path.joint_travel, abs=1e-12)
    assert 0.8 * plan.path.joint_travel < plan.objective.lower_bound <= plan.path.joint_travel


def test_time_is_no_more_than_on_any_track_over_the_contact_positions_of_the_field():
    problem = one_row()
    slow = replace(problem.cell.robot, max_speed=problem.cell.robot.max_speed / 200.0)
    problem = with_scene(problem, cell=replace(problem.cell, robot=slow))
    arc = np.abs(np.diff(problem.points.arc_length)) / problem.process.feed

    def seconds(q_a, q_b, t_a, t_b, column):
        turning = (np.abs(q_b - q_a) / slow.max_speed).max(axis=1)
        sliding = np.abs(t_b - t_a) / problem.process.contact_speed
        return np.maximum(np.maximum(turning, sliding), arc[column])

    plan = weighted(problem, ONLY_TIME, recursive(one_row))
    q, t = at_cutter_points(plan.path)
    steps = range(len(q) - 1)
    spent = sum(float(seconds(q[[k]], q[[k + 1]], t[[k]], t[[k + 1]], k)[0]) for k in steps)
    assert spent <= shortest(problem, seconds) * 1.0001
    assert spent > arc.sum() * 1.01  # the feed alone does not decide here
    assert plan.objective.lower_bound <= plan.objective.value


# a weighted sum

WEIGHTS = ObjectiveWeights(joint_range=1.0, travel=0.5, time=0.05)


def sum_of(problem, plan, weights):
    robot = problem.cell.robot
    figures = figures_of_path(plan.path, plan.motion, problem.points, problem.process, robot)
    return (
        weights.joint_range * np.ptp(on_wheel(plan.motion), axis=0).sum()
        + weights.travel * figures.joint_travel
        + weights.time * figures.seconds
    )


def test_a_weighted_sum_is_what_the_motion_has_and_no_more_than_other_methods_have():
    problem = one_row()
    plan = weighted(problem, WEIGHTS, recursive(one_row))
    assert plan.objective.value == pytest.approx(sum_of(problem, plan, WEIGHTS), abs=1e-12)
    assert 0.0 < plan.objective.lower_bound <= plan.objective.value
    for other in (recursive(one_row), least_travel_of_one_row()):
        assert plan.objective.value <= sum_of(problem, other, WEIGHTS) + 1e-12
    again = weighted(problem, WEIGHTS, recursive(one_row))
    assert again.motion.q.tobytes() == plan.motion.q.tobytes()


@pytest.mark.parametrize("first", [22, 36, 57])
def test_no_track_of_a_tiny_field_has_a_weighted_sum_below_that_of_the_motion(first):
    problem = problem_of(with_positions(small_job(), 7), slice(first, first + 4))
    plan = weighted(problem, WEIGHTS, plan_recursive(problem))
    robot, process, points = problem.cell.robot, problem.process, problem.points
    arc = np.abs(np.diff(points.arc_length)) / process.feed
    on = np.diff(points.pass_index) == 0
    least = np.inf
    for q, t in free_tracks(problem):
        turned = np.abs(np.diff(q, axis=0))
        sliding = np.abs(np.diff(t)) / process.contact_speed
        seconds = np.maximum(np.maximum(arc, sliding), (turned / robot.max_speed).max(axis=1))
        total = np.ptp(q, axis=0).sum() + 0.5 * turned[on].sum() + 0.05 * seconds[on].sum()
        least = min(least, total)
    assert plan.objective.lower_bound <= plan.objective.value <= least + 1e-9


def test_the_joint_range_sum_alone_has_its_own_bound():
    problem = one_row()
    only_range = weighted(problem, ObjectiveWeights(1.0, 0.0, 0.0), recursive(one_row))
    assert only_range.objective.lower_bound == optimal(one_row).lower_bound


# travel and time at any contact positions


def test_least_travel_lies_below_a_shortest_path_over_a_fine_grid_and_not_far():
    fine = problem_of(with_positions(one_row_job(), 200), slice(20, 40))
    shortest_way = shortest(fine, lambda a, b, *_: np.abs(b - a).sum(axis=1))
    bound = least_cost(one_row(), 1.0, 0.0)
    assert 0.8 * shortest_way < bound <= shortest_way


def test_least_time_is_that_of_the_feed_or_of_slow_joints():
    problem = one_row()
    arc = np.abs(np.diff(problem.points.arc_length)).sum() / problem.process.feed
    assert least_cost(problem, 0.0, 1.0) == pytest.approx(arc)
    slow = replace(problem.cell.robot, max_speed=problem.cell.robot.max_speed / 200.0)
    slowed = with_scene(problem, cell=replace(problem.cell, robot=slow))
    least = least_cost(slowed, 0.0, 1.0)
    assert least > 1.05 * arc
    plan = weighted(slowed, ONLY_TIME, recursive(one_row))
    figures = figures_of_path(plan.path, plan.motion, slowed.points, slowed.process, slow)
    assert least <= figures.seconds


def test_prices_scale_and_are_added_up():
    problem = two_rows()
    travel = least_cost(problem, 1.0, 0.0)
    assert least_cost(problem, 3.0, 0.0) == pytest.approx(3.0 * travel)
    plan = recursive(two_rows)  # any motion does
    assert travel <= plan.path.joint_travel
    both = sum_of(problem, plan, ObjectiveWeights(0.0, 1.0, 1.0))
    assert 0.0 < least_cost(problem, 1.0, 1.0) <= both


def test_where_joints_cannot_turn_as_far_as_they_must_it_is_proven_that_there_is_no_motion():
    problem, known = one_row(), optimal(one_row)
    q, robot = known.path.q, problem.cell.robot
    middle, half = (q.max(axis=0) + q.min(axis=0)) / 2.0, 0.475 * np.ptp(q, axis=0)
    assert float(2.0 * half.sum()) < known.lower_bound
    narrow = replace(robot, lower=middle - half, upper=middle + half)
    with pytest.raises(NoMotionError) as refused:
        cell = replace(problem.cell, robot=narrow)
        plan_optimal(with_scene(problem, cell=cell), SETTINGS, None)
    assert refused.value.proven
