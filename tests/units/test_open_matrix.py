"""What is blocked in a matrix, as the searches take it."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from opl.planning.open_matrix import OpenMatrix, close_collisions, columns_without_nodes

keys = st.lists(st.integers(0, 60), unique=True)


@given(st.lists(st.tuples(keys, keys), min_size=1, max_size=3))
def test_edges_that_are_blocked_or_shut_are_told_once_each_in_their_order(rounds):
    matrix = OpenMatrix(None, np.ones((2, 2), dtype=bool), None)
    for shut, blocked in rounds:
        matrix.shut = np.array(sorted(shut), dtype=np.int64)
        matrix.blocked.update(blocked)
        matrix._counted = -1
        wanted = sorted(set(shut) | matrix.blocked)
        assert matrix.blocked_edges.tolist() == wanted
        assert matrix.blocked_edges.dtype == np.int64


class OneJoint:
    """Collides below an angle of the first joint."""

    def __init__(self, angle):
        self._angle = angle

    def collides(self, q):
        return q[:, 0] < self._angle


def test_a_column_keeps_what_is_near_to_a_collision_where_that_is_all_it_has():
    q = np.zeros((2, 3, 6))
    q[..., 0] = [[0.1, 0.5, 0.9], [0.1, 0.2, 0.3]]
    nodes = SimpleNamespace(q=q, ik_branch=np.zeros(2, dtype=np.int64))
    matrix = OpenMatrix(nodes, np.ones((2, 3), dtype=bool), None)
    close_collisions([matrix], OneJoint(0.15))
    assert matrix.free.tolist() == [[False, True, True], [False, True, True]]
    close_collisions([matrix], OneJoint(0.4), leave_some=True)
    assert matrix.free.tolist() == [[False, True, True], [False, True, True]]
    close_collisions([matrix], OneJoint(0.7), leave_some=True)
    assert matrix.free.tolist() == [[False, False, True], [False, True, True]]


def test_of_each_run_of_columns_without_a_free_node_in_any_matrix_the_middle_one_is_named():
    first = np.array([[1, 0], [0, 0], [0, 0], [0, 0], [0, 1], [0, 0]], dtype=bool)
    second = np.array([[0, 0], [0, 0], [0, 0], [0, 0], [0, 0], [0, 0]], dtype=bool)
    matrices = [OpenMatrix(None, free, None) for free in (first, second)]
    assert columns_without_nodes(matrices) == [2, 5]
    second[:, 1] = True
    assert columns_without_nodes(matrices) == []
