"""Lower bounds of ways through cells, against ways drawn in them and all ways over points."""

from itertools import pairwise, product

import numpy as np
import pytest

from opl.search.chord_ways import cheapest_over_chords, way_over_chords
from opl.search.shortest_way import cheapest_ways
from opl.search.way_cells import Cells, WayPrices

SEEDS = pytest.mark.parametrize("seed", range(12))
PRICES = pytest.mark.parametrize(("travel", "time"), [(1.0, 0.0), (0.0, 1.0), (0.7, 0.4)])


def prices_of(travel, time, n_columns):
    seconds = np.full(n_columns - 1, 0.05)
    return WayPrices(travel, time, seconds, np.linspace(1.0, 3.0, 6), 400.0)


PRICE_OF_TRAVEL = prices_of(1.0, 0.0, 4)


def drawn(seed, n_columns=4, n_cells=21, long=1.0, apart=0.0):
    """Return cells side by side in each column, as those of a curve that is cut, and their pads.

    The columns are some radians apart.
    """
    random = np.random.default_rng(seed)
    first = n_cells * np.arange(n_columns + 1)
    corners = np.cumsum(random.normal(0.0, 0.05, (n_columns, n_cells + 1, 6)), axis=1)
    corners += random.normal(0.0, 0.3, (n_columns, 1, 6))
    corners += apart * np.arange(n_columns)[:, None, None]
    t = np.linspace(-30.0, 30.0, n_cells + 1)
    start = corners[:, :-1].reshape(-1, 6)
    along = long * np.diff(corners, axis=1).reshape(-1, 6)
    pad = long * random.uniform(0.0, 0.01, (2, len(start), 6))
    low, high = np.tile(t[:-1], n_columns), np.tile(t[1:], n_columns)
    return Cells(start, along, -pad[0], pad[1], low, high if long else low, first)


def cost(prices, q, t):
    """Return what a way over postures is charged, q of shape (n, 6) and t of shape (n,)."""
    change = np.diff(q, axis=0)
    turned = np.abs(change - 2.0 * np.pi * np.round(change / (2.0 * np.pi)))
    seconds = np.maximum((turned / prices.max_speed).max(axis=1), prices.seconds)
    seconds = np.maximum(seconds, np.abs(np.diff(t)) / prices.contact_speed)
    return prices.travel * turned.sum() + prices.time * seconds.sum()


@SEEDS
@PRICES
@pytest.mark.parametrize("apart", [0.0, 3.0, np.pi, 6.0])
def test_no_way_that_is_drawn_costs_less_than_what_is_told_of_any_cell_it_passes(
    seed, travel, time, apart
):
    cells, random = drawn(seed, apart=apart), np.random.default_rng(seed + 1000)
    n_columns = len(cells.first) - 1
    prices = prices_of(travel, time, n_columns)
    potential, _ = cheapest_over_chords(cells, prices_of(travel, 0.0, n_columns))
    told, _ = cheapest_ways(cells, prices, potential)
    begun = np.array(cells.first[:-1])
    for _ in range(300):
        # ways between cells near to each other, of which some are cheap
        row = np.clip(random.integers(21) + random.integers(-2, 3, n_columns), 0, 20)
        at, share = begun + row, random.random(n_columns)[:, None]
        pad = random.choice([0.0, 0.5, 1.0], (n_columns, 6))
        pads = pad * cells.pad_high[at] + (1.0 - pad) * cells.pad_low[at]
        q = cells.start[at] + share * cells.along[at] + pads
        t = cells.t_low[at] + share[:, 0] * (cells.t_high[at] - cells.t_low[at])
        assert (told[at] <= cost(prices, q, t) + 1e-9).all()


