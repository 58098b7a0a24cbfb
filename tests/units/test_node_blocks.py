"""Nodes are worked on block by block: the same as all at once, wherever the blocks end."""

from dataclasses import replace

import numpy as np
import pytest

from opl.planning import nodes as nodes_module
from opl.planning.box_columns import ColumnSampler
from opl.planning.families import Families
from opl.planning.images import Images, seams_of
from opl.planning.nodes import build_nodes
from opl.planning.open_matrix import Track, open_matrices
from opl.planning.problem import wheel_distances
from opl.planning.symmetry import twins
from tests.support.planned import small_problem


@pytest.mark.parametrize("at_once", [1, 1000])
def test_blocks_change_nothing(monkeypatch, at_once):
    problem = small_problem()
    cell, points, t = problem.cell, problem.points, problem.field.contact_positions
    monkeypatch.setattr(nodes_module, "AT_ONCE", at_once)
    field = build_nodes(cell, points, t)
    np.testing.assert_array_equal(field.q, problem.field.q)
    assert len(field.matrices) == len(problem.field.matrices)
    for one, other in zip(field.matrices, problem.field.matrices, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        np.testing.assert_array_equal(one.position_index, other.position_index)
        assert one.ik_branch == other.ik_branch
    few = np.arange(len(points)) % 3 == 0
    at = np.broadcast_to(few[:, None], problem.wheel_distance.shape)
    layer = wheel_distances(problem.scene, points, t, at)
    np.testing.assert_array_equal(layer[few], problem.wheel_distance[few])
    assert np.isneginf(layer[~few]).all()


def test_searches_read_nodes_where_they_lie():
    problem = small_problem()
    for nodes in problem.field.matrices:
        ladder = problem.ladder(nodes, problem.free_nodes(nodes))
        assert np.shares_memory(ladder.q_by_joint, nodes.q)


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
            q=np.concatenate([nodes.q, nodes.q + 2.0 * np.pi], axis=1),
            contact_position=np.concatenate([nodes.contact_position] * 2, axis=1),
            position_index=np.concatenate([nodes.position_index] * 2),
        )
        free = np.concatenate([matrix.free] * 2, axis=1)
        both = replace(matrix, nodes=twice, free=free, ladder=problem.ladder(twice, free))
        single = twins([matrix], Track(0, rows), robot)
        double = twins([both], Track(0, rows), robot)
        assert any(np.array_equal(one.rows, rows) for one in single)
        assert any(np.array_equal(one.rows, rows) for one in double)
        found += 1
    assert found


def test_places_near_a_box_are_sampled_alike_in_blocks(monkeypatch):
    problem = small_problem()
    points, robot = problem.points, problem.cell.robot
    seams = seams_of(problem.field.q)
    families = Families(
        Images(robot, seams, 10.0), problem.field.q, problem.cuts, points.pass_index
    )
    box = families.smallest_grown()
    placements, _ = families.hold(box, {}, set(), 0.1)
    whole = np.arange(len(points), dtype=float)
    between = whole[:-1][np.diff(points.pass_index) == 0] + 0.3
    places = np.union1d(whole, between)
    at_once = ColumnSampler(problem, seams).columns(box, placements, places)
    monkeypatch.setattr(nodes_module, "AT_ONCE", 1)
    in_blocks = ColumnSampler(problem, seams).columns(box, placements, places)
    assert np.isfinite(at_once.q[..., 0]).any(axis=1).all()
    np.testing.assert_array_equal(in_blocks.t, at_once.t)
    np.testing.assert_array_equal(in_blocks.q, at_once.q)
    np.testing.assert_array_equal(in_blocks.free, at_once.free)
