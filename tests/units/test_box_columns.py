"""Places sampled near a box: what the samples tell is what the postures between them do."""

from dataclasses import replace

import numpy as np
import pytest

from opl.least.box_columns import LESS, ColumnSampler
from opl.search.box import JointBox
from opl.search.in_box import missing, missing_chords
from opl.walls.shut_leads import RESERVE
from tests.support.boxes import near_a_box
from tests.support.planned import small_problem

PLACE = 92
ROUND_ABOUT = 1e-5  # [rad] what a box holds on either side of a posture


def test_a_box_on_a_chord_over_the_end_of_the_flat_is_missed(monkeypatch):
    wheel, (_, sampler, columns) = small_problem().cell.wheel, near_a_box()
    image = columns.placements[small_problem().points.pass_index[PLACE]]
    there = np.array([float(PLACE)])

    def at(t):
        return sampler.at(there, sampler.there(there), [image], t[None]).q[0]

    def around(q):
        box = JointBox(q - ROUND_ABOUT, q + ROUND_ABOUT)
        return box, sampler.columns(box, columns.placements, columns.places)

    with monkeypatch.context() as patch:
        patch.setattr(ColumnSampler, "_closer", lambda _self, found, *_: found)
        _, found = around(at(np.array([wheel.flat_end]))[0])
    after = int(np.searchsorted(found.t[PLACE], wheel.flat_end))
    box, found = around(found.q[PLACE, after - 1 : after + 1].mean(axis=0))
    # where the contact begins to pivot, the postures bend: they pass the chord at a distance
    t = np.linspace(wheel.flat_end - 5.0, wheel.flat_end + 5.0, 20001)
    away = missing(at(t), box).min()
    assert away > 4e-5
    assert missing_chords(found.q, found.free, box)[PLACE] == pytest.approx(away, rel=0.1)


@pytest.mark.parametrize(
    ("needs", "reserve"), [(0.9, RESERVE), (2e-4, LESS[0]), (5e-5, LESS[1]), (1e-5, 0.0)]
)
def test_the_reserve_is_the_largest_that_costs_hardly_more_than_none(monkeypatch, needs, reserve):
    """A place is free in the box with a reserve below what it needs, beside it with another."""
    box, sampler, columns = near_a_box()
    monkeypatch.setattr(sampler, "collisions", True)
    monkeypatch.setattr(sampler, "reserve", RESERVE)
    beside = columns.q + 0.01

    def left(self, _box, found, _spare):
        return replace(found, q=columns.q if self.reserve < needs else beside)

    monkeypatch.setattr(ColumnSampler, "_left", left)
    found = sampler.columns(box, columns.placements, columns.places)
    assert sampler.reserve == reserve
    assert found.q is columns.q


def test_places_are_sampled_closer_without_a_change_of_those_there_were():
    box, sampler, columns = near_a_box()
    small = box.widened(-box.size / 2.0)
    before = columns.t.copy(), columns.q.copy(), columns.free.copy()
    closer = sampler._closer(columns, small, np.zeros(len(columns.places)))
    assert not np.array_equal(closer.t, columns.t)
    for one, other in zip(before, (columns.t, columns.q, columns.free), strict=True):
        np.testing.assert_array_equal(one, other)
