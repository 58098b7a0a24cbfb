"""What is ground is recognised from configurations alone."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.files.resources import folder
from opl.geometry.frames import inverse
from opl.job.load import load_job
from opl.motion.motion import MoveKind
from opl.run.surfacing import cut_surface
from opl.verification.align import Course, align
from opl.verification.contact import (
    Touches,
    contact_positions,
    find_touches,
    misfit,
    near_wheel,
)
from opl.verification.contact_segments import ContactSegments, place_between
from opl.verification.recognise import Rule, recognise
from opl.verification.replay import replay
from tests.support.planned import (
    small_job,
    small_motion,
    small_problem,
    small_timed,
    tiny_motion,
    tiny_problem,
    tiny_timed,
    v_problem,
)

RULE = Rule(
    1e-4,
    small_job().search.interpolation.max_contact_step,
    small_job().process.approach_length,
    0.0,
    small_job().process.approach_run,
    small_job().process.feed,
)


def aligned(found, n_points):
    """Align touches of written configurations, one each second, with points of one pass."""
    nothing, written = np.zeros(n_points), np.ones(len(found), dtype=bool)
    course = Course(nothing.astype(int), nothing, nothing)
    return align(found, course, 1e-4, 1.0, written, found.configuration.astype(float))


def recognised(problem, q, duration=None):
    """Recognise configurations, all of them written."""
    time = np.ones(len(q)) if duration is None else duration
    return recognise(problem.cell, problem.points, q, time, np.arange(len(q)), RULE)


def test_the_labels_of_a_planned_motion_are_found_again():
    motion = small_motion()
    found = recognised(small_problem(), motion.q, small_timed().duration).timed.motion
    assert found.kind == motion.kind
    np.testing.assert_array_equal(found.pass_index, motion.pass_index)
    at_points = [k for k, s in enumerate(motion.kind) if s is MoveKind.GRIND]
    np.testing.assert_array_equal(found.cutter_point[at_points], motion.cutter_point[at_points])
    np.testing.assert_allclose(
        found.contact_position[at_points], motion.contact_position[at_points], atol=0.01
    )
    on_wheel = ~np.isnan(motion.cutter_point)
    np.testing.assert_array_equal(on_wheel, ~np.isnan(found.cutter_point))
    np.testing.assert_allclose(
        found.cutter_point[on_wheel], motion.cutter_point[on_wheel], atol=0.1
    )


def test_what_was_recognised_is_proven_by_the_same_replay():
    problem = tiny_problem()
    found = recognised(problem, tiny_motion().q, tiny_timed().duration)
    assert found.findings == ()
    assert replay(problem.cell, problem.points, found.timed, 1e-4).verified is not None


def about_an_edge():
    """Return where the part leans on an edge; flat on it, neighbours touch the same points."""
    motion, wheel = small_motion(), small_problem().cell.wheel
    at_edge = np.abs(motion.contact_position) > wheel.flat_end + 5.0
    grinds = [k for k, s in enumerate(motion.kind) if s is MoveKind.GRIND and at_edge[k]]
    return grinds[len(grinds) // 4]


def test_a_configuration_off_the_wheel_costs_its_cutter_point_alone():
    motion, problem, k = small_motion(), small_problem(), about_an_edge()
    q = motion.q.copy()
    q[k, 5] += 0.02
    found = recognised(problem, q, small_timed().duration)
    others = [p for p in range(len(problem.points)) if p != motion.cutter_point[k]]
    assert found.timed.motion.ground_points.tolist() == others
    assert found.timed.motion.kind[k] is MoveKind.BETWEEN
    assert any("off the contact model" in one.message for one in found.findings)


def test_nothing_is_recognised_where_nothing_is_ground():
    found = recognised(tiny_problem(), tiny_motion().q[:2]).timed.motion
    assert set(found.kind) == {MoveKind.HOME}
    assert (found.pass_index == -1).all()


def test_an_approach_from_the_side_is_no_approach():
    motion, problem = tiny_motion(), tiny_problem()
    k = next(k for k, s in enumerate(motion.kind) if s is MoveKind.APPROACH)
    q = motion.q.copy()
    q[k, 0] += 0.01
    found = recognised(problem, q, tiny_timed().duration).timed.motion
    assert found.kind[k] is MoveKind.HOME
    # the next one is now where the approach begins: the move to it is free
    assert found.kind[k + 1] is MoveKind.HOME
    assert found.kind[k + 2 : k + 4] == motion.kind[k + 2 : k + 4]


@pytest.mark.parametrize("t", [-69.0, -40.0, -25.0, -24.9, 0.0, 3.0, 25.0, 26.0, 70.0])
def test_contact_positions_are_those_of_the_contact_model(t):
    wheel = small_job().cell.wheel
    noise = np.eye(4)
    noise[:3, 3] = [2e-6, -3e-6, 1e-6]
    found = contact_positions(wheel, wheel.T_contact0_contact(t) @ noise)
    assert found == pytest.approx(t, abs=0.01)


@cache
def hollow():
    """Return wheel and cutter points of the S part; its hollow half is ground at an edge."""
    job = load_job(folder("workpieces") / "s_shape" / "job.yaml")
    return job.cell.wheel, cut_surface(job).points


def parts_at(wheel, points, place, t):
    """Return where the part is when places are ground at contact positions, seen from contact0."""
    return wheel.T_contact0_contact(np.asarray(t)) @ inverse(points.frames_at(np.asarray(place)))


def placed(wheel, points, Ts, duration, ends, t_ends):
    """Return places, contact positions and distances of one segment."""
    first, last = ends
    t_before, t_after = np.array(t_ends)[:, None]
    of_one = np.array([first]), last - first
    found = place_between(wheel, points, Ts[None], duration[None], of_one, (t_before, t_after))
    return tuple(one[0] for one in found)


def test_a_place_between_two_cutter_points_is_found():
    problem = small_problem()
    wheel, points = problem.cell.wheel, problem.points
    Ts = parts_at(wheel, points, [20.3], [12.5])
    found, position, apart = placed(wheel, points, Ts, np.ones(2), (20, 21), (12.5, 12.5))
    assert found[0] == pytest.approx(20.3, abs=1e-3)
    assert position[0] == pytest.approx(12.5, abs=0.01)
    assert apart[0] < 1e-6


@pytest.mark.parametrize("forwards", [True, False])
def test_a_pivot_through_the_hollow_is_followed(forwards):
    """On the way the part lies on the flat and on the edge of the wheel at once."""
    wheel, points = hollow()
    place = np.linspace(0.625, 0.6875, 8)
    t = np.linspace(-21.65, -27.7, 8)
    if not forwards:
        t = t[::-1]
    Ts = parts_at(wheel, points, place, t)
    # alone, a configuration may as well be a millimetre farther on
    again = Ts[:, None] @ points.frames_at(place[:, None] + np.linspace(0.1, 0.3, 401))
    distance, _ = misfit(wheel, again, contact_positions(wheel, again))
    assert distance.min() < 1e-5
    found, position, apart = placed(
        wheel, points, Ts, np.ones(9), (0, 1), (-15.6, -33.3) if forwards else (-33.3, -15.6)
    )
    np.testing.assert_allclose(found, place, atol=1e-3)
    np.testing.assert_allclose(position, t, atol=0.02)
    assert apart.max() < 2e-6


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.integers(0, 25),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12).map(sorted),
    st.floats(-69.0, 69.0),
    st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
)
def test_whatever_goes_forward_over_the_wheel_is_explained(point, fractions, start, changes):
    wheel, points = hollow()
    n = len(fractions)
    place = point + np.array(fractions)
    t = np.clip(start + np.cumsum(changes[:n]), -70.0, 70.0)
    Ts = parts_at(wheel, points, place, t)
    found, _, apart = placed(wheel, points, Ts, np.ones(n + 1), (point, point + 1), (t[0], t[-1]))
    assert (np.diff(found) >= 0.0).all()
    assert apart.max() < 1e-5


def test_segments_at_once_are_placed_as_one_by_one():
    wheel, points = hollow()
    first = np.array([3, 11, 24])
    place = first[:, None] + np.linspace(0.1, 0.8, 5)
    t = np.array([[-40.0, -3.0, 28.0], [-38.0, 2.0, 31.0]])
    Ts = parts_at(wheel, points, place, np.linspace(*t, 5, axis=1))
    duration = np.linspace(0.5, 2.0, 18).reshape(3, 6)
    at_once = place_between(wheel, points, Ts, duration, (first, 1), tuple(t))
    for k, point in enumerate(first):
        alone = placed(wheel, points, Ts[k], duration[k], (point, point + 1), t[:, k])
        for one, other in zip(at_once, alone, strict=True):
            np.testing.assert_array_equal(one[k], other)


def test_points_near_the_wheel_are_those_found_one_by_one(monkeypatch):
    wheel, points = hollow()
    Ts = parts_at(wheel, points, np.linspace(1.0, 40.0, 60), np.linspace(-60.0, 60.0, 60))
    monkeypatch.setattr("opl.verification.contact.AT_ONCE", 7 * len(points))
    configuration, point = near_wheel(wheel, points, Ts, 1e-3)
    p_workpiece = points.Ts_workpiece_cutter[:, :3, 3]
    expected = [
        (k, i)
        for k, T in enumerate(Ts)
        for i, p in enumerate(p_workpiece)
        if abs(wheel.signed_distance(T[:3, :3] @ p + T[:3, 3])) <= 1e-3
    ]
    assert len(expected) > len(Ts)
    assert list(zip(configuration.tolist(), point.tolist(), strict=True)) == expected


def test_what_goes_back_is_not_explained():
    wheel, points = hollow()
    Ts = parts_at(wheel, points, [3.2, 3.6, 3.3, 3.8], np.full(4, 30.0))
    found, _, apart = placed(wheel, points, Ts, np.ones(5), (3, 4), (30.0, 30.0))
    assert (np.diff(found) >= 0.0).all()
    step = np.linalg.norm(np.diff(points.Ts_workpiece_cutter[3:5, :3, 3], axis=0))
    assert apart[1:3].sum() > 0.25 * step  # it went back by 0.3 of the step


def test_of_several_touches_of_a_flat_the_one_is_taken_that_the_segments_around_it_fit():
    problem = small_problem()
    wheel, points = problem.cell.wheel, problem.points
    # a flat slides off the wheel's flat onto its edge: it touches point 26 three times
    place = [25.0, 25.9804, 25.9853, 25.9902, 26.0, 26.4, 27.0]
    t = [-23.7, 24.696, 24.943, 25.190, 25.684, 27.5, 29.7]
    found = find_touches(wheel, points, parts_at(wheel, points, place, t), 8e-5)
    at = [int(k) for k in np.flatnonzero(found.point == 26)]
    assert found.configuration[at].tolist() == [1, 3, 4]
    ends = [int(np.flatnonzero(found.point == n)[0]) for n in (25, 27)]
    segments = ContactSegments(wheel, points, parts_at(wheel, points, place, t), np.ones(7), found)
    assert segments.between(at[0], ends[1]).farthest > 1e-4
    settled = segments.settled(np.array([ends[0], at[0], ends[1]]), 1e-4)
    assert found.configuration[settled].tolist() == [0, 4, 6]


def test_a_flat_that_lies_on_the_wheel_with_many_points_is_ground_point_by_point_on_the_edge():
    problem = v_problem()
    wheel, points = problem.cell.wheel, problem.points
    # it begins to lie on the wheel's flat with points 4 to 7, but is ground past its edge
    place = np.arange(4.0, 8.5, 0.5)
    t = np.where(place == 4.0, -10.0, wheel.flat_end + 2.0)
    Ts = parts_at(wheel, points, place, t)
    found = find_touches(wheel, points, Ts, 8e-5)
    assert found.point[found.configuration == 0].tolist()[-4:] == [4, 5, 6, 7]
    first = [int(np.flatnonzero(found.point == n)[0]) for n in range(4, 9)]
    assert found.configuration[first].tolist() == [0, 0, 0, 0, 8]
    segments = ContactSegments(wheel, points, Ts, np.ones(len(Ts)), found)
    settled = segments.settled(np.array(first), 1e-4)
    assert found.configuration[settled].tolist() == [0, 2, 4, 6, 8]


def test_only_points_at_their_place_on_the_wheel_touch():
    problem = small_problem()
    wheel, points = problem.cell.wheel, problem.points
    T = wheel.T_contact0_contact(5.0) @ inverse(points.Ts_workpiece_cutter[20])
    lifted = T.copy()
    lifted[2, 3] -= 2e-4
    found = find_touches(wheel, points, np.stack([T, lifted]), 1e-4)
    assert 20 in found.point[found.configuration == 0]
    assert not (found.configuration == 1).any()


# alignment: a flat part touches in many places at once


def touches(*rows):
    configuration, point, t, distance = (np.array(column) for column in zip(*rows, strict=True))
    return Touches(configuration, point, t.astype(float), distance * 1e-5)


def test_of_many_touches_the_way_that_moves_least_is_taken():
    # the part lies flat on the wheel: each of three configurations touches all three points
    rows = [(k, i, 4.0 * (i - k), 0.0) for k in range(3) for i in range(3)]
    found = touches(*rows)
    chosen = aligned(found, 3)
    assert found.configuration[chosen].tolist() == [0, 1, 2]
    assert found.point[chosen].tolist() == [0, 1, 2]


def test_one_configuration_may_grind_two_points():
    found = touches((0, 0, 0.0, 0.0), (0, 1, 4.0, 0.0), (3, 2, 4.0, 0.0))
    assert len(aligned(found, 3)) == 3


def test_where_the_part_rests_a_pass_ends_and_not_on_the_retract():
    # five points lie along the flat while it rests; the retract leaves them by 0.024 mm and more
    rest = [(1, i, 4.0 - i, 0.3) for i in range(1, 6)]
    leaving = [(k, i, 4.0 - i, 2.4 * (k - 1)) for k in (2, 3) for i in range(1, 6)]
    found = touches((0, 0, 4.0, 0.0), *rest, *leaving)
    chosen = aligned(found, 6)
    assert found.configuration[chosen].tolist() == [0, 1, 1, 1, 1, 1]
    assert found.point[chosen].tolist() == list(range(6))


def test_order_is_kept_and_jumps_over_the_wheel_are_not_made():
    turned = touches((0, 0, 0.0, 0.0), (1, 2, 0.0, 0.0), (2, 1, 0.0, 0.0), (3, 3, 0.0, 0.0))
    assert len(aligned(turned, 4)) == 3
    jump = touches((0, 0, 0.0, 0.0), (1, 1, 9.0, 0.0), (2, 2, 0.0, 0.0))
    assert jump.point[aligned(jump, 3)].tolist() == [0, 2]


def test_nothing_aligned_is_nothing():
    nothing = Touches(*(np.empty(0, dtype=int) for _ in range(2)), np.empty(0), np.empty(0))
    assert len(aligned(nothing, 3)) == 0


def test_configurations_that_grind_several_points_are_repeated():
    motion, problem, k = small_motion(), small_problem(), about_an_edge()
    point = int(motion.cutter_point[k])
    Ts = problem.points.Ts_workpiece_cutter.copy()
    Ts[point + 1] = Ts[point]
    twice = replace(problem.points, Ts_workpiece_cutter=Ts)
    duration = small_timed().duration
    found = recognise(problem.cell, twice, motion.q, duration, np.arange(len(motion)), RULE)
    rows = np.flatnonzero(found.source == k)
    assert found.timed.motion.cutter_point[rows].tolist() == [point, point + 1]
    assert [found.timed.motion.kind[row] for row in rows] == [MoveKind.GRIND] * 2
    assert found.timed.duration[rows[1]] == 0.0
