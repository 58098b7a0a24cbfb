"""Which subproblem is worked on next: the least, but for a dive."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from opl.search.open_subproblems import DIVE_AFTER, LATE, OpenSubproblems
from opl.search.subproblems import Subproblem

NOTHING = np.empty((0, 5), dtype=np.int64), 0, np.zeros(6), np.zeros(6)


def node(bound, number=0):
    return Subproblem(bound, number, *NOTHING)


@given(st.lists(st.floats(0.0, 9.0), min_size=1, max_size=20))
def test_the_least_is_taken_first_and_bounds_all(bounds):
    left = OpenSubproblems(node(bounds[0]))
    left.leave(node(bound, number) for number, bound in enumerate(bounds[1:], 1))
    for bound in sorted(bounds):
        assert left.least_bound == bound
        assert left.take().bound == bound
        assert not left.diving
    assert left.least_bound == np.inf


def after_a_while():
    """Return subproblems, one at 1 and one at 2, of which a dive is due."""
    left = OpenSubproblems(node(0.0))
    for _ in range(DIVE_AFTER - 1):
        left.leave([left.take()])
        assert not left.dive_is_due
    left.take()
    left.leave([node(1.0, 1), node(2.0, 2)])
    return left


def test_a_dive_follows_the_least_of_what_was_split_to_a_box():
    left = after_a_while()
    assert left.dive_is_due
    left.dive([node(5.0, 3), node(4.0, 4)])
    assert left.least_bound == 1.0
    taken = left.take()
    assert taken.bound == 4.0
    assert left.diving and left.dive_is_due
    assert left.before(taken)
    left.note_box()
    assert left.take().bound == 1.0
    assert not left.dive_is_due
    assert not left.before(node(2.0))


def test_a_dive_that_ends_without_a_box_is_followed_by_another_later_only():
    left = after_a_while()
    left.dive([node(0.5, 3)])
    assert left.least_bound == 0.5
    left.take()  # no box is left of it
    left.dive([])
    assert left.take().bound == 1.0
    assert not left.dive_is_due


def test_a_box_is_late_until_the_next_whatever_dives_end_without_one():
    left, dives = OpenSubproblems(node(1.0)), 0
    for taken in range(1, LATE + 2):
        one = left.take()
        assert left.box_is_late == (taken > LATE)
        if left.diving:
            dives += 1
            left.dive([])  # nothing is left of it
        elif left.dive_is_due:
            left.dive([one])
        else:
            left.leave([one])
        if np.isinf(left.least_bound):
            left.leave([node(1.0)])
    assert dives > 0
    left.note_box()
    assert not left.box_is_late
