"""Limits that a cell adds to those of its robot: kept by the planner, proven by the replay."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell.workcell import JointLimit
from opl.motion.motion import MoveKind
from opl.motion.whole_motion import UnreachableApproachError, whole_motion
from opl.planning.filling import BrokenEdgesError, fill_in
from opl.planning.multi_start import plan_recursive
from opl.planning.nodes import build_nodes
from opl.planning.reasons import explain
from opl.planning.survey import NodeState, survey_nodes
from tests.support.planned import (
    replay_tiny,
    small_problem,
    tiny_motion,
    tiny_problem,
    with_scene,
)

R, T = np.eye(6)[3], np.eye(6)[5]
EVERYWHERE = np.deg2rad(10000.0)


def limit_of(name, coefficients, lower_deg, upper_deg):
    return JointLimit(name, coefficients, np.deg2rad(lower_deg), np.deg2rad(upper_deg))


def with_limits(problem, *limits):
    """Return a problem whose cell has limits, its nodes made anew."""
    cell = replace(problem.cell, limits=limits)
    field = build_nodes(cell, problem.points, problem.field.contact_positions)
    return replace(with_scene(problem, cell=cell), field=field)


def configurations_of(field):
    """Return every configuration of every matrix, shape (n, 6)."""
    return np.concatenate([nodes.q[nodes.exists] for nodes in field.matrices])


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0]), min_size=6, max_size=6).filter(any),
    st.floats(-300, 300),
    st.floats(1, 300),
)
def test_the_nodes_are_all_configurations_within_the_limits_and_no_others(weights, lowest, width):
    problem, coefficients = tiny_problem(), np.array(weights)
    limit = limit_of("sum", coefficients, lowest, lowest + width)
    limited = with_limits(problem, limit).field
    kept = configurations_of(limited) if limited.matrices else np.empty((0, 6))
    sums = np.rad2deg(kept @ coefficients)
    assert (sums >= lowest).all() and (sums <= lowest + width).all()
    # brute force over turns: nothing else was lost
    robot = problem.cell.robot
    q = problem.solutions(np.arange(len(problem.points)))
    q = q[~np.isnan(q[..., 0])]
    margin = 0.01 * np.abs(coefficients).sum()
    expected = 0
    for turns in product((-1, 0, 1), repeat=3):
        turned = q.copy()
        turned[:, [0, 3, 5]] += 2.0 * np.pi * np.array(turns)
        inside = ((turned >= robot.lower) & (turned <= robot.upper)).all(axis=1)
        sums = np.rad2deg(turned @ coefficients)
        inside &= (sums >= lowest + margin) & (sums <= lowest + width - margin)
        expected += int(inside.sum())
    assert abs(len(kept) - expected) <= 1  # a sum on the very edge


def test_a_limited_sum_is_kept_by_the_whole_motion():
    problem = tiny_problem()
    free = plan_recursive(problem)
    wound = np.rad2deg(free.path.q @ (R + T))
    low, high = wound.min() + 0.2, 135.0  # home lies between, the other counts of turns do not
    plan = plan_recursive(with_limits(problem, limit_of("R+T", R + T, low, high)))
    wound = np.rad2deg(plan.motion.q @ (R + T))
    assert low <= wound.min() and wound.max() <= high
    assert plan.path.joint_range_sum > free.path.joint_range_sum


def test_the_replay_finds_what_breaks_a_limit():
    motion = tiny_motion()
    cell = tiny_problem().cell
    sums = motion.q[:, 3] + motion.q[:, 5]
    worst = int(sums.argmax())
    for upper, broken in ((sums[worst] + 1e-6, False), (sums[worst] - 1e-6, True)):
        limited = replace(cell, limits=(JointLimit("R+T", R + T, -EVERYWHERE, upper),))
        found = replay_tiny(cell=limited)
        assert (found.verified is None) == broken
        assert {finding.kind for finding in found.findings} == ({"limit"} if broken else set())
        if broken:
            assert found.limit_violations == (sums == sums[worst]).sum()  # home comes twice
            assert found.findings[0].message.startswith(f"R+T: {np.rad2deg(sums[worst]):.3f} deg")


def test_between_two_configurations_a_sum_stays_between_its_values_at_both():
    # why it is enough to look at the configurations
    motion, limit = tiny_motion(), R - 2.0 * T
    at = motion.q @ limit
    for fraction in (0.1, 0.5, 0.9):
        between = (motion.q[:-1] + fraction * np.diff(motion.q, axis=0)) @ limit
        assert (between <= np.maximum(at[:-1], at[1:]) + 1e-12).all()
        assert (between >= np.minimum(at[:-1], at[1:]) - 1e-12).all()


def test_a_step_and_an_approach_beyond_a_limit_are_refused_by_name():
    problem = tiny_problem()
    plan = plan_recursive(problem)
    motion, path = plan.motion, plan.path
    leads = [k for k, s in enumerate(motion.kind) if s is MoveKind.RETRACT]
    lead = motion.q[leads[-1]]
    cell = replace(
        problem.cell, limits=(JointLimit("U only", np.eye(6)[2], lead[2] + 1e-3, EVERYWHERE),)
    )
    with pytest.raises(UnreachableApproachError) as refused:
        whole_motion(cell, problem.points, path, problem.process)
    assert refused.value.cause == "limits of U only"

    nodes = next(n for n in problem.field.matrices if n.ik_branch[0] == path.ik_branches[0])
    at_points = np.flatnonzero(path.cutter_point % 1.0 == 0.0)
    wanted = np.interp(path.contact_position[at_points], nodes.contact_position[0], np.arange(30))
    rows = np.round(wanted).astype(int)
    shut = replace(problem.cell, limits=(JointLimit("T", T, EVERYWHERE, EVERYWHERE + 1.0),))
    with pytest.raises(BrokenEdgesError) as broken:
        fill_in(shut, problem.points, nodes, rows, problem.interpolation)
    assert set(broken.value.causes.values()) == {"limits of T"}


def test_reasons_and_states_tell_the_limit():
    problem = small_problem()
    shut = with_limits(problem, limit_of("R+T", R + T, 5000, 5001))
    assert shut.field.matrices == ()
    (line,) = explain(shut, [])
    assert "beyond the limits of R+T" in line
    states = survey_nodes(shut, 0, np.zeros(6)).states
    reached = ~np.isnan(problem.angles(0, np.arange(len(problem.points)))[..., 0])
    cuts = problem.wheel_distance < -problem.cell.planned_penetration
    assert (states[reached & ~cuts] == list(NodeState).index(NodeState.LIMITS)).all()
