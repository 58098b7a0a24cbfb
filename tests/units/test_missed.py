"""Places that boxes miss, held against the box that follows."""

import numpy as np
import pytest

from opl.least.missed import Missed
from opl.search.in_box import missing_chords
from tests.support.boxes import near_a_box, small_families
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


def test_a_cutter_point_is_missed_by_more_than_known_ones_or_need_not_be_taken():
    box, _, columns = near_a_box()
    families, _ = small_families()
    small = box.widened(-0.1 * box.size)
    worst = families.hold(small, {}, set(), 1e-4)[1]
    pass_index = small_problem().points.pass_index
    assert len(worst) == small_problem().points.n_passes == 2
    assert families.hold(small, {}, set(worst), 1e-4)[1] == []
    # of either pass for itself
    assert families.hold(small, {}, {worst[0]}, 1e-4)[1] == worst[1:]
    away = missing_chords(columns.q, columns.free, small)
    away[pass_index != pass_index[int(worst[0])]] = np.inf
    mild = float(columns.places[np.argmin(np.where(away > 1e-3, away, np.inf))])
    assert mild != worst[0]
    assert families.hold(small, {}, {mild}, 1e-4)[1] == worst
