"""A motion as a value: what its moves are, and what is taken from it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.motion.motion import Motion, MoveKind, Phase, TimedMotion, VerifiedMotion
from tests.support.program_samples import verified_motion


def motion_of(kinds, passes):
    """Return a motion of (kind, pass) whose joints count its configurations."""
    places = [float(k) if kind.on_wheel else np.nan for k, kind in enumerate(kinds)]
    q = np.repeat(np.arange(len(kinds), dtype=float)[:, None], 6, axis=1)
    return Motion(q, tuple(kinds), np.array(places), np.array(places), np.array(passes, dtype=int))


@st.composite
def motions(draw):
    """Any order of kinds and passes: a motion read back from a program may be in any."""
    count = draw(st.integers(1, 30))
    kinds = draw(st.lists(st.sampled_from(MoveKind), min_size=count, max_size=count))
    passes = draw(st.lists(st.integers(-1, 2), min_size=count, max_size=count))
    return motion_of(kinds, passes)


def times_of(motion):
    return np.random.default_rng(len(motion)).uniform(0.0, 1.0, len(motion))


def test_phases_of_a_whole_motion_in_order():
    motion = verified_motion(n_passes=2).motion
    free, down, grind, up = Phase.FREE, Phase.APPROACHING, Phase.GRINDING, Phase.RETRACTING
    assert [phase for phase, _ in motion.runs()] == [*[free, down, grind, up] * 2, free]


def test_the_move_onto_the_wheel_is_approaching_and_so_is_one_from_pass_to_pass():
    kinds = (MoveKind.HOME, MoveKind.GRIND, MoveKind.BETWEEN, MoveKind.GRIND, MoveKind.GRIND)
    motion = motion_of(kinds, (-1, 0, 0, 0, 1))
    assert motion.phase == (
        Phase.FREE,
        Phase.APPROACHING,
        Phase.GRINDING,
        Phase.GRINDING,
        Phase.APPROACHING,
    )
    assert motion.ends_phase.tolist() == [True, True, False, True, True]
    assert [run.tolist() for _, run in motion.runs()] == [[1], [2, 3], [4]]


@given(motions())
def test_a_move_grinds_if_it_begins_and_ends_on_the_wheel_in_one_pass(motion):
    for k in range(len(motion)):
        both = k > 0 and motion.kind[k - 1].on_wheel and motion.kind[k].on_wheel
        expected = both and motion.pass_index[k - 1] == motion.pass_index[k]
        assert motion.grinding[k] == expected
        assert motion.free[k] == (motion.kind[k] in (MoveKind.HOME, MoveKind.LINK))
        assert motion.on_wheel[k] == (not np.isnan(motion.cutter_point[k]))


@given(motions())
def test_every_move_is_in_one_run_and_runs_end_where_a_phase_does(motion):
    runs = list(motion.runs())
    moves = [int(move) for _, run in runs for move in run]
    assert moves == list(range(1, len(motion)))
    assert motion.ends_phase[-1]
    for phase, run in runs:
        assert {motion.phase[move] for move in run} == {phase}
        assert not motion.ends_phase[run[:-1]].any()
        if phase is not Phase.FREE:
            assert motion.ends_phase[run[-1]]
            assert len(set(motion.pass_index[run])) == 1


@given(motions(), st.data())
def test_taking_rows_and_times_keeps_what_they_are(motion, data):
    rows = sorted(data.draw(st.sets(st.integers(0, len(motion) - 1), min_size=1)))
    timed = TimedMotion(motion, times_of(motion))
    taken = timed.take(rows)
    np.testing.assert_array_equal(taken.motion.q[:, 0], rows)
    assert taken.motion.kind == tuple(motion.kind[row] for row in rows)
    np.testing.assert_array_equal(taken.motion.cutter_point, motion.cutter_point[rows])
    # nothing of the time up to the last of them is lost
    assert taken.seconds == pytest.approx(timed.duration[: rows[-1] + 1].sum())


@given(motions(), st.data())
def test_inserted_configurations_are_of_the_kind_of_their_move(motion, data):
    before = sorted(data.draw(st.lists(st.integers(0, len(motion) - 1), max_size=5)))
    longer = motion.with_inserted(before, np.full((len(before), 6), -1.0))
    new = longer.q[:, 0] == -1.0
    np.testing.assert_array_equal(longer.q[~new], motion.q)
    kept = longer.take(np.flatnonzero(~new))
    assert kept.kind == motion.kind
    np.testing.assert_array_equal(kept.pass_index, motion.pass_index)
    led_to = [k + int(np.argmin(new[k:])) for k in np.flatnonzero(new)]
    assert longer.q[led_to, 0].tolist() == before
    assert [longer.kind[k] for k in np.flatnonzero(new)] == [longer.kind[k] for k in led_to]


@given(st.lists(motions(), min_size=1, max_size=4))
def test_joined_motions_come_apart_again(parts):
    whole = Motion.joined(parts)
    ends = np.cumsum([len(part) for part in parts])
    for part, end in zip(parts, ends, strict=True):
        again = whole.take(np.arange(end - len(part), end))
        assert again.kind == part.kind
        for name in ("q", "contact_position", "cutter_point", "pass_index"):
            np.testing.assert_array_equal(getattr(again, name), getattr(part, name))


def test_off_the_wheel_there_is_no_contact():
    motion = Motion.off_wheel(np.zeros((3, 6)), MoveKind.RETRACT, 4)
    assert motion.kind == (MoveKind.RETRACT,) * 3
    assert motion.pass_index.tolist() == [4, 4, 4]
    assert np.isnan(motion.contact_position).all() and np.isnan(motion.cutter_point).all()


def test_cutter_points_that_get_fractional_numbers_are_between_two():
    motion = verified_motion(n_passes=1).motion
    assert motion.ground_points.tolist() == [0, 1, 2, 3]
    halved = motion.renumbered(motion.cutter_point / 2.0)
    assert halved.ground_points.tolist() == [0, 1]
    np.testing.assert_array_equal(halved.on_wheel, motion.on_wheel)
    back = halved.renumbered(halved.cutter_point * 2.0)
    assert back.kind == motion.kind


def test_places_are_named_as_people_look_for_them():
    motion = verified_motion().motion
    named = [motion.place(k) for k in range(len(motion))]
    assert named[:5] == [
        "free move from home",
        "free move from home",
        "approach of pass 1",
        "approach of pass 1",
        "pass 1, cutter point 0",
    ]
    assert named[-1] == "free move to home"
    assert {"link of pass 2", "retract of pass 2", "pass 1, cutter point 0.5"} <= set(named)


def test_a_motion_is_a_read_only_copy():
    q = np.zeros((2, 6))
    motion = Motion.off_wheel(q, MoveKind.HOME, -1)
    q[0, 0] = 9.0
    assert motion.q[0, 0] == 0.0
    duration = np.ones(2)
    timed = TimedMotion(motion, duration)
    duration[0] = 9.0
    assert timed.seconds == 2.0
    for array in (motion.q, timed.duration):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_a_motion_with_a_missing_value_is_refused():
    motion = Motion.off_wheel(np.zeros((2, 6)), MoveKind.HOME, -1)
    timed = TimedMotion(motion, np.zeros(2))
    with pytest.raises(ValueError, match="kind has 1 items for 2 configurations"):
        Motion(motion.q, (MoveKind.HOME,), *[np.full(2, np.nan)] * 2, np.full(2, -1))
    with pytest.raises(ValueError, match="duration has 3 items for 2 configurations"):
        TimedMotion(motion, np.zeros(3))
    with pytest.raises(ValueError, match="clearance has 1 items for 2 configurations"):
        VerifiedMotion(timed, np.zeros(1))
