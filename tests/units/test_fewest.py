"""The fewest positions are the fewest: against every choice there is, and another kinematics."""

from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell.robot import forward_kinematics
from opl.geometry.frames import inverse, rotation_angle
from opl.motion.corner_error import corner_error
from opl.motion.fewest import ChainRule, fewest
from opl.motion.line_error import LEVER, Run, line_errors, screws_of
from opl.motion.motion import Motion, MoveKind, TimedMotion
from opl.planning.positions import PositionRule, on_wheel_runs
from tests.support.planned import small_job, small_motion, small_problem


def flange_points(q):
    T = forward_kinematics(small_problem().cell.robot, q)
    return T[..., :3, 3] + 0.5 * T[..., :3, 2]


# zones count by a point of the flange, half a metre in front of it
RULE = PositionRule(1e-4, 5e-5, 0.0, np.inf, flange_points, lambda motion: ())
RATIO = 1.6


@cache
def whole_runs():
    problem = small_problem()
    job = small_job()
    found = on_wheel_runs(problem.cell, problem.points, small_motion(), job.process, RULE)
    return screws_of(problem.cell.robot), [run for _, run in found]


def part_of(run, start, end):
    return Run(*(values[start:end] for values in run.arrays))


def error_by_hand(run, start, end, k):
    """Return how far the line is from place k at its nearest, by sampling another kinematics."""
    robot = small_problem().cell.robot
    best = np.inf
    low, high = 0.0, 1.0
    for _ in range(6):
        shares = np.linspace(low, high, 41)
        q = run.q[start] + shares[:, None] * (run.q[end] - run.q[start])
        Ts = inverse(run.Ts_base_target[k]) @ forward_kinematics(robot, q) @ run.Ts_flange_place[k]
        turn = rotation_angle(np.eye(4), Ts)
        off = np.hypot(np.linalg.norm(Ts[:, :3, 3], axis=1), LEVER * turn)
        best = int(off.argmin())
        low, high = shares[max(best - 1, 0)], shares[min(best + 1, 40)]
    R = Ts[best][:3, :3]
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0
    six = np.concatenate([Ts[best][:3, 3], LEVER * axis])
    free = run.freedom[k]
    six[free] -= np.clip(six[free], *run.room[k])
    return float(np.linalg.norm(six))


def with_bows(errors):
    """Return errors at places of a line, and the tops of parabolas through three neighbours."""
    tops = []
    beside = [0.0, *errors, 0.0]
    for three in zip(beside, beside[1:], beside[2:], strict=False):
        parabola = np.polynomial.Polynomial.fit([-1.0, 0.0, 1.0], three, 2)
        places = [x.real for x in parabola.deriv().roots() if abs(x) < 1.0]
        tops += [parabola(x) for x in places if parabola(x) > max(three)]
    return np.array([*errors, *tops])


def keeps_pace(screws, run, start, end):
    """Return whether the ground point is nowhere too fast on a line, and where it may, not slow."""
    if end == start + 1:
        return True
    shares = np.concatenate([[0.0], line_errors(screws, run, start, end)[0], [1.0]])
    takes = np.diff(shares) * (run.pace[end, 0] - run.pace[start, 0])
    planned, least = np.diff(run.pace[start : end + 1, :2], axis=0).T
    most = np.where(planned <= 1.04 * least, 1.04 * planned, 1.3 * planned)
    return bool((takes >= least / 1.04 - 5e-4).all() and (takes <= most + 5e-4).all())


def even(run, start, middle, end):
    """Return whether the speeds of two lines are near enough, those of single steps aside."""
    if end == start + 2:
        return True
    (s1, l1, f1), (s2, l2, f2) = (
        run.pace[middle] - run.pace[start],
        run.pace[end] - run.pace[middle],
    )
    if 0.2 * l1 > f1 or 0.2 * l2 > f2:  # pivoting
        return True
    one, other = max(f1 / s1, 0.2), max(f2 / s2, 0.2)
    return max(one / other, other / one) <= RATIO * (1.0 + 1e-9)


