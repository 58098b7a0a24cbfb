"""Times of whole motions: what the joints can follow, where feed is lost, where the belt dwells."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from opl.files.resources import folder
from opl.job.load import load_job
from opl.job.refusals import dwell_refusal
from opl.motion.feed import HARDLY_MOVES, slow_stretches
from opl.motion.motion import Motion, MoveKind
from opl.motion.rounded import rounded_line
from opl.motion.time_law import JointLimits, fastest_law
from opl.motion.timing import Cause, time_motion
from opl.planning.multi_start import plan_recursive
from tests.support.jobs import opl, write_job
from tests.support.planned import problem_of, v_plan, v_problem, with_positions

HARD = 1.0 / 20.0


@cache
def s_problem():
    return problem_of(with_positions(load_job(folder("workpieces") / "s_shape" / "job.yaml"), 60))


@cache
def s_plan():
    return plan_recursive(s_problem())


@cache
def timing_of(name, share):
    """Return the timing of a part at a share of the joint accelerations, its problem and robot."""
    problem, plan = {"v": (v_problem, v_plan), "s": (s_problem, s_plan)}[name]
    robot = problem().cell.robot
    robot = replace(robot, max_acceleration=share * robot.max_acceleration)
    return time_motion(plan().motion, problem().points, problem().process, robot), problem(), robot


PARTS = pytest.mark.parametrize("name", ["v", "s"])
SHARES = pytest.mark.parametrize("share", [1.0, HARD])


def ways_on_wheel(motion, points):
    """Return the way of each move along the surface, NaN for moves that do not stay on a pass."""
    ways = np.full(len(motion), np.nan)
    for k in range(1, len(motion)):
        before, here = motion.cutter_point[[k - 1, k]]
        if not np.isnan([before, here]).any() and motion.pass_index[k - 1] == motion.pass_index[k]:
            arc = np.interp([before, here], np.arange(len(points)), points.arc_length)
            ways[k] = abs(arc[1] - arc[0])
    return ways


@PARTS
@SHARES
def test_the_passes_keep_joint_speeds_and_accelerations_seen_from_outside(name, share):
    timing, problem, robot = timing_of(name, share)
    motion, limits = timing.timed.motion, JointLimits(robot.max_speed, robot.max_acceleration)
    ways = ways_on_wheel(motion, problem.points)
    step, seen = 1e-3, 0
    for index in range(problem.points.n_passes):
        moves = np.flatnonzero(~np.isnan(ways) & (motion.pass_index == index))
        q = motion.q[np.concatenate([moves[:1] - 1, moves])]
        law = fastest_law(rounded_line(q, timing.timed.duration[moves]), limits, at_rest=True)
        samples = law.configurations(np.arange(0.0, law.time[-1], step))
        assert (np.abs(np.diff(samples, axis=0)) / step / robot.max_speed).max() <= 1.001
        second = samples[2:] - 2.0 * samples[1:-1] + samples[:-2]
        assert (np.abs(second) / step**2 / robot.max_acceleration).max() <= 1.001
        # with the ramps at its ends, and every move at one speed, a pass takes little longer
        longer = law.time[-1] / timing.timed.duration[moves].sum()
        assert 1.0 < longer < (1.02 if share == 1.0 else 1.15)
        seen += len(samples)
    assert seen > 10_000


@PARTS
@SHARES
def test_mean_accelerations_between_moves_are_those_of_the_joints(name, share):
    # no model of the corners: speeds of the straight moves, and the time between their middles
    timing, problem, robot = timing_of(name, share)
    motion = timing.timed.motion
    on_pass = ~np.isnan(ways_on_wheel(motion, problem.points))
    speed = np.diff(motion.q, axis=0) / timing.timed.duration[1:, None]
    between = (timing.timed.duration[1:-1] + timing.timed.duration[2:]) / 2.0
    mean = np.abs(np.diff(speed, axis=0)) / between[:, None] / robot.max_acceleration
    assert mean[on_pass[1:-1] & on_pass[2:]].max() < 1.5


@PARTS
@SHARES
def test_the_feed_is_kept_but_where_the_report_says(name, share):
    timing, problem, _ = timing_of(name, share)
    motion, feed = timing.timed.motion, problem.process.feed
    ways = ways_on_wheel(motion, problem.points)
    slow = slow_stretches(timing, problem.process)
    reported = np.zeros(len(motion), dtype=bool)
    for one in slow:
        inside = (motion.cutter_point > one.start) & (motion.cutter_point <= one.end)
        reported |= inside & (motion.pass_index == one.pass_index)
    on_pass = ~np.isnan(ways)
    speed = np.divide(ways, timing.timed.duration, out=np.full(len(ways), np.nan), where=on_pass)
    kept = on_pass & ~reported
    assert kept.sum() > 100
    assert (speed[kept] >= feed / 1.01 - 1e-12).all() and (speed[on_pass] <= feed + 1e-12).all()
    assert (speed[on_pass & reported] < feed / 1.01).all()
    longer = timing.timed.duration[reported].sum() - ways[reported].sum() / feed
    assert sum(one.longer for one in slow) == pytest.approx(longer)
    for one in slow:
        inside = reported & (motion.cutter_point > one.start) & (motion.cutter_point <= one.end)
        assert one.slowest == pytest.approx(speed[inside].min())
        assert one.shares and all(share.longer > 0.0 for share in one.shares)


@PARTS
def test_hard_limits_lower_the_feed_at_more_places_and_name_the_joints(name):
    usual, problem, _ = timing_of(name, 1.0)
    hard, _, robot = timing_of(name, HARD)
    process = problem.process
    few, many = slow_stretches(usual, process), slow_stretches(hard, process)
    assert len(many) > len(few)
    assert hard.timed.seconds > usual.timed.seconds * 1.05
    blamed = [share for one in many for share in one.shares if share.cause is Cause.ACCELERATION]
    assert {robot.joint_names[share.joint] for share in blamed} >= {"R"}
    assert sum(share.longer for share in blamed) > 1.0


def test_without_slow_joints_only_pivoting_and_what_is_next_to_it_lowers_the_feed():
    timing, problem, _ = timing_of("v", 1e6)
    slow = slow_stretches(timing, problem.process)
    assert len(slow) >= problem.points.n_passes
    for one in slow:
        assert {share.cause for share in one.shares} <= {Cause.PIVOTING, Cause.NEIGHBOUR}
        assert Cause.PIVOTING in {share.cause for share in one.shares}
        assert all(share.joint is None for share in one.shares)


# made-up passes, whose figures are known


def standing_contact(times_on_point, feed=0.02):
    """Return one pass of three points 10 mm apart, along S, that pivots on the middle one."""
    problem = v_problem()
    n = 41
    place = np.concatenate([[0.0], np.ones(n), [2.0]])
    t = np.concatenate([[0.0], np.linspace(0.0, times_on_point * problem.process.contact_speed, n)])
    t = np.append(t, t[-1])
    q = np.zeros((n + 2, 6))
    q[:, 0] = place * 0.01
    q[:, 3] = t * 1e-3
    return problem, Motion(
        q, (MoveKind.GRIND,) * (n + 2), t, place, np.zeros(n + 2, dtype=np.int64)
    )


def points_10_mm_apart():
    points = v_problem().points
    return type(points)(points.Ts_workpiece_cutter[:3], np.zeros(3, int), np.arange(3) * 0.01)


def test_a_contact_that_pivots_on_one_point_dwells_there_as_long_as_it_takes():
    problem, motion = standing_contact(times_on_point=1.5)
    robot = replace(problem.cell.robot, max_acceleration=np.full(6, 1e6))
    timing = time_motion(motion, points_10_mm_apart(), problem.process, robot)
    (one,) = slow_stretches(timing, problem.process)
    assert one.dwell == pytest.approx(1.5)
    assert (one.start, one.end, one.dwell_at, one.slowest) == (1.0, 1.0, 1.0, 0.0)
    assert one.shares[0].cause is Cause.PIVOTING
    assert HARDLY_MOVES == 0.5


@pytest.mark.parametrize(("allowed", "refused"), [(1.49, True), (1.51, False)])
def test_a_dwell_longer_than_allowed_is_refused_with_place_and_time(allowed, refused):
    problem, motion = standing_contact(times_on_point=1.5)
    robot = replace(problem.cell.robot, max_acceleration=np.full(6, 1e6))
    process = replace(problem.process, max_dwell=allowed)
    slow = slow_stretches(time_motion(motion, points_10_mm_apart(), process, robot), process)
    refusal = dwell_refusal(slow, process)
    assert (refusal is not None) == refused
    if refusal is not None:
        assert "1.49 s" in refusal.message and "process.max_dwell_s" in refusal.message
        assert refusal.reasons == ("pass 1, cutter point 1.00: 1.50 s",)


def test_a_joint_at_its_top_speed_is_blamed_for_it():
    problem, motion = standing_contact(times_on_point=0.01)
    speed = problem.cell.robot.max_speed.copy()
    speed[0] = 0.01  # 0.02 rad/s would be needed
    robot = replace(problem.cell.robot, max_speed=speed, max_acceleration=np.full(6, 1e6))
    timing = time_motion(motion, points_10_mm_apart(), problem.process, robot)
    slow = slow_stretches(timing, problem.process)
    assert {(s.cause, s.joint) for one in slow for s in one.shares} >= {(Cause.SPEED, 0)}
    assert timing.timed.duration[[1, -1]] == pytest.approx(1.0, rel=1e-3)  # 10 mm at 10 mm/s


# from the command line


def test_a_run_tells_the_feed_and_the_cycle_time_and_refuses_too_long_a_dwell(tmp_path):
    changes = {"process.max_acceleration_deg_s2": [30, 30, 30, 60, 60, 90]}
    told = opl("run", write_job(tmp_path, changes), "--out", tmp_path / "out")
    assert told.status == 0, told.err
    assert "feed: 20 mm/s, less on" in told.out and "acceleration of joint" in told.out
    assert "cycle time:" in told.out and "are assumed" not in told.out
    changes["process.max_dwell_s"] = 0.01
    ended = opl("run", write_job(tmp_path, changes), "--out", tmp_path / "out")
    assert ended.status == 3
    assert ended.err.startswith("error: the belt would dwell on one spot for more than 0.01 s")
    assert "pass 1, cutter point" in ended.err
    assert not list(Path(tmp_path / "out").glob("*.JBI"))
