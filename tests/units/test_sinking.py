"""What is spared for tracks along which the part sinks too deep between two places."""

from dataclasses import replace

import numpy as np

from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import inverse
from opl.least import box_nodes, box_track, sinking
from opl.least.box_nodes import TrackSearch
from opl.least.box_track import BoxTracks
from opl.least.passages import NO_PASSAGES
from opl.least.rows import Row
from opl.least.sinking import (
    HARDLY,
    MORE,
    leads_are_deep,
    places_between,
    places_for,
    shallower,
    spare_for,
    struck_between,
    sunk_between,
)
from opl.motion.collision_check import CollidingMove
from opl.motion.motion import Phase
from opl.planning.costs import PushAway
from opl.planning.multi_start import tracks_from_best_start
from opl.planning.open_matrix import open_matrices
from opl.planning.track_check import Collides, check_track
from opl.search.smooth import Travel
from tests.support.boxes import near_a_box
from tests.support.planned import small_problem, v_job


def motion_of_a_track():
    """Return a problem, the motion of a track, and its moves along the passes."""
    problem = small_problem()
    matrices = open_matrices(problem)
    for track in tracks_from_best_start(matrices):
        found = check_track(problem, matrices[track.matrix].nodes, track.rows)
        if hasattr(found, "motion"):
            break
    phases = found.motion.phase
    return problem, found.motion, [k for k, one in enumerate(phases) if one is Phase.GRINDING]


def test_moves_that_sink_are_those_between_their_columns():
    problem, motion, grinding = motion_of_a_track()
    approach = grinding[0] - 1
    faults = [CollidingMove(k, (PART, WHEEL), False) for k in [approach, *grinding]]
    sunk = sunk_between(problem, Collides(motion, tuple(faults)))
    assert (sunk[~problem.off_wheel] > 0.0).all()
    assert (sunk[problem.off_wheel] == 0.0).all()
    others = [CollidingMove(k, ("R_link", WHEEL), False) for k in grinding]
    assert not sunk_between(problem, Collides(motion, tuple(others))).any()


def test_a_lead_that_sinks_counts_beside_its_end_of_the_pass():
    problem, motion, grinding = motion_of_a_track()
    last = np.flatnonzero(problem.off_wheel)[0]  # of the first pass
    leaves = grinding[np.flatnonzero(np.diff(grinding) > 1)[0]] + 1
    assert [motion.phase[k] for k in (grinding[0] - 1, leaves)] == [
        Phase.APPROACHING, Phase.RETRACTING,
    ]  # fmt: skip
    for move, edge in ((grinding[0] - 1, 0), (leaves, last - 1)):
        faults = (CollidingMove(move, (PART, WHEEL), False),)
        assert np.flatnonzero(sunk_between(problem, Collides(motion, faults))).tolist() == [edge]


def test_leads_are_deep_where_they_sink_themselves_and_by_more_than_places_help(monkeypatch):
    problem, motion, grinding = motion_of_a_track()

    def deep(move):
        fault = CollidingMove(move, (PART, WHEEL), False)
        return leads_are_deep(problem, {(b"", b""): Collides(motion, (fault,))})

    assert not deep(grinding[0] - 1)
    monkeypatch.setattr(sinking, "DEEP", 0.0)
    assert deep(grinding[0] - 1)
    assert not deep(grinding[1])


def test_bodies_are_struck_between_two_columns_not_at_them_and_not_off_the_wheel():
    problem, motion, grinding = motion_of_a_track()
    there = motion.cutter_point[grinding]
    between = [k for k, place in zip(grinding, there, strict=True) if place != np.rint(place)]
    assert between
    pair = ("R_link", WHEEL)
    at_columns = [CollidingMove(k, pair, True) for k in grinding if k not in between]
    off = CollidingMove(grinding[0] - 1, pair, False)
    sinks = CollidingMove(between[0], (PART, WHEEL), False)
    none = Collides(motion, (*at_columns, off, sinks))
    assert not struck_between(problem, {(b"", b""): none}).any()
    faults = [CollidingMove(between[0], pair, True), CollidingMove(grinding[-1], pair, False)]
    each = {(b"", bytes([k])): Collides(motion, (fault,)) for k, fault in enumerate(faults)}
    struck = np.flatnonzero(struck_between(problem, each))
    assert struck.tolist() == [int(motion.cutter_point[between[0]]), len(problem.points) - 2]


def test_depth_is_spared_at_both_ends_and_where_it_is_of_no_use_places_are_taken_in():
    sunk = np.array([0.0, 4e-6, 0.0, 0.0])
    places = np.array([0.0, 1.0, 1.5, 2.0, 3.0])
    spare = spare_for(places, np.zeros(5), sunk)
    np.testing.assert_allclose(spare, [0.0, 5e-6, 5e-6, 0.0, 0.0])
    # places beside, close together, would be next
    close = np.array([0.94, 1.0, 1.01, 1.08, 1.2])
    np.testing.assert_allclose(spare_for(close, spare, sunk), 5e-6 * np.array([1, 2, 2, 1, 0]))
    assert shallower(sunk, None)
    assert shallower(np.array([3e-6, 1e-6, 0.0, 0.0]), sunk)
    assert not shallower(np.array([0.0, 4e-6, 0.0, 0.0]), sunk)
    assert [(one.first, one.last, one.parts) for one in places_for(places, sunk)] == [(1.0, 1.5, 2)]
    assert not places_for(np.array([0.0, 1.0, 1.001, 2.0, 3.0]), sunk)