def test_errors_of_lines_are_those_of_another_kinematics():
    screws, runs = whole_runs()
    run = runs[0]
    for start, end in ((0, 5), (3, 12), (20, 28)):
        shares, errors = line_errors(screws, run, start, end)
        assert (np.diff(shares) >= 0.0).all()
        for k, error in zip(range(start + 1, end), errors, strict=True):
            assert error == pytest.approx(error_by_hand(run, start, end, k), abs=2e-6)


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 1),
    st.integers(0, 60),
    st.integers(3, 9),
    st.sampled_from([5e-6, 2e-5, 6e-5]),
    st.sampled_from([0.0, 0.12]),
    st.sampled_from([0.0, 1e-3, np.inf]),
)
def test_no_choice_of_fewer_positions_keeps_the_rule(which, start, count, error, shortest, zone):
    screws, runs = whole_runs()
    run = runs[which % len(runs)]
    part = part_of(run, start, start + count)
    part = replace(part, allowed=np.full(len(part.q), error))
    rule = ChainRule(shortest, RATIO, zone, error)

    def charge(chain):
        lines = [(i, j, with_bows(line_errors(screws, part, i, j)[1])) for i, j in pairwise(chain)]
        if any((errors > error).any() for _, _, errors in lines):
            return None
        if zone > 0.0:
            corners = zip(chain, chain[1:], chain[2:], strict=False)
            longer = [corner for corner in corners if corner[2] > corner[0] + 2]
            if any(corner_error(screws, part, corner, zone) > error for corner in longer):
                return None
        if not all(keeps_pace(screws, part, i, j) for i, j, _ in lines):
            return None
        if any(not even(part, *turn) for turn in zip(chain, chain[1:], chain[2:], strict=False)):
            return None
        short = sum(part.pace[j, 0] - part.pace[i, 0] < shortest for i, j, _ in lines)
        worst = max((errors.max(initial=0.0) for _, _, errors in lines), default=0.0)
        return int(short), len(lines), float(worst)

    n = len(part.q)
    every = [(0, *inner, n - 1) for m in range(n - 1) for inner in combinations(range(1, n - 1), m)]
    charges = [found for chain in every if (found := charge(chain)) is not None]
    chosen = fewest(screws, part, rule)
    if chosen is None:
        assert not charges
        return
    least, mine = min(charges), charge(tuple(chosen.tolist()))
    assert mine is not None
    assert mine[:2] == least[:2]
    assert mine[2] == pytest.approx(least[2], abs=1e-9)


def test_a_line_that_is_barred_is_not_taken_and_another_chain_is():
    screws, runs = whole_runs()
    run = part_of(runs[0], 0, 40)
    free = fewest(screws, run, ChainRule(0.0))
    line = int(free[0]), int(free[1])
    other = fewest(screws, run, ChainRule(0.0), frozenset({line}))
    assert line not in set(pairwise(other.tolist()))
    assert len(other) >= len(free)


def test_a_corner_that_is_barred_is_not_taken_and_its_lines_may_be():
    screws, runs = whole_runs()
    run = part_of(runs[0], 0, 40)
    free = fewest(screws, run, ChainRule(0.0)).tolist()
    corner = tuple(free[:3])
    other = fewest(screws, run, ChainRule(0.0), frozenset({corner})).tolist()
    assert corner not in set(zip(other, other[1:], other[2:], strict=False))
    assert len(other) >= len(free)


def test_configurations_on_a_line_get_their_share_of_its_time():
    q = np.zeros((5, 6))
    q[:, 0] = [0.0, 0.1, 0.4, 0.5, 0.7]
    nothing = np.full(5, np.nan)
    written = np.array([True, False, False, True, True])
    kinds = (MoveKind.HOME,) * 5
    motion = Motion(q, kinds, nothing, nothing, np.zeros(5, dtype=int), written)
    timed = TimedMotion.passing(motion, np.array([0.0, 5.0, 1.0]))
    np.testing.assert_allclose(timed.duration, [0.0, 1.0, 3.0, 1.0, 1.0])
    np.testing.assert_allclose(timed.take(motion.positions).duration, [0.0, 5.0, 1.0])
