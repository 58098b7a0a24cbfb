"""Among motions that are equal for the search, the quickest: against every one of them."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.least.equals import CLEAR_OF_LIMITS, quickest_of_equals
from opl.motion.timing import time_motion
from opl.planning.track_check import Free, check_path
from tests.support.planned import small_plan, small_problem, with_scene

TURN = 2.0 * np.pi


@cache
def chosen():
    return quickest_of_equals(small_problem(), small_plan(), True)


def free_seconds(problem, motion):
    """Return the time off the wheel of a motion, its approaches and retracts left out."""
    timed = time_motion(motion, problem.points, problem.process, problem.cell.robot).timed
    return float(timed.duration[[kind.is_free for kind in motion.kind]].sum())


def margin(robot, motion):
    """Return how near a motion between its ends comes to a limit in [rad]."""
    q = motion.q[1:-1]
    return float(np.minimum(q - robot.lower, robot.upper - q).min())


def every_image(problem, path):
    """Yield every path that is the same on the wheel: flips by the inverse kinematics itself."""
    robot = problem.cell.robot
    Ts = forward_kinematics(robot, path.q)
    (branch,) = set(path.ik_branches.tolist())
    for slot in (branch, branch ^ 4):
        first = inverse_kinematics(robot.arm, Ts)[:, slot]
        unrolled = np.unwrap(first, axis=0)
        for counts in product(range(-2, 3), repeat=6):
            if any(counts[k] for k in (0, 1, 2, 4)):
                continue  # these joints of the MH24 turn less than once
            q = unrolled + TURN * np.array(counts)
            if ((q > robot.lower) & (q < robot.upper)).all():
                yield replace(path, ik_branches=np.full_like(path.ik_branches, slot), q=q)


def test_no_image_that_is_clear_of_the_limits_is_quicker():
    problem, robot = small_problem(), small_problem().cell.robot
    times = []
    for path in every_image(problem, small_plan().path):
        found = check_path(problem, path)
        if isinstance(found, Free) and margin(robot, found.motion) >= CLEAR_OF_LIMITS:
            times.append(free_seconds(problem, found.motion))
    assert len(times) > 3 and max(times) > 2.0 * min(times)
    assert margin(robot, chosen().motion) >= CLEAR_OF_LIMITS
    assert free_seconds(problem, chosen().motion) == pytest.approx(min(times), abs=1e-6)


def test_on_the_wheel_nothing_changes():
    before, after = small_plan().path, chosen().path
    robot = small_problem().cell.robot
    np.testing.assert_array_equal(after.contact_position, before.contact_position)
    assert after.joint_range_sum == pytest.approx(before.joint_range_sum, abs=1e-9)
    assert after.joint_travel == pytest.approx(before.joint_travel, abs=1e-9)
    np.testing.assert_allclose(
        forward_kinematics(robot, after.q), forward_kinematics(robot, before.q), atol=1e-9
    )


def test_whichever_image_the_search_found_the_same_is_chosen():
    problem = small_problem()
    for path in list(every_image(problem, small_plan().path))[::3]:
        found = check_path(problem, path)
        if isinstance(found, Free):
            plan = replace(small_plan(), path=path, motion=found.motion)
            again = quickest_of_equals(problem, plan, True)
            np.testing.assert_allclose(again.motion.q, chosen().motion.q, atol=1e-9)


def test_a_longer_way_is_taken_to_stay_clear_of_a_limit():
    problem, robot = small_problem(), small_problem().cell.robot
    near = robot.upper.copy()
    near[5] = chosen().motion.q[1:-1, 5].max() + CLEAR_OF_LIMITS / 2.0
    cell = replace(problem.cell, robot=replace(robot, upper=near))
    other = quickest_of_equals(with_scene(problem, cell=cell), chosen(), True)
    assert margin(cell.robot, other.motion) >= CLEAR_OF_LIMITS
    assert free_seconds(problem, other.motion) > free_seconds(problem, chosen().motion)


def test_where_no_image_is_clear_of_a_limit_the_quickest_of_all_is_taken():
    problem, robot = small_problem(), small_problem().cell.robot
    q = chosen().motion.q[1:-1, 1]  # a joint that no image turns elsewhere
    lower, upper = robot.lower.copy(), robot.upper.copy()
    lower[1], upper[1] = q.min() - 0.01, q.max() + 0.01
    cell = replace(problem.cell, robot=replace(robot, lower=lower, upper=upper))
    process = replace(problem.process, home=chosen().motion.q[1])
    problem = replace(with_scene(problem, cell=cell), process=process)
    same = quickest_of_equals(problem, chosen(), True)
    np.testing.assert_allclose(same.path.q, chosen().path.q, atol=1e-9)


def test_passes_turn_on_their_own_where_no_range_is_counted():
    problem = small_problem()
    path = chosen().path
    q = path.q.copy()
    q[path.pass_index == 1, 5] += TURN if q[:, 5].max() + TURN < np.deg2rad(455) else -TURN
    found = check_path(problem, replace(path, q=q))
    assert isinstance(found, Free)
    apart = replace(small_plan(), path=replace(path, q=q), motion=found.motion)
    assert free_seconds(problem, apart.motion) > free_seconds(problem, chosen().motion) + 1.0
    together = quickest_of_equals(problem, apart, False)
    np.testing.assert_allclose(together.path.q, path.q, atol=1e-9)
    # as many turns of each pass as it takes to stay within the ranges that were found
    kept = quickest_of_equals(problem, apart, True)
    assert kept.path.joint_range_sum <= apart.path.joint_range_sum + 1e-6
