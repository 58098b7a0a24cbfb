"""Positions of long runs: every place keeps the rule, and few are as few as of all."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from opl.cell.robot import forward_kinematics
from opl.motion.fewest import ChainRule, fewest
from opl.motion.line_error import Run, line_errors, screws_of
from opl.motion.long_runs import ENOUGH, fewest_of_long
from tests.support.planned import small_problem

ERROR = 2e-5
N = 3 * ENOUGH


def winding_run(n=N):
    """Return a run whose places are exactly where its configurations bring them."""
    robot = small_problem().cell.robot
    x = np.linspace(0.0, 1.0, n)
    q = np.deg2rad(np.array([20.0, -10.0, -55.0, -50.0, 60.0, -170.0])) + np.zeros((n, 6))
    q[:, 0] += 0.2 * x
    q[:, 1] += 0.03 * np.sin(9.0 * x)
    q[:, 4] += np.where(x > 0.6, 0.1 * np.square(x - 0.6), 0.0)
    Ts = forward_kinematics(robot, q)
    Ts_flange_place = np.tile(np.eye(4), (n, 1, 1))
    Ts_flange_place[:, 2, 3] = 0.1
    pace = np.stack([4.0 * x, 0.5 * x, 4.0 * x], axis=1)
    run = Run(
        q,
        Ts_flange_place,
        Ts @ Ts_flange_place,
        np.zeros(n, dtype=np.int64),
        np.zeros((n, 2)),
        np.full(n, ERROR),
        pace,
        Ts[:, :3, 3] + 0.1 * Ts[:, :3, 2],
    )
    return screws_of(robot), run


def farthest(screws, run, chain):
    """Return the largest error at any place of the run, as a multiple of what is allowed there."""
    worst = 0.0
    for start, end in pairwise(chain.tolist()):
        _, errors = line_errors(screws, run, start, end)
        worst = max(worst, (errors / run.allowed[start + 1 : end]).max(initial=0.0))
    return worst


@pytest.mark.parametrize("zone", [0.0, np.inf])
def test_every_place_is_within_what_is_allowed_and_few_are_about_as_few(zone):
    screws, run = winding_run()
    rule = ChainRule(0.04, 1.6, zone, ERROR)
    chosen, least = fewest_of_long(screws, run, rule), fewest(screws, run, rule)
    assert chosen[0] == 0 and chosen[-1] == N - 1 and (np.diff(chosen) > 0).all()
    assert 10 < len(least) <= len(chosen) <= 1.1 * len(least) + 1
    assert farthest(screws, run, chosen) <= 1.0


def test_a_place_between_those_that_are_looked_at_counts():
    """One place in a run is where no line past it leads: it has to be written."""
    screws, run = winding_run()
    rule = ChainRule(0.0)
    chosen = fewest_of_long(screws, run, rule)
    for odd in (chosen[4] + 1, (chosen[6] + chosen[7]) // 2 | 1):
        targets = run.Ts_base_target.copy()
        targets[odd, 1, 3] += 5.0 * ERROR
        bumped = replace(run, Ts_base_target=targets)
        q = fewest_of_long(screws, bumped, rule)
        assert odd in q
        assert farthest(screws, bumped, q) <= 1.0


def test_what_is_barred_is_not_taken():
    screws, run = winding_run()
    rule = ChainRule(0.0)
    free = fewest_of_long(screws, run, rule).tolist()
    line, corner = tuple(free[3:5]), tuple(free[7:10])
    other = fewest_of_long(screws, run, rule, frozenset({line, corner})).tolist()
    assert line not in set(pairwise(other))
    assert corner not in set(zip(other, other[1:], other[2:], strict=False))


def test_shorter_runs_are_chosen_of_all():
    screws, run = winding_run(2 * ENOUGH - 1)
    rule = ChainRule(0.04, 1.6, np.inf, ERROR)
    np.testing.assert_array_equal(fewest_of_long(screws, run, rule), fewest(screws, run, rule))
