"""Speeds held against places that are known to a fraction of a millimetre only."""

from dataclasses import replace

import numpy as np

from opl.geometry.toolpath import CutterPoints
from opl.job.refusals import rest_refusal
from opl.motion.motion import Motion, MoveKind, TimedMotion
from opl.motion.timing import Cause, Timing
from opl.program.played import Corner, Playback, ReadMove, SpeedUnit, WrittenSpeed
from opl.proof.speeds import pass_findings, speed_findings
from tests.support.planned import small_problem

FEED = 0.02  # [m/s]
NOWHERE = np.full(6, np.nan)
SLOWEST = WrittenSpeed(SpeedUnit.TOP_SPEED, 1e-4, "VJ=0.01", 1e-4)


def found(wanted, takes, distance, cause=Cause.NEIGHBOUR, digits=None):
    """Return what is told of the moves of a pass that end between two cutter points.

    Their speeds are written as times, with last digits in [s].
    """
    told = of_moves(wanted, takes, distance, times(digits or [0.0] * len(wanted)), cause)
    return [message for message in told if "times the feed" in message]  # not the pass as a whole


def times(digits):
    """Return speeds that are written as times with last digits in [s]."""
    return [WrittenSpeed(SpeedUnit.SECONDS, 1.0, "1 s", digit) for digit in digits]


def of_moves(wanted, takes, distance, written_speeds, cause=Cause.NEIGHBOUR, straight=False):
    """Return all that is told of such moves and their pass, their speeds as written."""
    n = len(wanted) + 2
    kinds = (MoveKind.GRIND, *[MoveKind.BETWEEN] * (n - 1))
    q = np.linspace(0.0, 0.1, n)[:, None] * np.ones(6)
    motion = Motion(
        q, kinds, np.linspace(0.0, 5.0, n), np.linspace(0.0, 0.9, n), np.zeros(n, dtype=np.int64)
    )
    asked = TimedMotion(motion, np.array([0.0, 1.0, *wanted]))
    written = TimedMotion(motion, np.array([0.0, 1.0, *takes]))
    timing = Timing(
        asked, np.array([0.0, 1.0 * FEED, *distance]), (cause,) * n, np.full(n, -1), 1.0
    )
    speeds = [*times([0.0, 0.0]), *written_speeds]
    moves = tuple(
        ReadMove(q[0], straight, speed, Corner(1.0, "1"), "", f"line {k}", NOWHERE)
        for k, speed in enumerate(speeds)
    )
    playback = Playback(q, written.duration, np.arange(n), moves, ())
    return [one.message for one in speed_findings(written, timing, playback, FEED)]


def test_a_move_shorter_than_places_are_known_is_not_too_fast():
    # of the V part: 0.022 mm planned in 1.3 ms, written as 0.9 ms, recognised as 0.028 mm
    assert not found([0.0016], [0.0009], [2.8e-5])


def test_many_such_moves_are_as_fast_as_one_long_move():
    assert found([0.1], [0.05], [1e-3]) == ["2 times the feed that the job asks for"]
    assert found([0.004] * 25, [0.002] * 25, [4e-5] * 25)


def test_a_speed_of_few_digits_that_others_make_up_for_is_named():
    (message,) = found([3.0, 0.3], [2.0, 0.9], [6e-2, 6e-3], digits=[1.0, 0.01])
    assert message == (
        "0.33 times the feed that the job asks for; one more in the last digit of its speed "
        "changes the 2 s of line 2 by 1 s: a higher process.feed_mm_s, or program.motion: "
        "straight, may help"
    )


def test_the_slowest_speed_there_is_is_named_where_that_is_too_fast():
    speeds = [SLOWEST, *times([0.01])]
    first, of_the_pass = of_moves([3.0, 0.3], [2.0, 0.3], [6e-2, 6e-3], speeds)
    assert "ahead of the feed that the job asks for; line 2 takes 2 s at the slowest " in first
    assert first.endswith(
        "speed there is, 3 s were wanted: a higher process.feed_mm_s, or program.motion: "
        "straight, may help"
    )
    assert of_the_pass.startswith("takes 3.30 s, 4.30 s at the feed")


def test_moves_that_are_straight_are_not_proposed_to_be():
    first, _ = of_moves([3.0, 0.3], [2.0, 0.3], [6e-2, 6e-3], times([1.0, 0.01]), straight=True)
    assert first.endswith("by 1 s: a higher process.feed_mm_s may help")


def test_the_slowest_speed_is_coarse_where_it_is_slow_enough():
    message, _ = of_moves([3.0, 0.4], [3.2, 0.05], [6e-2, 8e-3], [SLOWEST, *times([0.01])])
    assert message.startswith("8 times the feed that the job asks for; one more in the last digit ")
    assert "changes the 3.2 s of line 2 by 1.6 s" in message


def test_a_speed_is_not_to_blame_where_its_last_digit_is_little_of_the_move_that_is_off():
    (message,) = found([3.0, 0.3], [3.0, 0.1], [6e-2, 6e-3], digits=[0.05, 0.01])
    assert message == "3 times the feed that the job asks for"


def test_a_slow_neighbour_excuses_no_more_than_any_other_limit():
    for cause in (Cause.NEIGHBOUR, Cause.PIVOTING, Cause.SPEED):
        assert found([1.0], [0.72], [1e-2], cause)


def test_a_pass_of_less_time_on_the_wheel_than_its_way_takes_is_told():
    points = CutterPoints(np.tile(np.eye(4), (2, 1, 1)), np.zeros(2, int), np.array([0.0, 0.1]))
    kinds = (MoveKind.HOME, MoveKind.GRIND, MoveKind.GRIND, MoveKind.RETRACT)
    place, zeros = np.array([np.nan, 0.0, 1.0, np.nan]), np.zeros(4, dtype=np.int64)
    motion = Motion(np.arange(4.0)[:, None] * np.ones(6), kinds, place, place, zeros)
    at_feed = TimedMotion(motion, np.array([0.0, 1.0, 5.0, 1.0]))
    assert list(pass_findings(at_feed, points, FEED)) == []
    late = TimedMotion(motion, np.array([0.0, 1.0, 0.5, 5.5]))  # rests before it leaves the wheel
    (found,) = pass_findings(late, points, FEED)
    assert found.message == "0.50 s of moves on the wheel, 5.00 s at the feed"
    process = replace(small_problem().process, feed=FEED)
    assert rest_refusal(at_feed, points, process) is None
    rests = TimedMotion(motion, np.array([0.0, 1.0, 0.0, 6.0]))
    for timed, takes in ((late, "0.50"), (rests, "0.00")):
        (reason,) = rest_refusal(timed, points, process).reasons
        assert reason == f"pass 1: {takes} s of moves on the wheel, 5.00 s at the feed"
