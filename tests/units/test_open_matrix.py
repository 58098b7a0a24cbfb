"""What is blocked in a matrix, as the searches take it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from opl.planning.open_matrix import OpenMatrix

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
