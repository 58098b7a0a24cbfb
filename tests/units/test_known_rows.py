"""What is solved and measured of places is the same as it is found and as it is known."""

from functools import cache

import numpy as np
import pytest

from opl.cell.robot import forward_kinematics
from opl.files.resources import folder
from opl.job.load import load_job
from opl.least import known_rows
from opl.least.known_rows import KnownRows
from opl.planning.depths import nearer_nodes
from tests.support.boxes import near_a_box
from tests.support.planned import problem_of, small_problem, with_positions

PLACES = np.array([3.0, 3.25, 4.0, 7.875, 60.5, 61.0])


def spread(problem):
    """Return contact positions of each place, those of the first two the same, shape (n, m)."""
    random, last = np.random.default_rng(4), problem.field.contact_positions[-1]
    t = np.sort(random.uniform(-last, last, (len(PLACES), 40)), axis=1)
    t[1] = t[0]
    return t


@cache
def s_problem():
    """Return the S part at few contact positions, so that between them much is not known."""
    job = load_job(folder("workpieces") / "s_shape" / "job.yaml")
    return problem_of(with_positions(job, 6))


@pytest.fixture(params=[known_rows.MOST_KNOWN, 4000], ids=["all known", "often forgotten"])
def rows(request, monkeypatch):
    monkeypatch.setattr(known_rows, "MOST_KNOWN", request.param)
    return KnownRows(small_problem())


def test_the_flange_is_where_the_place_is_ground_at_each_contact_position(rows):
    problem, (_, _, columns) = small_problem(), near_a_box()
    cell, t, family = problem.cell, spread(problem), columns.placements[0].family
    families = np.array([family, family, (family + 1) % 4, family, family, family])
    wanted = cell.Ts_base_flange(t, problem.points.frames_at(PLACES)[:, None])
    found = rows.angles(PLACES, t, families)
    for order in (slice(None), slice(None, None, -1), [1, 4, 1]):
        q = rows.angles(PLACES[order], t[order], families[order])
        np.testing.assert_array_equal(q, found[order])
        reached = ~np.isnan(q[..., 0])
        assert reached.sum() > 20
        flange = forward_kinematics(cell.robot, q[reached])
        np.testing.assert_allclose(flange, wanted[order][reached], atol=1e-9)
    other = rows.angles(PLACES[:1], t[:1], families[2:3])
    assert not np.allclose(other, found[:1], equal_nan=True)


def test_over_the_field_the_angles_are_those_of_its_contact_positions(rows):
    problem, families = small_problem(), np.array([1, 0, 1, 1, 0, 0])
    positions = problem.field.contact_positions
    grid = np.broadcast_to(positions, (len(PLACES), len(positions)))
    wanted = KnownRows(problem).angles(PLACES, grid, families)
    for _ in range(2):
        np.testing.assert_allclose(rows.over_field(PLACES, families), wanted, atol=1e-12)


@pytest.mark.parametrize("most", [known_rows.MOST_KNOWN, 20000])
def test_where_the_part_cuts_in_is_what_the_problem_says_whatever_is_doubted(most, monkeypatch):
    monkeypatch.setattr(known_rows, "MOST_KNOWN", most)
    problem = s_problem()
    random, last = np.random.default_rng(2), problem.field.contact_positions[-1]
    places = np.sort(random.uniform(0.0, len(problem.points) - 1, 60))
    places = places[~problem.off_wheel[places.astype(int)]]
    points, t = problem.points.at_places(places), random.uniform(-last, last, (len(places), 40))
    none, rows = np.zeros(t.shape, dtype=bool), KnownRows(problem)
    unseen = problem.cuts_at(places, points, t, True) & ~problem.cuts_at(places, points, t)
    assert unseen.any()
    some = unseen & (np.arange(t.shape[1]) % 2 == 0)
    for doubted in (none, some, unseen, some, none):
        found = rows.cuts(places, t, doubted)
        np.testing.assert_array_equal(found, problem.cuts_at(places, points, t, doubted))
        np.testing.assert_array_equal(found & unseen, doubted)


def test_where_depth_is_spared_is_measured_where_that_is_asked():
    problem = s_problem()
    rows, t, points = KnownRows(problem), spread(problem), problem.points.at_places(PLACES)
    random, deepest = np.random.default_rng(6), problem.cell.planned_penetration
    for share in (0.0, 0.5, 0.9, 0.5):
        spare = share * deepest * (np.arange(len(PLACES)) % 3 > 0)
        asked = random.random(t.shape) < 0.6
        needed = spare[:, None] - deepest
        deep = nearer_nodes(problem.scene, points, t, asked & (needed > -deepest), needed)
        np.testing.assert_array_equal(rows.spends(PLACES, t, spare, asked), deep)
        assert deep.any() == (share > 0.0)


def test_rows_that_are_known_are_not_solved_again():
    problem = small_problem()
    rows, t = KnownRows(problem), spread(problem)
    families = np.zeros(len(PLACES), dtype=int)
    rows.angles(PLACES, t, families)
    assert rows.solved == t.size
    rows.angles(PLACES[2:], t[2:], families[2:])
    rows.cuts(PLACES, t, np.zeros(t.shape, dtype=bool))
    assert rows.solved == t.size
    none = rows.angles(PLACES[:0], t[:0], families[:0])
    assert none.shape == (0, t.shape[1], 6)
    assert (
        rows.cuts(PLACES[:0], t[:0], np.zeros((0, t.shape[1]), dtype=bool)).shape == none.shape[:2]
    )