@SEEDS
@PRICES
@pytest.mark.parametrize("apart", [0.0, np.pi])
def test_of_cells_without_length_the_cheapest_way_is_that_of_all_there_are(
    seed, travel, time, apart
):
    cells = drawn(seed, n_columns=3, n_cells=17, long=0.0, apart=apart)
    prices = prices_of(travel, time, 3)
    potential, _ = cheapest_over_chords(cells, prices_of(travel, 0.0, 3))
    told, _ = cheapest_ways(cells, prices, potential)
    columns = [range(first, end) for first, end in pairwise(cells.first)]
    least = np.full(len(cells.start), np.inf)
    for way in product(*columns):
        at = np.array(way)
        least[at] = np.minimum(least[at], cost(prices, cells.start[at], cells.t_low[at]))
    assert told == pytest.approx(least, abs=1e-9)


@pytest.mark.parametrize("apart", [3.0, np.pi])
def test_of_short_cells_hardly_less_is_told_than_of_their_ends(apart):
    """Also where the nearest full turn of a joint differs from end to end of a cell."""
    cells = drawn(3, long=0.01, apart=apart)
    over_chords, _ = cheapest_over_chords(cells, PRICE_OF_TRAVEL)
    told, _ = cheapest_ways(cells, PRICE_OF_TRAVEL, over_chords)
    assert 0.98 * over_chords[cells.ends.first[-2] :].min() < told.min()


@SEEDS
@PRICES
def test_over_two_columns_hardly_a_point_of_the_chords_is_cheaper_to_come_from(seed, travel, time):
    """None if travel alone is charged for."""
    cells = drawn(seed, n_columns=2)
    prices = prices_of(travel, time, 2)
    told, _ = cheapest_over_chords(cells, prices)
    over_ends, _ = cheapest_over_chords(cells.ends, prices)
    share = np.linspace(0.0, 1.0, 401)[:, None, None]
    before = slice(0, cells.first[1])
    q = cells.start[before] + share * cells.along[before]
    t = cells.t_low[before] + share[..., 0] * (cells.t_high - cells.t_low)[before]
    ends = cells.ends
    for end in range(ends.first[1], ends.first[2]):
        slid = ends.t_low[end] - t
        least = prices.of(ends.start[end] - q, slid, prices.seconds[0]).min()
        assert told[end] >= least - 1e-3
        # each of the ends has two ends of its own
        assert told[end] <= (over_ends[2 * end] if time > 0.0 else least) + 1e-9


@SEEDS
@PRICES
def test_the_way_over_chords_lies_on_them_and_costs_what_is_told(seed, travel, time):
    cells = drawn(seed, n_columns=3)
    prices = prices_of(travel, time, 3)
    told, _ = cheapest_over_chords(cells, prices)
    t, q = way_over_chords(cells, prices, told)
    # what it costs to get to the column in the middle is not quite even along a chord
    assert cost(prices, q, t) == pytest.approx(told[cells.ends.first[-2] :].min(), abs=0.02)
    for column in range(3):
        own = slice(*cells.first[column : column + 2])
        share = (t[column] - cells.t_low[own]) / (cells.t_high - cells.t_low)[own]
        near = np.abs(cells.start[own] + share[:, None] * cells.along[own] - q[column]).max(axis=1)
        assert near[(share > -1e-9) & (share < 1.0 + 1e-9)].min() < 1e-9


def test_a_joint_that_can_be_held_still_is():
    """Over the ends alone it would turn at every column, by what lies between two ends."""
    n_columns, n_cells = 6, 5
    t = np.linspace(0.0, 1.0, n_cells + 1)
    corners = np.zeros((n_columns, n_cells + 1, 6))
    corners[..., 0] = t - 0.07 * np.arange(n_columns)[:, None]
    cells = Cells(
        corners[:, :-1].reshape(-1, 6),
        np.diff(corners, axis=1).reshape(-1, 6),
        *np.zeros((2, n_columns * n_cells, 6)),
        np.tile(t[:-1], n_columns),
        np.tile(t[1:], n_columns),
        n_cells * np.arange(n_columns + 1),
    )
    prices = prices_of(1.0, 0.0, n_columns)
    told, _ = cheapest_over_chords(cells, prices)
    assert told[cells.ends.first[-2] :].min() == pytest.approx(0.0, abs=1e-12)
    over_ends, _ = cheapest_over_chords(cells.ends, prices)
    assert over_ends[cells.ends.ends.first[-2] :].min() > 0.1
