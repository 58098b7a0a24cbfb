"""No motion found by other means lies below a printed bound: an attack in small.

benchmarks/adversary.py attacks whole parts with a hundred thousand tries.
"""

import numpy as np
import pytest

from benchmarks.adversary import Adversary, Attack
from tests.oracles.test_optimal import optimal, two_rows, v_row


def test_an_attack_comes_near_the_bound_and_not_below_it():
    adversary = Adversary(v_row(), seed=3)
    found = adversary.attack(600)
    assert found.tries >= 600
    size = adversary.hold(found)
    assert size == pytest.approx(found.size)
    assert size >= optimal(v_row).lower_bound
    assert size <= 1.02 * optimal(v_row).path.joint_range_sum  # or it would be no attack


def test_passes_on_branches_and_turns_of_their_own_do_not_come_below_the_bound():
    adversary = Adversary(two_rows(), seed=3)
    assert adversary.hold(adversary.attack(600)) >= optimal(two_rows).lower_bound


def test_a_motion_that_cuts_into_the_wheel_or_does_not_exist_is_no_attack():
    problem = v_row()
    adversary = Adversary(problem, seed=3)
    n = len(problem.points)
    beyond = 1e3 + problem.cell.wheel.last_position
    assert adversary.hold(Attack(0.0, np.full(n, beyond), np.zeros(1, dtype=int), 1)) == np.inf
