"""Cells halved where what they lie in begins."""

import numpy as np

from opl.cell.wheel_cuts import MOST_HALVINGS, halved


def cut(surely_from, **given):
    """Return cells of what lies from 0 to 1 all over, surely from what a cell's width asks for."""

    def surely(_, low, high):
        return low >= surely_from(high - low), np.ones(len(low), dtype=bool)

    one = np.zeros(1, dtype=int), np.zeros(1), np.ones(1)
    _, low, high, sure = halved(*one, surely, **given)
    assert low[0] == 0.0 and high[-1] == 1.0
    np.testing.assert_array_equal(low[1:], high[:-1])
    return low, high, sure


def test_few_cells_that_are_left_are_halved_on():
    # the nearer to 0, the smaller a cell has to be
    _, high, sure = cut(lambda width: width, most_within=3)
    assert high[~sure].max() == 2.0**-3
    _, high, sure = cut(lambda width: width, most_within=3, few=1)
    assert high[~sure].max() == 2.0**-MOST_HALVINGS


def test_many_cells_that_are_left_are_not():
    low, _, sure = cut(lambda _: np.inf, most_within=3, few=7)
    assert len(low) == 2**3 and not sure.any()
