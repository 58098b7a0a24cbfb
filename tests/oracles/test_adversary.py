"""No motion found by other means lies below a printed bound: an attack in small.

benchmarks/adversary.py attacks whole parts with a hundred thousand tries.
"""

import numpy as np
import pytest

from benchmarks.adversary import Adversary, Attack
from tests.oracles.test_optimal import optimal, two_rows, v_row
from tests.support.bare_cells import Ghosts
from tests.support.planned import with_scene


def test_an_attack_comes_near_the_bound_and_not_below_it():
    adversary = Adversary(v_row(), seed=3)
    found = adversary.attack(600)
    assert found.tries >= 600
    size = adversary.hold(found)
    assert size == pytest.approx(found.size)
    assert size >= optimal(v_row).lower_bound
    assert size <= 1.005 * optimal(v_row).path.joint_range_sum  # or it would be no attack


def test_an_attack_that_begins_at_the_path_found_stays_between_it_and_the_bound():
    plan = optimal(v_row)
    adversary = Adversary(v_row(), seed=5, knots=1)
    size = adversary.hold(adversary.attack(200, plan.path))
    # or a bound that is false by a thousandth would not be found out
    assert plan.lower_bound <= size <= plan.path.joint_range_sum


def test_a_motion_that_collides_is_no_attack():
    problem = v_row()
    adversary = Adversary(problem, seed=5, knots=1)
    found = adversary.attack(100, optimal(v_row).path)
    assert np.isfinite(adversary.hold(found))
    haunted = with_scene(problem, collision=Ghosts(np.zeros(6), 1e3))
    assert Adversary(haunted, seed=5, knots=1).hold(found) == np.inf


def test_passes_on_branches_and_turns_of_their_own_do_not_come_below_the_bound():
    adversary = Adversary(two_rows(), seed=3)
    assert adversary.hold(adversary.attack(600)) >= optimal(two_rows).lower_bound


def test_a_motion_that_cuts_into_the_wheel_or_does_not_exist_is_no_attack():
    problem = v_row()
    adversary = Adversary(problem, seed=3, knots=1)
    knots = np.arange(float(len(problem.points)))
    t = np.full(len(knots), 1e3 + problem.cell.wheel.last_position)
    assert adversary.hold(Attack(0.0, knots, t, np.zeros(1, dtype=int), 1)) == np.inf