def test_what_sinks_deeper_is_cut_into_more_parts_and_what_hardly_does_is_spared_a_little_more():
    places = np.arange(5.0)
    sunk = HARDLY * np.array([0.1, 9.0, 30.0, 1e4])
    assert [one.parts for one in places_for(places, sunk)] == [2, 3, 6, 8]
    struck = np.array([False, True, False, True])
    told = [(one.first, one.last, one.parts) for one in places_between(places, struck)]
    assert told == [(1.0, 2.0, 2), (3.0, 4.0, 2)]
    spare = spare_for(places, np.zeros(5), sunk[:1].repeat(4) * [1, 0, 0, 0])
    np.testing.assert_allclose(spare, [HARDLY, HARDLY, 0.0, 0.0, 0.0])


def distances(columns):
    """Return the distance of the part to the wheel in [m], far away too, shape (n, m)."""
    problem = small_problem()
    wheel, frames = problem.cell.wheel, problem.points.frames_at(columns.places)
    Ts = wheel.T_contact0_contact(columns.t) @ inverse(frames)[:, None]
    return signed_wheel_distance(problem.scene.part, wheel, Ts, 1.0)


def test_nodes_leave_the_depth_that_is_spared():
    _, sampler, columns = near_a_box()
    depth = small_problem().cell.planned_penetration
    distance = distances(columns)
    spare = np.where(np.arange(len(distance)) % 2 == 0, depth + np.median(distance), 0.0)
    found = sampler.spared(columns, spare)
    wanted = columns.free & ((distance >= spare[:, None] - depth) | (spare == 0.0)[:, None])
    np.testing.assert_array_equal(found.free, wanted)
    assert 0 < found.free[::2].sum() < columns.free[::2].sum()


def test_where_a_box_leaves_no_depth_to_spare_tracks_are_sought_in_the_next_that_does(monkeypatch):
    problem, settings = small_problem(), v_job().search.optimal
    box, sampler, columns = near_a_box()
    edge, needed = 29, 402.5e-6  # of depth, more than there is near the box at both its places
    sunk = np.zeros(len(problem.points) - 1)
    sunk[edge] = needed / MORE
    spare = spare_for(columns.places, np.zeros(len(columns.places)), sunk)
    assert not sampler.spared(columns, spare).free[edge].any()
    checked = []

    def check(sampled, track, learn):
        q = sampled.matrices[track.matrix].nodes.along(track.rows)
        t = sampled.matrices[track.matrix].nodes.t_along(track.rows)
        at = replace(columns, t=t[:, None])
        checked.append((q, distances(at)[edge : edge + 2] + problem.cell.planned_penetration))
        return None, sunk if len(checked) == 1 else None, False

    monkeypatch.setattr(box_nodes.BoxNodes, "check", check)
    push_away = PushAway(problem.cell, settings.costs)
    most = Travel(np.inf, np.inf)
    search = TrackSearch(problem, sampler, settings.costs, most, push_away)
    tracks = BoxTracks(search)
    tracks.plan(columns, NO_PASSAGES, box, 1e-3, lambda _: False)
    (_, before), (q, spared), *_ = checked
    assert before.min() < needed
    assert spared.min() >= needed - 1e-9
    assert box.size < np.ptp(q, axis=0).sum() < 1.05 * box.size


def test_where_depth_can_be_spared_in_a_larger_box_only_places_are_wanted_first(monkeypatch):
    problem, settings = small_problem(), v_job().search.optimal
    box, sampler, columns = near_a_box()
    edge, needed = 29, 402.5e-6  # of depth: there is so much only in a box that is larger
    sunk = np.zeros(len(problem.points) - 1)
    sunk[edge] = needed / MORE
    free = object()

    def check(sampled, track, learn):
        checked.append(sampled.spare[edge])
        return (None, sunk, False) if len(checked) == 1 else (free, None, False)

    monkeypatch.setattr(box_nodes.BoxNodes, "check", check)
    push_away, most = PushAway(problem.cell, settings.costs), Travel(np.inf, np.inf)
    for new, found in ((True, None), (False, free)):
        checked, told = [], []

        def learn(bulges, checked=checked, told=told, new=new):
            # first asked as the part sinks so deep, then as what spares that needs room
            told += [(bulge.first, bulge.last) for bulge in bulges if checked]
            return new and told == [(edge, edge + 1)] * 2

        tracks = BoxTracks(TrackSearch(problem, sampler, settings.costs, most, push_away))
        assert tracks.plan(columns, NO_PASSAGES, box, 1e-3, learn) is found
        assert told[:2] == [(edge, edge + 1)] * 2
        assert len(checked) == (1 if found is None else 2)


def test_a_track_past_rows_that_sinks_wants_no_places(monkeypatch):
    problem, settings = small_problem(), v_job().search.optimal
    box, sampler, columns = near_a_box()
    smoothest, answers = box_nodes.BoxNodes.smoothest, []
    sinks = places_for(columns.places, np.full(len(columns.places) - 1, 1e-6))

    def check(sampled, track, learn):
        answers.append(learn(sinks))
        return None, None, answers[-1]

    def unless_rows(sampled):
        return None if sampled._rows else smoothest(sampled)

    monkeypatch.setattr(box_nodes.BoxNodes, "check", check)
    monkeypatch.setattr(box_nodes.BoxNodes, "smoothest", unless_rows)
    monkeypatch.setattr(box_track, "bars", lambda *_: [])
    push_away, most = PushAway(problem.cell, settings.costs), Travel(np.inf, np.inf)
    tracks = BoxTracks(TrackSearch(problem, sampler, settings.costs, most, push_away))
    for rows in ([], [Row(columns.places[:2], 0.0, np.full((2, 6), np.nan))]):
        answers.clear()
        passages = replace(NO_PASSAGES, rows=rows)
        assert tracks.plan(columns, passages, box, 1e-3, lambda told: told is sinks) is None
        assert answers[0] == (not rows)
