"""What is hoped for: never what is proven not to exist, and in the end as much as the best has."""

from hypothesis import given
from hypothesis import strategies as st

from opl.least.hope import FIRST_GUESS, Hope
from opl.planning.plan import AT_REST


def test_nothing_is_guessed_where_a_motion_tells():
    assert Hope(True).guess(0.2, 3.0) == 3.0
    assert Hope(False).guess(0.2, 3.0) == FIRST_GUESS
    assert Hope(False).guess(2.0, 2.5) == 2.5


@given(
    st.lists(st.floats(0.1, 9.0), max_size=12),
    st.floats(0.1, 1.0),
    st.booleans(),
    st.floats(0.0, 1.0),
)
def test_hopes_rise_above_all_that_is_proven_not_to_exist(sizes, first, found, share):
    hope, best, hoped = Hope(found), 10.0, first
    for size in sizes:
        before, proven = hoped, hope.more(hoped, best, found, share)
        assert before < proven or proven == best
        hoped = hope.told(size, proven)
        assert before < hoped <= proven or hoped == best
    for _ in range(3000):
        hoped = hope.more(hoped, best, found, share)
    assert hoped == best


def test_a_box_of_no_size_does_not_end_all_hope():
    """A cone of the strangers may rest on the wheel all over its pass: hoping went on for ever."""
    hope = Hope(True)
    hoped = hope.told(0.0, 0.0015)
    assert 0.0 < hoped <= AT_REST
    for _ in range(40):
        hoped = hope.more(hoped, 0.0015, True, 0.5)
    assert hoped > AT_REST


def test_a_box_lowers_what_is_only_guessed():
    """A cone of the strangers, 20261702 32.0: 3.8 rad were hoped for, a box told 2.86 rad."""
    hope = Hope(False)
    hoped = hope.more(2.531, 43.7, False, 0.5)
    assert hoped > 3.7
    assert hope.told(2.857, hoped) == 2.857


def rises(told, found, share):
    """Return by how much what is hoped for rises at last, a size told after each rise."""
    hope, hoped = Hope(True), 1.0
    for _ in range(6):
        before, hoped = hoped, hope.more(hoped, 99.0, found, share)
        hope.told(told, hoped)
    return hoped / before


def test_hopes_rise_faster_as_long_as_nothing_new_tells():
    assert rises(told=98.0, found=False, share=1.0) > 1.1


def test_hopes_rise_faster_than_a_known_motion_lets_them_where_that_costs_little():
    assert rises(told=98.0, found=True, share=0.05) > 1.1
    assert rises(told=98.0, found=True, share=0.5) < 1.005
