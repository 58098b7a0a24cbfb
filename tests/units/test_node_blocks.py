"""Nodes are worked on block by block: the same as all at once, wherever the blocks end."""

from dataclasses import replace

import numpy as np
import pytest

from opl.least.box_columns import ColumnSampler
from opl.planning import open_matrix, turned
from opl.planning.depths import nearer_nodes, wheel_distances
from opl.planning.multi_start import tracks_from_best_start
from opl.planning.nodes import build_nodes
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.symmetry import twins
from opl.planning.turned import Kept
from opl.search.joint_limits import UNLIMITED
from opl.search.recursive import descend
from opl.walls.families import Families, few_columns
from opl.walls.images import Images, seams_of
from opl.walls.sides import ANY_SIDE
from tests.support.planned import small_problem


@pytest.mark.parametrize("at_once", [1, 1000])
def test_blocks_change_nothing(monkeypatch, at_once):
    problem = small_problem()
    cell, points, t = problem.cell, problem.points, problem.field.contact_positions
    monkeypatch.setattr(turned, "AT_ONCE", at_once)
    field = build_nodes(cell, points, t)
    np.testing.assert_array_equal(field.reached, problem.field.reached)
    assert list(field.angles) == list(problem.field.angles)
    assert len(field.matrices) == len(problem.field.matrices)
    for one, other in zip(field.matrices, problem.field.matrices, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        np.testing.assert_array_equal(one.position_index, other.position_index)
        np.testing.assert_array_equal(one.ik_branch, other.ik_branch)
    layer = wheel_distances(problem.scene, points, t)
    np.testing.assert_array_equal(layer, problem.wheel_distance)
    few = np.arange(len(points)) % 3 == 0
    at, needed = np.broadcast_to(few[:, None], layer.shape), np.full((len(points), 1), 1e-6)
    nearer = nearer_nodes(problem.scene, points, t, np.ones(at.shape, dtype=bool), needed)
    assert 0 < nearer[few].sum() < at.sum()
    np.testing.assert_array_equal(nearer_nodes(problem.scene, points, t, at, needed), nearer & at)


def test_searches_read_nodes_where_they_lie():
    problem = small_problem()
    for nodes in problem.field.matrices:
        ladder = problem.ladder(nodes, problem.free_nodes(nodes))
        assert np.shares_memory(ladder.q_by_joint, ladder.q)


def test_nodes_are_all_turns_of_their_branch_within_the_limits():
    problem = small_problem()
    cell, columns = problem.cell, np.arange(len(problem.points))
    q = problem.solutions(columns)
    for nodes in problem.field.matrices:
        whole = nodes.q
        principal = q[:, :, nodes.ik_branch[0]][:, nodes.position_index]
        turns = (whole - principal) / (2.0 * np.pi)
        np.testing.assert_allclose(turns[nodes.exists], np.round(turns[nodes.exists]), atol=1e-12)
        assert cell.within_limits(whole[nodes.exists]).all()
        np.testing.assert_array_equal(np.isnan(whole), np.isnan(whole[..., [0] * 6]))
        np.testing.assert_array_equal(~np.isnan(whole[..., 0]), nodes.exists)
        # a few are made as all are
        rows = np.arange(whole.shape[1])
        np.testing.assert_array_equal(nodes.at(columns[:, None], rows), whole)
        np.testing.assert_array_equal(nodes.at(3, 5), whole[3, 5])
    for branch in range(8):
        known = problem.angles(branch, columns[::3])
        np.testing.assert_array_equal(known, q[::3, :, branch])


def test_ladders_that_are_not_at_hand_are_made_again(monkeypatch):
    problem = small_problem()
    track = next(tracks_from_best_start(open_matrices(problem)))
    monkeypatch.setattr(open_matrix, "AT_HAND", 1)
    matrices = open_matrices(problem)
    one = next(matrix for matrix in matrices if matrix.free.size)
    assert one.ladder is one.ladder and one.ladder.free is one.free
    before, _ = one.ladder, matrices[-1].ladder
    assert one.ladder is not before
    np.testing.assert_array_equal(one.ladder.q, before.q)
    again = next(tracks_from_best_start(matrices))
    assert again.matrix == track.matrix
    np.testing.assert_array_equal(again.rows, track.rows)


def test_tracks_of_one_row_a_position_are_followed_like_those_of_several():
    """A copy of every row makes no other tracks, however the follower looks for them."""
    problem = small_problem()
    robot = problem.cell.robot
    found = 0
    for matrix in open_matrices(problem):
        nodes = matrix.nodes
        if not matrix.free.any(axis=1).all():
            continue
        rows = np.array([np.flatnonzero(free)[0] for free in matrix.free])
        twice = replace(
            nodes,
            configurations=Kept(np.concatenate([nodes.q, nodes.q + 2.0 * np.pi], axis=1)),
            contact_position=np.concatenate([nodes.contact_position] * 2, axis=1),
            position_index=np.concatenate([nodes.position_index] * 2),
        )
        free = np.concatenate([matrix.free] * 2, axis=1)
        both = OpenMatrix(twice, free, matrix.ladders)
        single = twins([matrix], Track(0, rows), robot)
        double = twins([both], Track(0, rows), robot)
        assert any(np.array_equal(one.rows, rows) for one in single)
        assert any(np.array_equal(one.rows, rows) for one in double)
        found += 1
    assert found


def test_places_near_a_box_are_sampled_alike_in_blocks(monkeypatch):
    problem = small_problem()
    points, robot = problem.points, problem.cell.robot
    q = problem.solutions(few_columns(points.pass_index))
    seams = seams_of(q)
    t, none = problem.field.contact_positions, [[ANY_SIDE]] * points.n_passes
    families = Families(Images(robot, seams, 10.0), q, problem.cuts, points.pass_index, t, none)
    box = families.smallest_grown()
    placements, _ = families.hold(box, {}, set(), 0.1)
    whole = np.arange(len(points), dtype=float)
    between = whole[:-1][np.diff(points.pass_index) == 0] + 0.3
    places = np.union1d(whole, between)
    at_once = ColumnSampler(problem, seams, UNLIMITED).columns(box, placements, places)
    monkeypatch.setattr(turned, "AT_ONCE", 1)
    in_blocks = ColumnSampler(problem, seams, UNLIMITED).columns(box, placements, places)
    assert np.isfinite(at_once.q[..., 0]).any(axis=1).all()
    np.testing.assert_array_equal(in_blocks.t, at_once.t)
    np.testing.assert_array_equal(in_blocks.q, at_once.q)
    np.testing.assert_array_equal(in_blocks.free, at_once.free)


def test_the_first_track_has_the_least_sum_of_all_starts_of_all_turns():
    problem = small_problem()
    sums, starts = [], set()
    for matrix in open_matrices(problem):
        for row in np.flatnonzero(matrix.free[0]):
            dead = np.zeros_like(matrix.free)
            descent = descend(matrix.ladder, row, matrix.blocked_edges, dead)
            sums.append(descent.joint_range_sum)
            starts.add((matrix.nodes.ik_branch.tobytes(), int(matrix.nodes.position_index[row])))
    assert len(starts) < len(sums)  # full turns make more of them
    matrices = open_matrices(problem)
    track = next(tracks_from_best_start(matrices))
    found = matrices[track.matrix].nodes.range_sum(track.rows)
    assert found == pytest.approx(min(sums), abs=1e-12)
