"""Runs of columns that cannot be passed, against enumeration of all tracks."""

from dataclasses import replace

import numpy as np

from opl.search.impasse import impasses, passable
from opl.search.ladder import Ladder
from tests.support.brute_force import all_tracks, keys_of, random_field


def part(ladder, blocked, first, last):
    """Return a run of columns as a ladder of its own, with the steps blocked in it."""
    columns = slice(first, last + 1)
    inner = replace(
        ladder,
        q=ladder.q[columns],
        free=ladder.free[columns],
        off_wheel=ladder.off_wheel[first:last],
    )
    return inner, {(c - first, a, b) for c, a, b in blocked if first <= c < last}


def enumerated(ladder, blocked, first, last):
    return next(all_tracks(*part(ladder, blocked, first, last)), None) is not None


def test_impasses_are_the_smallest_runs_that_no_track_passes():
    told = 0
    for seed in range(150):
        ladder, blocked = random_field(seed)
        n = len(ladder.q)
        expected = [
            (first, last)
            for first in range(n)
            for last in range(first, n)
            if not enumerated(ladder, blocked, first, last)
            and (first == last or enumerated(ladder, blocked, first + 1, last))
            and (first == last or enumerated(ladder, blocked, first, last - 1))
        ]
        found = impasses(ladder, keys_of(ladder, blocked))
        assert found == expected
        told += len(found)
    assert told > 20


def test_what_is_passable_is_what_some_track_passes():
    told = 0
    for seed in range(150):
        ladder, blocked = random_field(seed)
        keys = keys_of(ladder, blocked)
        for last in range(len(ladder.q)):
            for first in range(last + 1):
                expected = enumerated(ladder, blocked, first, last)
                assert passable(ladder, keys, first, last) == expected
                told += not expected
    assert told > 100


def test_a_jump_of_all_configurations_is_the_impasse():
    q = np.zeros((6, 3, 6))
    q[4:, :, 2] = 2.0
    ladder = Ladder(
        q, np.ones((6, 3), dtype=bool), np.arange(3.0), np.zeros(5, dtype=bool), 1.0, 0.3
    )
    assert impasses(ladder, np.empty(0, dtype=np.int64)) == [(3, 4)]
