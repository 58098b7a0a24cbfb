from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from opl.errors import OplError, UnsafeError
from opl.motion.motion import MoveKind, TimedMotion, VerifiedMotion
from opl.motion.repeats import named_once
from opl.program.actions import Actions, Remark
from opl.program.moves import START_SPEED, Move, Program, plan_moves
from opl.program.split import split
from tests.support.program_samples import HOME, JOINT_NAMES, MAX_SPEED, verified_motion, with_times


def plan(verified, **changes):
    return plan_moves(verified, "SAMPLE", MAX_SPEED, joint_names=JOINT_NAMES, **changes)


def shortened(verified, indices):
    timed = verified.timed
    return VerifiedMotion(
        TimedMotion(timed.motion.take(indices), timed.duration[indices]),
        verified.clearance[indices],
    )


@pytest.mark.parametrize("motion", [verified_motion().motion, None, "motion"])
def test_only_a_verified_motion_becomes_a_program(motion):
    with pytest.raises(TypeError, match="made of a VerifiedMotion, got"):
        plan(motion)


def test_every_distinct_configuration_is_a_move_and_a_repeated_one_is_none():
    verified = verified_motion()
    program = plan(verified)
    q = verified.motion.q
    repeated = [i for i in range(1, len(q)) if np.array_equal(q[i], q[i - 1])]
    assert len(repeated) == 2  # the first cutter point of each pass
    assert [m.motion_index for m in program.moves] == [
        i for i in range(len(q)) if i not in repeated
    ]
    for move in program.moves:
        np.testing.assert_array_equal(move.q, q[move.motion_index])


def test_slow_drift_is_not_lost_by_dropping_small_steps():
    verified = verified_motion()
    drift = np.linspace(0.0, 1e-5, 101)[:, None] * np.ones(6)
    rows = shortened(verified, [0] * 101)
    moving = with_times(rows, np.r_[0.0, np.full(100, 0.1)], HOME + drift)
    q = np.array([move.q for move in plan(moving).moves])
    distance = np.abs(moving.motion.q[:, None] - q[None]).max(axis=-1).min(axis=1)
    assert distance.max() <= 1e-6


def test_played_at_its_speeds_the_program_takes_the_time_of_the_motion():
    timed = verified_motion().timed
    program = plan(verified_motion())
    q = np.array([move.q for move in program.moves])
    speed = np.array([move.speed for move in program.moves])
    times = (np.abs(np.diff(q, axis=0)) / MAX_SPEED).max(axis=1) / speed[1:]
    assert times.sum() == pytest.approx(timed.seconds)


def test_time_of_a_repeated_configuration_goes_to_the_move_that_follows():
    verified = verified_motion()
    motion = verified.motion
    duration = verified.timed.duration.copy()
    (repeated, *_) = [i for i in range(1, len(motion)) if (motion.q[i] == motion.q[i - 1]).all()]
    duration[repeated] = 0.05
    before = {m.motion_index: m.speed for m in plan(verified).moves}
    after = {m.motion_index: m.speed for m in plan(with_times(verified, duration)).moves}
    assert after[repeated + 1] == pytest.approx(before[repeated + 1] / 2)


def test_first_move_is_slow_and_comes_to_rest():
    first = plan(verified_motion()).moves[0]
    assert first.speed == START_SPEED
    assert first.exact_stop


def test_robot_stops_at_home_and_off_the_wheel_and_never_on_it():
    verified = verified_motion(n_passes=1)
    stops = [(m.motion_index, m.exact_stop, m.on_wheel) for m in plan(verified).moves]
    assert stops == [
        (0, True, False),  # home
        (1, True, False),  # above the wheel
        (2, False, False),  # half way of the approach
        (3, False, True),  # the approach ends where the pass begins
        (5, False, True),
        (6, False, True),
        (7, False, True),
        (8, False, True),  # the pass ends
        (9, False, False),
        (10, True, False),
        (11, True, False),  # home
    ]


def test_robot_goes_on_at_first_contact_even_if_the_approach_ends_short_of_it():
    verified = verified_motion(n_passes=1)
    kept = [i for i in range(len(verified.motion)) if i != 3]
    short = shortened(verified, kept)
    duration = short.timed.duration.copy()
    duration[3] = 0.1
    moves = plan(with_times(short, duration)).moves
    assert short.motion.kind[3] is MoveKind.GRIND
    assert moves[3].on_wheel and not any(move.exact_stop for move in moves if move.on_wheel)


def test_robot_stops_at_a_sharp_corner_off_the_wheel():
    verified = shortened(verified_motion(), [0] * 4)
    corner = HOME + np.array([[0.0, 0.0], [0.1, 0.0], [0.2, 0.001], [0.2, 0.1]]) @ np.eye(2, 6)
    moves = plan(with_times(verified, [0.0, 1.0, 1.0, 1.0], corner)).moves
    assert [move.exact_stop for move in moves] == [True, False, True, True]


def test_comments_name_the_passes_and_home():
    comments = [move.comment for move in plan(verified_motion()).moves if move.comment]
    assert comments == ["HOME", "PASS 1", "PASS 2", "HOME"]


@pytest.mark.parametrize("duration", [0.0, 0.01])
def test_move_faster_than_a_joint_is_refused_by_name(duration):
    times = verified_motion().timed.duration.copy()
    times[1] = duration
    with pytest.raises(
        UnsafeError, match=r"configuration 1 \(home\): joint S would need (inf|1\d{3})"
    ):
        plan(with_times(verified_motion(), times))


