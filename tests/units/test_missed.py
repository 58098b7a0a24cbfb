"""Places that boxes miss."""

import numpy as np

from opl.search.in_box import missing_chords
from tests.support.boxes import near_a_box, small_families
from tests.support.planned import small_problem


def test_what_is_a_wall_is_not_missed_as_another_place_nor_is_what_lies_beside_it():
    box, sampler, columns = near_a_box()
    small = box.widened(-0.1 * box.size)
    known, others = columns.missed(small, set(), 1e-4)
    assert known == [] and len(others) > 3
    wall = others[0]
    known, again = columns.missed(small, {wall}, 1e-4)
    assert known == [wall] and again == others[1:]
    places, of_pass = (
        wall + np.array([0.0, 0.01, 0.1]),
        small_problem().points.pass_index[int(wall)],
    )
    few = sampler.columns(small, [columns.placements[of_pass]], places)
    assert len(few.missed(small, set(), 1e-4)[1]) == len(places)
    assert few.missed(small, {wall}, 1e-4) == ([wall], [wall + 0.1])
    # one that holds all misses none of them
    assert columns.missed(box.widened(1e-3), set(others), 1e-4) == ([], [])


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
