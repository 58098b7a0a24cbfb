"""Matrices of postures at other places of joint space, against every count of full turns tried."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from opl.cell.robot_loading import load_robot
from opl.cell.workcell import JointLimit
from opl.planning.symmetry import everywhere
from tests.support.planned import v_job


def reached(cell, q, count):
    """Whether each joint has a posture of every place within its limits, so many turns away."""
    turned = q + 2.0 * np.pi * count
    within = (turned >= cell.robot.lower - 1e-6) & (turned <= cell.robot.upper + 1e-6)
    return within.any(axis=1).all(axis=0)


def every_count(cell, q, chosen, flips):
    """Nearness to the limits and postures of each matrix, every count of full turns tried."""
    found = []
    for number, (_, sign, shift) in enumerate(flips):
        moved = np.where(chosen[..., None], q * sign + shift, np.nan)
        counts = [[c for c in range(-3, 4) if reached(cell, moved, c)[k]] for k in range(6)]
        for count in itertools.product(*counts):
            turned = moved + 2.0 * np.pi * np.array(count)
            within = cell.within_limits(turned)
            if within.any(axis=1).all():
                margin = np.minimum(turned - cell.robot.lower, cell.robot.upper - turned)
                least = np.maximum(np.nanmin(margin, axis=(0, 1)), 1e-3)
                at = np.where(within[..., None], turned, np.nan)
                found.append(((1.0 / least).sum(), number, count, at))
    return [at for *_, at in sorted(found, key=lambda entry: entry[:3])]


@pytest.mark.parametrize("robot", ["mh24", "ur10e"])
@pytest.mark.parametrize("spread", [0.1, 3.0])
def test_matrices_are_those_of_every_count_of_full_turns(robot, spread):
    rng = np.random.default_rng(7)
    arm = load_robot(robot)
    cell = replace(v_job().cell, robot=arm)
    middle = rng.uniform(arm.lower, arm.upper) / 2.0
    q = middle + rng.normal(0.0, spread, (5, 4, 6))
    q[rng.uniform(size=(5, 4)) < 0.2] = np.nan
    chosen = ~np.isnan(q[..., 0]) & (rng.uniform(size=(5, 4)) < 0.9)
    chosen[:, 0], q[:, 0] = True, middle
    mirrored = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0]), np.array([0, 0, 0, np.pi, 0, np.pi])
    same = np.ones(6), np.zeros(6)
    flips = [(np.full(5, 2), *same), (np.full(5, 3), *mirrored)]
    t = np.tile(np.arange(4.0), (5, 1))
    limit = JointLimit("together", np.array([0, 0, 0, 1.0, 0, 1.0]), -6.0, 5.0)
    for limits in ((), (limit,)):
        limited = replace(cell, limits=limits)
        found = everywhere(limited, t, q, chosen, flips)
        wanted = every_count(limited, q, chosen, flips)
        assert len(found) == len(wanted) > 0
        for matrix, at in zip(found, wanted, strict=True):
            np.testing.assert_array_equal(matrix.q, at)
            np.testing.assert_array_equal(matrix.at(np.arange(5), 3), at[:, 3])
            assert matrix.ik_branch[0] in (2, 3)


def test_where_a_place_has_no_posture_there_is_no_matrix():
    flips = [(np.zeros(2, dtype=int), np.ones(6), np.zeros(6))]
    chosen = np.array([[True], [False]])
    assert everywhere(v_job().cell, np.zeros((2, 1)), np.zeros((2, 1, 6)), chosen, flips) == []
