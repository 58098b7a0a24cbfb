"""Where tracks may pass an end of the wheel's flat, edge by edge, and what motions teach of it."""

from copy import copy
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell.workcell import PART, WHEEL
from opl.least.flat_ends import MORE, FlatEnds
from opl.least.over_ends import BESIDE, CLOSE, learn_of_ends, shut_over_ends, sunk_over_ends
from opl.least.rows import MOST_PARTS
from opl.motion.collision_check import CollidingMove
from opl.planning.track_check import Collides
from tests.support.boxes import near_a_box
from tests.support.planned import small_problem
from tests.units.test_sinking import motion_of_a_track

PLACES = 4
PROBLEM = small_problem()
END = PROBLEM.cell.wheel.flat_end


@dataclass
class Sampler:
    """Knows where places are free at both ends of the flat, shape (n, 2)."""

    ends: FlatEnds
    free: np.ndarray

    def there(self, places):
        return places

    def at(self, places, there, placements, t):
        assert (np.abs(t) == END).all()
        return SimpleNamespace(free=self.free[places.astype(int)])


def columns(passes, places=None):
    places = np.arange(len(passes), dtype=float) if places is None else places
    points = SimpleNamespace(pass_index=np.array(passes))
    return SimpleNamespace(places=places, points=points, placements=[None, None])


flags = st.lists(st.booleans(), min_size=2 * PLACES, max_size=2 * PLACES)
positions = st.lists(st.floats(-3.0, 3.0), min_size=3 * PLACES, max_size=3 * PLACES)


@settings(deadline=None)
@given(flags, positions)
def test_edges_over_an_end_are_shut_but_between_places_that_are_free(free, t):
    free, t = np.array(free).reshape(PLACES, 2), END * np.array(t).reshape(PLACES, 3)
    sampler = Sampler(FlatEnds(PROBLEM), free)
    given_columns = columns([0] * PLACES)
    assert not len(shut_over_ends(sampler, given_columns, t))  # it never sank there
    sampler.ends.note(0, 1e-6)
    expected = []
    for k in range(PLACES - 1):
        for i in range(3):
            for j in range(3):
                one, other = t[k, i], t[k + 1, j]
                for end, may in ((-END, free[:, 0]), (END, free[:, 1])):
                    if not min(one, other) < end < max(one, other):
                        continue
                    share = (end - one) / (other - one)
                    near = (may[k] and share <= BESIDE) or (may[k + 1] and 1.0 - share <= BESIDE)
                    if not (may[k] and may[k + 1]) and not near:
                        expected.append((k * 3 + i) * 3 + j)
    assert shut_over_ends(sampler, given_columns, t).tolist() == sorted(set(expected))


def test_a_pass_that_sank_takes_in_places_first_and_then_spares_depth():
    assert PROBLEM.points.n_passes > 1
    sampler = Sampler(FlatEnds(PROBLEM), np.ones((3, 2), dtype=bool))
    wide, told = columns([0, 0, 1]), []

    def learn(bulges):
        told.extend((one.first, one.last, one.parts) for one in bulges)
        return True

    sunk = np.array([2e-6, 0.0])
    assert not learn_of_ends(sampler, wide, [1], sunk, learn)  # it did not sink there
    assert learn_of_ends(sampler, wide, [0], sunk, learn)
    assert told == [] and sampler.ends.sank[:2].tolist() == [True, False]
    assert learn_of_ends(sampler, wide, [0], sunk, learn)
    assert told == [(0.0, 1.0, MOST_PARTS)]
    assert sampler.ends.count == 1 and not sampler.ends.spared(np.array([0, 1])).any()
    close = columns([0, 0, 1], np.array([0.0, CLOSE / 2.0, 1.0]))
    assert learn_of_ends(sampler, close, [0], sunk, learn)
    assert sampler.ends.spared(np.array([0, 1])) == pytest.approx([MORE * 2e-6, 0.0])
    assert sampler.ends.count == 2 and len(told) == 1


def test_motions_sink_over_an_end_where_they_do_just_there_between_two_columns():
    problem, motion, grinding = motion_of_a_track()
    inside = [k for k in grinding if motion.cutter_point[k] % 1.0 > 0.0][:3]
    t = motion.contact_position.copy()
    t[inside[:2]] = END
    motion = replace(motion, contact_position=t)
    faults = [
        CollidingMove(inside[0], (PART, WHEEL), True),
        CollidingMove(inside[1], ("R_link", WHEEL), True),
        CollidingMove(inside[2], (PART, WHEEL), True),
    ]
    hits = {(b"", b""): Collides(motion, tuple(faults))}
    assert sunk_over_ends(problem, hits) == [int(motion.cutter_point[inside[0]])]


def test_where_the_flat_ends_it_is_known_by_the_number_itself():
    ends = FlatEnds(PROBLEM)
    t = np.array([[END, -END, np.nextafter(END, 0.0), 0.0]])
    assert ends.are_at(t).tolist() == [[True, True, False, False]]
    assert ends.contact_positions(3).shape == (3, 0)
    ends.note(0, 0.0)
    assert ends.contact_positions(3).tolist() == [[-END, END]] * 3


def test_what_a_pass_spares_is_its_own_wherever_its_places_are_looked_at_alone():
    _, shared, columns = near_a_box()
    sampler = copy(shared)  # other tests have the one that they share
    sampler.ends = FlatEnds(PROBLEM)
    passes, last = columns.points.pass_index, PROBLEM.points.n_passes - 1
    found = {}
    for index in (0, last):
        own = columns.places[passes == index]
        ends = np.tile([-END, END], (len(own), 1))
        given_places = own, sampler.there(own), [columns.placements[index]], ends
        assert sampler.at(*given_places).free.any()
        found[index] = given_places
    for _ in range(2):  # the first time it only takes note of the pass
        sampler.ends.note(last, 1e3)
    assert sampler.at(*found[0]).free.any()
    assert not sampler.at(*found[last]).free.any()
