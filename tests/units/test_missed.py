"""Places that boxes miss, held against the box that follows."""

import pytest

from opl.least.missed import Missed
from tests.support.boxes import near_a_box
from tests.support.planned import small_problem


@pytest.fixture
def missed():
    _, sampler, _ = near_a_box()
    return Missed(sampler, small_problem().points.pass_index)


def test_the_box_that_follows_is_held_against_what_was_missed_alone(missed, monkeypatch):
    box, sampler, columns = near_a_box()
    small = box.widened(-0.1 * box.size)
    known, others = missed.of(columns, small, 1e-4)
    assert known == [] and len(others) > 3
    asked = []
    sample = sampler.columns

    def counted(box, placements, places):
        asked.append(sorted(places.tolist()))
        return sample(box, placements, places)

    monkeypatch.setattr(sampler, "columns", counted)
    # one that is hardly larger misses hardly less of them, and of nothing else
    _, again = missed.first(box.widened(-0.09 * box.size), columns.placements, 1e-4)
    assert asked == [sorted(others)]
    assert 0 < len(again) <= len(others) and set(again) <= set(others)
    # one that holds all misses none of them, and nothing is looked at for the next
    assert missed.first(box.widened(1e-3), columns.placements, 1e-4) == ([], [])
    assert missed.first(small, columns.placements, 1e-4) == ([], [])
    assert len(asked) == 2


def test_what_is_a_wall_is_not_missed_again(missed):
    box, _, columns = near_a_box()
    small = box.widened(-0.1 * box.size)
    _, others = missed.of(columns, small, 1e-4)
    missed.known.add(others[0])
    known, again = missed.first(small, columns.placements, 1e-4)
    assert known == others[:1] and others[0] not in again
    # more is to be learnt of that first
    assert missed.first(small, columns.placements, 1e-4) == (known, [])
    # nothing is shut where nothing was said to collide
    assert missed.shut(small, columns.placements, 1e-4) == []
