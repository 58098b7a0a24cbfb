"""Where part and wheel collide, they do with the wrist flipped as well: it is not tried."""

from itertools import islice

import numpy as np
import pytest

from opl.cell.robot import forward_kinematics
from opl.cell.workcell import PART, WHEEL
from opl.motion.collision_check import CollidingMove
from opl.motion.motion import MoveKind
from opl.planning import plan
from opl.planning.filling import fill_in
from opl.planning.multi_start import tracks_from_best_start
from opl.planning.open_matrix import open_matrices
from opl.planning.plan import Exhausted, propose_and_check
from opl.planning.symmetry import flipped_alike, twins
from opl.planning.track_check import Collides, Free, check_track
from tests.support.planned import small_problem

FOREARM = "R_link"


@pytest.fixture
def both_flips():
    """Return a problem, its matrices, and the first track that there is with either flip."""
    problem = small_problem()
    matrices = open_matrices(problem)
    for track in islice(tracks_from_best_start(matrices), 50):
        tries = twins(matrices, track, problem.cell.robot)
        if {int(matrices[one.matrix].nodes.ik_branch[0]) // 4 for one in tries} == {0, 1}:
            return problem, matrices, tries
    raise AssertionError("no track with either flip")


def tried(both_flips, pair, monkeypatch):
    """Return with which IK branches tracks are checked, all of which collide at one point."""
    problem, matrices, tries = both_flips
    asked = []

    def collide(problem, nodes, rows):
        asked.append(int(nodes.ik_branch[0]))
        free = check_track(problem, nodes, rows)
        assert isinstance(free, Free)
        ground = free.motion.cutter_point == 5.0
        (move,) = np.flatnonzero(ground & [kind is MoveKind.GRIND for kind in free.motion.kind])
        return Collides(free.motion, (CollidingMove(int(move), pair, True),))

    monkeypatch.setattr(plan, "check_track", collide)
    outcome = propose_and_check(problem, matrices, tries)
    assert isinstance(outcome, Exhausted)
    assert outcome.checks == len(asked)
    for one in tries:
        assert not matrices[one.matrix].allows(one.rows)
    return set(asked)


def test_where_part_and_wheel_collide_the_other_flip_is_not_tried(both_flips, monkeypatch):
    assert len(tried(both_flips, (PART, WHEEL), monkeypatch)) == 1


def test_where_a_link_collides_it_is(both_flips, monkeypatch):
    assert len(tried(both_flips, (FOREARM, WHEEL), monkeypatch)) == 2


def test_the_flange_moves_alike_from_node_to_node_with_either_flip(both_flips):
    problem, matrices, tries = both_flips
    flanges, branches = [], []
    for one in tries:
        nodes = matrices[one.matrix].nodes
        path = fill_in(problem.cell, problem.points, nodes, one.rows, problem.interpolation)
        between = path.q[:-1] + 0.3 * np.diff(path.q, axis=0)
        on_wheel = np.diff(path.pass_index) == 0
        flanges.append(forward_kinematics(problem.cell.robot, between[on_wheel]))
        branches.append(flipped_alike(problem.cell.robot, nodes.ik_branch))
    for flange, branch in zip(flanges, branches, strict=True):
        np.testing.assert_allclose(flange, flanges[0], atol=1e-9)
        np.testing.assert_array_equal(branch, branches[0])