def test_too_fast_joint_is_named_where_others_stand_still():
    still = shortened(verified_motion(), [0, 0])
    q = HOME + np.array([np.zeros(6), [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]])
    with pytest.raises(UnsafeError, match="joint U would need inf"):
        plan(with_times(still, [0.0, 0.0], q))


def test_move_keeps_its_own_read_only_configuration():
    q = HOME.copy()
    move = Move(q, 0.1, True, False, 0)
    q[0] = 9.0
    assert move.q[0] == HOME[0]
    with pytest.raises(ValueError, match="read-only"):
        move.q[0] = 9.0


def test_program_that_fits_is_not_split():
    program = plan(verified_motion())
    assert split(program, len(program.moves)) == (program,)


def test_parts_together_are_the_program_and_the_master_calls_each():
    program = plan(verified_motion(n_passes=30))
    master, *parts = split(program, 40)
    assert master.moves == ()
    assert master.calls == tuple(part.name for part in parts)
    assert master.calls[:2] == ("SAMPLE01", "SAMPLE02")
    assert all(len(part.moves) <= 40 for part in parts)
    joined = [*parts[0].moves, *(move for part in parts[1:] for move in part.moves[1:])]
    assert joined == list(program.moves)


def test_parts_begin_and_end_standing_still_off_the_wheel():
    _, *parts = split(plan(verified_motion(n_passes=30)), 40)
    for before, part in pairwise(parts):
        entry, last = part.moves[0], before.moves[-1]
        np.testing.assert_array_equal(entry.q, last.q)
        assert entry.speed == START_SPEED
        assert last.exact_stop and not last.on_wheel


def test_more_than_99_parts_keep_their_order_when_sorted_by_name():
    master, *_ = split(plan(verified_motion(n_passes=130)), 14)
    assert len(master.calls) > 99
    assert master.calls[0] == "SAMPLE001"
    assert sorted(master.calls) == list(master.calls)


def test_pass_too_long_for_a_job_is_refused_with_its_size():
    program = plan(verified_motion(n_passes=1, n_points=50))
    with pytest.raises(OplError, match=r"configurations 2 to 56 take \d+ moves .* a job holds 20"):
        split(program, 20)


def test_program_without_moves_is_left_alone():
    assert split(Program("EMPTY"), 1) == (Program("EMPTY"),)


def by_pass(n_passes, **changes):
    """Return the parts of a motion that comes home between its passes."""
    return split(plan(verified_motion(n_passes, home_between=True), **changes), 2000, by_pass=True)


@pytest.mark.parametrize("n_passes", [1, 3])
def test_each_pass_is_a_part_from_home_to_home_on_request(n_passes):
    program = plan(verified_motion(n_passes, home_between=True))
    master, *parts = by_pass(n_passes)
    start, *passes, end = parts
    assert master.calls == tuple(f"SAMPLE{k:02d}" for k in range(n_passes + 2))
    assert master.moves == ()
    assert passes[-1].comments[-1] == f"PASS {n_passes} OF {n_passes}"
    for part in parts:
        for move in (part.moves[0], part.moves[-1]):
            np.testing.assert_array_equal(move.q, HOME)
            assert move.exact_stop and not move.on_wheel
        assert part.moves[0].duration is None and part.moves[0].speed == START_SPEED
    for index, part in enumerate(passes):
        assert {m.ground_pass for m in part.moves if m.ground_pass is not None} == {index}
        assert [m.comment for m in part.moves if m.comment] == ["HOME", f"PASS {index + 1}", "HOME"]
    assert len(start.moves) == len(end.moves) == 1
    # in order they are the program
    rest = [*start.moves, *(move for part in passes for move in part.moves[1:])]
    assert [m.motion_index for m in rest] == [m.motion_index for m in program.moves]


def test_what_is_done_at_both_ends_is_in_no_pass_that_could_be_left_out():
    actions = Actions(*((Remark(word),) for word in ("START", "BEFORE", "AFTER", "END")))
    _, *parts = by_pass(2, actions=actions)
    done = [[a.text for m in part.moves for a in m.actions] for part in parts]
    assert done == [["START"], ["BEFORE", "AFTER"], ["BEFORE", "AFTER"], ["END"]]


def test_a_pass_too_long_for_a_job_of_its_own_is_refused():
    with pytest.raises(OplError, match=r"pass 1 takes \d+ moves, a job holds 5"):
        split(plan(verified_motion(2, home_between=True)), 5, by_pass=True)


def test_time_of_standing_still_where_a_pass_ends_goes_to_the_move_before():
    verified = verified_motion(n_passes=1)
    motion, q, duration = verified.motion, verified.motion.q.copy(), verified.timed.duration.copy()
    last = int(np.flatnonzero(motion.grinding)[-1])
    q[last], duration[last] = q[last - 1], 0.7
    standing = with_times(verified, duration, q)
    moves = {move.motion_index: move for move in plan(standing).moves}
    assert last - 1 not in moves
    assert moves[last].duration == pytest.approx(duration[last - 1] + 0.7)
    assert moves[last].ground_pass == 0
    assert moves[last + 1].duration == pytest.approx(duration[last + 1])


def test_configurations_that_repeat_one_on_the_wheel_are_named_once():
    motion = verified_motion(n_passes=1).motion
    ground = np.flatnonzero(motion.grinding)
    q = motion.q.copy()
    q[ground[1]] = q[ground[0]]  # within the pass: the first is named
    q[ground[-1]] = q[ground[-2]]  # where it ends: the last
    named = named_once(replace(motion, q=q))
    assert set(motion.positions) - set(named.positions) == {ground[1], ground[-2]}
