"""Postures of places between cutter points, and what they tell of a box."""

import numpy as np

from opl.cell.robot import forward_kinematics
from opl.planning.field_at_places import FieldAtPlaces
from opl.planning.postures import BESIDE
from opl.planning.rectangle import Rectangle
from opl.search.box import JointBox
from tests.support.boxes import near_a_box
from tests.support.planned import small_problem


def test_the_flange_is_where_the_place_is_ground_at_each_contact_position():
    problem = small_problem()
    cell, t, field = problem.cell, problem.field.contact_positions, FieldAtPlaces(problem)
    _, _, columns = near_a_box()
    family = columns.placements[0].family
    places = np.array([3.0, 3.25, 4.0, 7.875])
    wanted = cell.Ts_base_flange(t, problem.points.frames_at(places)[:, None])
    # asked for twice: as they are found, and as they are known
    for q in (field.at(places, family), field.at(places[::-1], family)[::-1]):
        reached = ~np.isnan(q[..., 0])
        assert reached.sum() > 100
        flange = forward_kinematics(cell.robot, q[reached])
        np.testing.assert_allclose(flange, wanted[reached], atol=1e-9)


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
