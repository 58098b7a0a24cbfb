"""The recursive search against the paper's printed recursion."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.search.ladder import Ladder, middle_count
from opl.search.recursive import add_dead_ends, descend
from tests.support.brute_force import printed_recursion, range_sum

NONE = np.empty(0, dtype=np.int64)


def no_dead(ladder):
    return np.zeros(ladder.free.shape, dtype=bool)


def random_field(seed):
    """Return a small field, some of its nodes and steps blocked, and a rule for its steps.

    Every third field has coarse joint positions, whose sums are exact and often equal.
    """
    random = np.random.default_rng(seed)
    n_columns, n_rows = random.integers(1, 8), random.integers(1, 6)
    q = random.uniform(-1.0, 1.0, (n_columns, n_rows, 6))
    if seed % 3 == 0:
        q = np.round(q * 2.0) / 2.0
    free = random.random((n_columns, n_rows)) > 0.2
    q[~free & (random.random(free.shape) > 0.5)] = np.nan
    ladder = Ladder(
        q=q,
        free=free,
        contact_position=random.permutation(np.linspace(-3.0, 3.0, n_rows)),
        off_wheel=random.random(max(n_columns - 1, 0)) < 0.2,
        max_contact_step=random.choice([0.5, 1.0, 2.0]),
        max_joint_step=random.uniform(0.2, 1.2),
    )
    steps = [(c, a, b) for c in range(n_columns - 1) for a in range(n_rows) for b in range(n_rows)]
    blocked = {step for step in steps if random.random() < 0.15}
    return ladder, blocked


def keys_of(ladder, blocked):
    return np.array(sorted(ladder.edge_key(*step) for step in blocked), dtype=np.int64)


def rule_of(ladder, blocked):
    """Return the rule for steps, written here from its description."""

    def leads_on(column, row, next_row):
        if (column, row, next_row) in blocked:
            return False
        if ladder.off_wheel[column]:
            return True
        step = abs(ladder.contact_position[next_row] - ladder.contact_position[row])
        moves = 1
        while step / moves > ladder.max_contact_step * (1 + 1e-9):
            moves += 1
        turned = np.abs(ladder.q[column + 1, next_row] - ladder.q[column, row]).max()
        return turned <= ladder.max_joint_step * moves

    return leads_on


@pytest.mark.parametrize("seed", range(200))
def test_the_search_finds_what_the_printed_recursion_finds(seed):
    ladder, blocked = random_field(seed)
    dead = no_dead(ladder)  # shared, as between the start nodes of a job
    for start in np.flatnonzero(ladder.free[0]):
        wanted = printed_recursion(ladder.q, ladder.free, rule_of(ladder, blocked), start)
        found = descend(ladder, int(start), keys_of(ladder, blocked), dead)
        if wanted is None:
            assert found.rows is None
            assert found.joint_range_sum == np.inf
        else:
            assert found.rows.tolist() == wanted
            assert found.joint_range_sum == pytest.approx(range_sum(ladder.q, wanted), abs=1e-12)
            assert found.reached == len(ladder.q)


def test_the_random_fields_are_of_every_kind():
    outcomes = []
    for seed in range(200):
        ladder, blocked = random_field(seed)
        for start in np.flatnonzero(ladder.free[0]):
            outcomes.append(descend(ladder, int(start), keys_of(ladder, blocked), no_dead(ladder)))
    complete = [outcome for outcome in outcomes if outcome.rows is not None]
    assert len(complete) > 50
    assert len(outcomes) - len(complete) > 50


def reachable(ladder, blocked):
    """Return from which nodes the last column can be reached, trying every way."""
    leads_on, n_columns, n_rows = rule_of(ladder, blocked), *ladder.free.shape

    def can_end(column, row):
        if not ladder.free[column, row]:
            return False
        return column == n_columns - 1 or any(
            ladder.free[column + 1, k] and leads_on(column, row, k) and can_end(column + 1, k)
            for k in range(n_rows)
        )

    return np.array([[can_end(c, r) for r in range(n_rows)] for c in range(n_columns)])


@pytest.mark.parametrize("seed", range(100))
def test_dead_ends_are_the_free_nodes_that_lead_nowhere(seed):
    ladder, blocked = random_field(seed)
    dead = no_dead(ladder)
    add_dead_ends(ladder, keys_of(ladder, blocked), dead)
    np.testing.assert_array_equal(dead, ladder.free & ~reachable(ladder, blocked))


@pytest.mark.parametrize("seed", range(200))
def test_a_bound_gives_up_only_tracks_that_are_no_shorter(seed):
    ladder, blocked = random_field(seed)
    keys = keys_of(ladder, blocked)
    dead = no_dead(ladder)
    add_dead_ends(ladder, keys, dead)
    for start in np.flatnonzero(ladder.free[0]):
        whole = descend(ladder, int(start), keys, no_dead(ladder))
        for share in (0.3, 0.8, 1.0, 1.001, 2.0):
            bound = share * whole.joint_range_sum if whole.rows is not None else 5.0 * share
            found = descend(ladder, int(start), keys, dead.copy(), bound)
            if found.rows is not None:
                assert found.rows.tolist() == whole.rows.tolist()
                assert found.joint_range_sum < bound or len(ladder.q) == 1
            else:
                assert whole.rows is None or whole.joint_range_sum >= bound > 0.0 or bound == 0.0
                assert found.joint_range_sum >= bound


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_same_field_gives_the_same_track(seed):
    ladder, blocked = random_field(seed)
    for start in np.flatnonzero(ladder.free[0]):
        one, other = (
            descend(ladder, int(start), keys_of(ladder, blocked), no_dead(ladder)) for _ in range(2)
        )
        assert (one.rows is None) == (other.rows is None)
        assert one.rows is None or one.rows.tolist() == other.rows.tolist()
        assert one.joint_range_sum == other.joint_range_sum


# long paths


def test_five_thousand_columns_are_no_deeper_than_five():
    random = np.random.default_rng(0)
    n_columns, n_rows = 5000, 20
    q = np.cumsum(random.normal(scale=1e-3, size=(n_columns, n_rows, 6)), axis=0)
    free = random.random((n_columns, n_rows)) > 0.3
    t = np.linspace(-5.0, 5.0, n_rows)
    ladder = Ladder(q, free, t, np.zeros(n_columns - 1, dtype=bool), 1.0, 0.3)
    found = descend(ladder, int(np.flatnonzero(free[0])[0]), NONE, no_dead(ladder))
    assert len(found.rows) == n_columns
    assert free[np.arange(n_columns), found.rows].all()
    assert found.joint_range_sum == pytest.approx(range_sum(q, found.rows))


def test_a_dead_end_after_five_thousand_columns_is_backed_out_of():
    n_columns = 5000
    q = np.zeros((n_columns, 2, 6))
    q[:, 1] = 0.1  # the second row is only the second choice, but the first one ends
    free = np.ones((n_columns, 2), dtype=bool)
    free[-1, 0] = False
    blocked = [(n_columns - 2) * 4 + 1]  # row 0 to row 1 in the last step
    ladder = Ladder(q, free, np.array([0.0, 1.0]), np.zeros(n_columns - 1, dtype=bool), 1.0, 1.0)
    found = descend(ladder, 0, np.array(blocked, dtype=np.int64), no_dead(ladder))
    assert found.rows.tolist() == [0] * (n_columns - 2) + [1, 1]


def test_backtracking_costs_no_more_than_the_field():
    # without a memory of dead ends this would visit 3^40 tracks
    free = np.ones((42, 3), dtype=bool)
    free[-1] = False
    ladder = Ladder(np.zeros((42, 3, 6)), free, np.arange(3.0), np.zeros(41, dtype=bool), 1.0, 1.0)
    dead = no_dead(ladder)
    found = descend(ladder, 0, NONE, dead)
    assert found.rows is None
    assert found.reached == 41
    assert dead[1:-1].all()


def test_one_column_is_a_path():
    ladder = Ladder(
        np.zeros((1, 2, 6)), np.ones((1, 2), bool), np.zeros(2), np.zeros(0, bool), 1.0, 1.0
    )
    found = descend(ladder, 1, NONE, no_dead(ladder))
    assert found.rows.tolist() == [1]
    assert found.joint_range_sum == 0.0


# steps


def two_nodes(joint_step, contact_step, off_wheel=False, max_joint_step=0.25):
    q = np.zeros((2, 2, 6))
    q[1, 1, 3] = joint_step
    free = np.array([[True, False], [False, True]])
    return Ladder(
        q, free, np.array([0.0, contact_step]), np.array([off_wheel]), 1.0, max_joint_step
    )


@pytest.mark.parametrize(
    ("joint_step", "contact_step", "passes"),
    [
        (0.25, 0.0, True),
        (0.26, 0.0, False),
        (-0.26, 1.0, False),
        (0.5, 2.0, True),  # one intermediate node shares the turn
        (0.51, 2.0, False),
        (0.74, -2.5, True),
        (0.76, -2.5, False),
    ],
)
def test_a_joint_may_turn_by_its_limit_for_each_node_of_a_step(joint_step, contact_step, passes):
    ladder = two_nodes(joint_step, contact_step)
    assert (descend(ladder, 0, NONE, no_dead(ladder)).rows is not None) == passes


def test_a_step_off_the_wheel_may_be_of_any_size():
    ladder = two_nodes(3.0, 60.0, off_wheel=True)
    assert descend(ladder, 0, NONE, no_dead(ladder)).rows.tolist() == [0, 1]


def test_a_step_off_the_wheel_may_still_be_blocked():
    ladder = two_nodes(3.0, 60.0, off_wheel=True)
    blocked = np.array([ladder.edge_key(0, 0, 1)], dtype=np.int64)
    assert descend(ladder, 0, blocked, no_dead(ladder)).rows is None


@pytest.mark.parametrize(
    ("step", "most", "count"),
    [(0.0, 1.0, 0), (0.4, 1.0, 0), (1.0, 1.0, 0), (-1.0, 1.0, 0), (1.01, 1.0, 1), (3.0, 1.0, 2),
     (-3.0, 1.0, 2), (0.3, 0.1, 2), (0.7, 0.1, 6), (0.9, 0.3, 2), (2.5, 1.0, 2)],
)  # fmt: skip
def test_intermediate_nodes_do_not_repeat_the_end_node(step, most, count):
    assert middle_count(step, most) == count


@given(st.integers(1, 300), st.floats(0.01, 50.0))
def test_an_exactly_divisible_step_needs_one_node_less_than_moves(n, most):
    assert middle_count(n * most, most) == n - 1


@given(st.floats(-200.0, 200.0), st.floats(0.01, 50.0))
def test_intermediate_nodes_are_as_few_as_keep_the_step(step, most):
    count = middle_count(step, most)
    assert abs(step) / (count + 1) <= most * (1 + 1e-6)
    assert count == 0 or abs(step) / count > most * (1 - 1e-6)
    assert math.isfinite(count)
