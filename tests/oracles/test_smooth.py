"""The smoothest track against exhaustive enumeration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from opl.search.box import JointBox
from opl.search.ladder import Ladder
from opl.search.smooth import TrackCost, Travel, smoothest, smoothest_within
from tests.support.brute_force import all_tracks, keys_of, may_step, random_field


def cost_of(ladder, rows, cost):
    q = ladder.q[np.arange(len(rows)), list(rows)]
    t = ladder.contact_position[list(rows)]
    turned = np.abs(np.diff(q, axis=0))
    on_wheel = ~ladder.off_wheel
    sliding = np.abs(np.diff(t)) / cost.contact_speed
    turning = (turned / cost.max_speed).max(axis=1)
    seconds = np.maximum(np.maximum(cost.edge_seconds, turning), sliding)
    return float(
        (turned @ cost.joint_weights).sum()
        + cost.contact_weight * np.abs(np.diff(t))[on_wheel].sum()
        + cost.time_weight * seconds[on_wheel].sum()
        + cost.node_cost[np.arange(len(rows)), list(rows)].sum()
    )


def random_cost(ladder, seed):
    random = np.random.default_rng(seed)
    return TrackCost(
        joint_weights=random.uniform(0.0, 2.0, 6),
        contact_weight=float(random.uniform(0.0, 0.3)),
        time_weight=float(random.uniform(0.0, 0.5)),
        edge_seconds=np.where(ladder.off_wheel, 0.0, random.uniform(0.0, 1.0)),
        max_speed=random.uniform(0.5, 2.0, 6),
        contact_speed=float(random.uniform(1.0, 10.0)),
        node_cost=random.uniform(0.0, 0.5, ladder.free.shape),
    )


@pytest.mark.parametrize("block", range(10))
def test_the_smoothest_track_is_the_one_that_enumeration_finds(block):
    for seed in range(20 * block, 20 * block + 20):
        ladder, blocked = random_field(seed)
        cost = random_cost(ladder, seed)
        inside = np.random.default_rng(seed).random(ladder.free.shape) > 0.1
        tracks = [
            rows
            for rows in all_tracks(ladder, blocked)
            if all(inside[c, r] for c, r in enumerate(rows))
        ]
        found = smoothest(ladder, keys_of(ladder, blocked), inside, cost)
        if not tracks:
            assert found is None
            continue
        least = min(cost_of(ladder, rows, cost) for rows in tracks)
        assert found.cost == pytest.approx(least, abs=1e-9)
        assert cost_of(ladder, found.rows, cost) == pytest.approx(least, abs=1e-9)
        assert tuple(found.rows) in set(tracks)


def travel_of(ladder, rows):
    """Joint travel and travel of t on the wheel, written from their description."""
    on_wheel = [c for c in range(len(rows) - 1) if not ladder.off_wheel[c]]
    joints = sum(
        np.abs(ladder.q[c + 1, rows[c + 1]] - ladder.q[c, rows[c]]).sum() for c in on_wheel
    )
    t = ladder.contact_position
    return float(joints), float(sum(abs(t[rows[c + 1]] - t[rows[c]]) for c in on_wheel))


def test_a_track_that_moves_no_further_than_another_is_found_where_a_dearer_t_leads_to_one():
    kept = 0
    for seed in range(300):
        ladder, blocked = random_field(seed)
        cost = random_cost(ladder, seed)
        keys, inside = keys_of(ladder, blocked), np.ones_like(ladder.free)
        cheapest = smoothest(ladder, keys, inside, cost)
        calm = smoothest(ladder, keys, inside, replace(cost, contact_weight=10.0))
        if cheapest is None:
            assert smoothest_within(ladder, keys, inside, cost, Travel(9.0, 9.0)) is None
            continue
        # all the room in the joints, none in t but what the calmest track needs
        most = Travel(np.inf, travel_of(ladder, calm.rows)[1])
        found = smoothest_within(ladder, keys, inside, cost, most)
        if travel_of(ladder, cheapest.rows)[1] <= most.contact:
            np.testing.assert_array_equal(found.rows, cheapest.rows)
        elif (found.rows != cheapest.rows).any():
            assert travel_of(ladder, found.rows)[1] <= most.contact + 1e-9
            kept += 1
    assert kept > 20


def test_a_track_that_cannot_move_less_stays_the_cheapest():
    ladder, _ = random_field(8)
    ladder = replace(ladder, max_joint_step=4.0)  # every step may be made
    keys, inside = np.empty(0, dtype=np.int64), np.ones_like(ladder.free)
    cost = random_cost(ladder, 8)
    cheapest = smoothest(ladder, keys, inside, cost)
    found = smoothest_within(ladder, keys, inside, cost, Travel(-1.0, -1.0))
    np.testing.assert_array_equal(found.rows, cheapest.rows)


def test_the_smoothest_track_of_a_large_field_is_a_shortest_path_of_scipy():
    random = np.random.default_rng(7)
    n_columns, n_rows = 40, 30
    ladder = Ladder(
        q=np.cumsum(random.normal(0.0, 0.05, (n_columns, n_rows, 6)), axis=1),
        free=random.random((n_columns, n_rows)) > 0.2,
        contact_position=np.linspace(-15.0, 15.0, n_rows),
        off_wheel=np.arange(n_columns - 1) % 13 == 12,
        max_contact_step=1.0,
        max_joint_step=0.4,
        max_contact_change=8.0,
    )
    cost = random_cost(ladder, 7)
    everywhere = np.ones_like(ladder.free)
    found = smoothest(ladder, np.empty(0, dtype=np.int64), everywhere, cost)

    start, end = n_columns * n_rows, n_columns * n_rows + 1
    edges = {}
    for row in np.flatnonzero(ladder.free[0]):
        edges[start, row] = 1.0 + cost.node_cost[0, row]
    for row in np.flatnonzero(ladder.free[-1]):
        edges[(n_columns - 1) * n_rows + row, end] = 1.0
    for column in range(n_columns - 1):
        for row in np.flatnonzero(ladder.free[column]):
            for following in np.flatnonzero(ladder.free[column + 1]):
                if may_step(ladder, set(), column, row, following):
                    pair = Ladder(
                        ladder.q[column : column + 2],
                        ladder.free[column : column + 2],
                        ladder.contact_position,
                        ladder.off_wheel[column : column + 1],
                        1.0,
                        0.4,
                    )
                    price = TrackCost(
                        cost.joint_weights,
                        cost.contact_weight,
                        cost.time_weight,
                        cost.edge_seconds[column : column + 1],
                        cost.max_speed,
                        cost.contact_speed,
                        np.stack([np.zeros(n_rows), cost.node_cost[column + 1]]),
                    )
                    key = (column * n_rows + row, (column + 1) * n_rows + following)
                    edges[key] = cost_of(pair, (row, following), price)
    tails, heads = np.array(list(edges)).T
    graph = csr_array((list(edges.values()), (tails, heads)), shape=(end + 1, end + 1))
    shortest = dijkstra(graph, indices=start)[end] - 2.0
    assert found.cost == pytest.approx(shortest, abs=1e-9)


def test_a_widened_box_grows_by_the_amount_given():
    box = JointBox(np.zeros(6), np.arange(6.0))
    assert box.widened(0.6).size == pytest.approx(box.size + 0.6)
    assert box.widened(0.6).holds(np.full(6, -0.05))
    assert not box.holds(np.full(6, -0.05))
