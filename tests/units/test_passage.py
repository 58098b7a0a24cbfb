"""Ways through a rectangle, and chains: one is there exactly where the other is not."""

from itertools import pairwise

import numpy as np
import pytest

from opl.search.passage import barred, chain, passage


def edges(seed, n=7, m=9):
    random = np.random.default_rng(seed)
    # few values, so that many edges miss the box by the same
    return random.integers(0, 6, (n, m - 1)) / 5.0, random.integers(0, 6, (n - 1, m)) / 5.0


def crossed(ends, up, along):
    """Return by how much the box misses edges given by their ends."""
    return np.array([(up if a[0] == b[0] else along)[a] for a, b in ends])


def reachable(up, along, most):
    """Return whether some way through crosses only edges missed by so much, cell by cell."""
    entered = [j for j in range(up.shape[1]) if up[0, j] <= most]
    for k in range(len(along)):
        seen, waiting = set(entered), list(entered)
        while waiting:
            j = waiting.pop()
            for there, line in ((j + 1, j + 1), (j - 1, j)):
                inside = 0 <= there < up.shape[1]
                if inside and there not in seen and along[k, line] <= most:
                    seen.add(there)
                    waiting.append(there)
        entered = [j for j in seen if up[k + 1, j] <= most]
    return bool(entered)


@pytest.mark.parametrize("seed", range(40))
def test_all_ways_are_barred_exactly_where_a_chain_stands(seed):
    up, along = edges(seed)
    most = barred(up, along)
    assert reachable(up, along, most) and not reachable(up, along, most - 0.1)
    assert chain(up, along, most + 0.1) is None
    if most == 0.0:
        return
    corners = chain(up, along, most)
    assert corners[0][1] == 0 and corners[-1][1] == up.shape[1]
    for (k, j), (there, top) in pairwise(corners):
        assert (k == there) != (j == top)
        if k == there and top > j:
            assert (up[k, j:top] >= most).all()
        elif j == top:
            assert (along[min(k, there) : max(k, there), j] >= most).all()


@pytest.mark.parametrize("seed", range(20))
def test_every_way_crosses_a_chain_where_it_leads_upwards_or_along(seed):
    up, along = edges(seed)
    most = barred(up, along)
    corners = chain(up, along, most)
    wall_up, wall_along = np.zeros(up.shape, dtype=bool), np.zeros(along.shape, dtype=bool)
    for (k, j), (there, top) in pairwise(corners):
        if k == there and top > j:
            wall_up[k, j:top] = True
        elif j == top:
            wall_along[min(k, there) : max(k, there), j] = True
    # no way is left where the edges of the wall alone cannot be crossed
    assert not reachable(wall_up.astype(float), wall_along.astype(float), 0.5)


@pytest.mark.parametrize("seed", range(20))
def test_the_way_crosses_a_first_and_a_last_edge_and_none_that_is_missed_by_more(seed):
    up, along = edges(seed)
    most = barred(up, along)
    ends = passage(up, along, most)
    assert ends[0][0][0] == 0 and ends[-1][0][0] == len(along)
    assert crossed(ends, up, along).max() == most
    free = passage(up, along, np.inf)
    assert crossed(free, up, along).sum() <= crossed(ends, up, along).sum() + 1e-12
