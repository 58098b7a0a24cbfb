"""Postures of places between cutter points, and what they tell of a box."""

from dataclasses import replace

import numpy as np

from opl.least.box_columns import ColumnSampler
from opl.least.postures import BESIDE
from opl.least.rectangle import Rectangle
from opl.least.rows import shut_edges
from opl.search.box import JointBox
from opl.search.joint_limits import UNLIMITED
from opl.walls.sides import Barrier, Side
from tests.support.boxes import near_a_box, small_families
from tests.support.planned import small_problem


def test_places_beside_a_wall_that_is_missed_as_well_are_left_out():
    box, _, columns = near_a_box()
    away = box.widened(-box.size / 2.0)  # so small that places are missed
    shut, new = columns.missed(away, set(), 1e-4)
    assert not shut
    assert len(new) > 3
    shut, other = columns.missed(away, {new[1]}, 1e-4)
    assert shut == [new[1]]
    assert other == [place for place in new if abs(place - new[1]) > BESIDE]


def test_a_chain_is_cut_finer_where_the_postures_between_its_places_are_nearer_to_a_box():
    _, sampler, columns = near_a_box()
    image, places = columns.placements[0], np.arange(20.0, 24.0)
    t = np.linspace(-5.0, 5.0, 3)
    rectangle = Rectangle(sampler, places, t, image)
    between = np.array([21.5])
    q = sampler.at(between, sampler.there(between), [image], t[None, 1:2]).q[0, 0]
    box = JointBox(q - 1e-9, q + 1e-9)
    corners = [(0, 1), (3, 1)]  # from place to place, all along one contact position
    assert rectangle.nearer_between(corners, box, 1e-6) == [(21.0, 22.0)]
    assert rectangle.nearer_between([(0, 0), (0, 1)], box, 1e-6) == []


def test_lines_on_both_sides_of_what_lies_in_a_box_between_them_are_rows():
    _, sampler, columns = near_a_box()
    image, t = columns.placements[0], np.linspace(-6.0, 6.0, 7)
    places = np.array([20.0, 20.5, 21.0, 22.0])
    rectangle = Rectangle(sampler, places, t, image)
    at = np.array([20.5]), np.array([[1.3]])  # between the lines at 0 and 2
    q = sampler.at(at[0], sampler.there(at[0]), [image], at[1]).q[0, 0]
    box = JointBox(q - 1e-3, q + 1e-3)
    up, _ = rectangle.missed(box)
    rows = rectangle.rows(up, 1e-6)
    assert [row.contact_position for row in rows] == [0.0, 2.0]
    assert all((row.places == places[:3]).all() for row in rows)


def test_what_only_keeps_no_reserve_of_clearance_is_open_to_a_way():
    """A chain that rests on the reserve is no wall: the proof knows of the clearance alone."""
    _, known, columns = near_a_box()
    sampler = ColumnSampler(small_problem(), small_families()[1], UNLIMITED)
    sampler.collisions, sampler.reserve = True, 0.2
    places, t = np.arange(20.0, 24.0), np.linspace(-5.0, 5.0, 3)
    q = known.at(places, known.there(places), columns.placements, np.tile(t, (4, 1))).q
    assert sampler.collides(q.reshape(-1, 6), sampler.reserve).all()
    rectangle = Rectangle(sampler, places, t, columns.placements[0])
    everywhere = JointBox(np.full(6, -10.0), np.full(6, 10.0))
    rectangle.leave_out_collisions(everywhere)
    up, along = rectangle.missed(everywhere)
    assert (up == 0.0).all()
    assert (along == 0.0).all()


def test_no_edge_passes_a_row_where_the_part_cuts_into_the_wheel():
    _, sampler, columns = near_a_box()
    side = Side(1, above=(Barrier(20.5, 22.0, 1.0),))
    image, t = replace(columns.placements[0], side=side), np.linspace(-6.0, 6.0, 7)
    places = np.array([19.5, 20.0, 20.5, 21.0])
    everywhere = JointBox(np.full(6, -10.0), np.full(6, 10.0))
    rectangle = Rectangle(sampler, places, t, image)
    rows = rectangle.rows(rectangle.missed(everywhere)[0], 1e-6)
    shut = {row.contact_position: np.isnan(row.q[:, 0]).tolist() for row in rows}
    assert shut[0.0] == [False, False, True, True]
    assert shut[2.0] == [False] * 4
    below, above = np.array([[-1.0]] * 4), np.array([[1.0]] * 4)
    edges = shut_edges(places, np.hstack([below, above]), rows, everywhere)
    assert 2 * 4 + 1 in edges  # from below the row at 0 to above it, where it is shut
    assert not set(range(4)) & set(edges.tolist())  # from place 19.5 to 20 it is not
