"""The cycle time of a program: closed forms of its ramps, and what it is made of."""

from dataclasses import replace

import numpy as np
import pytest

from opl.program.actions import Actions, Call, Dwell, WaitInput
from opl.program.cycle import cycle_time
from opl.program.inform import write_jobs
from opl.program.moves import Move, Program, Purpose, plan_moves
from opl.program.profiles import DX200
from opl.program.settings import ByKind, ProgramSettings
from tests.support.program_samples import DATE, MAX_SPEED, ROBOT, verified_motion

SLOW = replace(ROBOT, max_acceleration=np.full(6, 2.0))
PLAIN = ProgramSettings()


def program(*turns, actions=()):
    """Return free moves of the first joint with a stop after each: (turn [rad], time [s])."""
    q = np.zeros(6)
    moves = [Move(q, 0.05, True, False, 0)]
    for k, (turn, time) in enumerate(turns, start=1):
        q = q + turn * np.eye(6)[0]
        moves.append(Move(q, 0.1, True, False, k, duration=time))
    moves[-1] = replace(moves[-1], actions=tuple(actions))
    return Program("A", moves=tuple(moves))


def test_between_two_stops_the_ramps_of_the_trapezoid_are_added():
    found = cycle_time(program((1.0, 2.0), (-0.6, 1.0)), {}, SLOW, PLAIN)
    # speed over acceleration, once for coming up and going down: 0.5 / 2 and 0.6 / 2
    assert found.ramps == pytest.approx(0.25 + 0.3, rel=1e-3)
    assert found.air == pytest.approx(3.0 + 0.55, rel=1e-3)
    assert (found.passes, found.leads, found.waits) == (0.0, 0.0, 0.0)
    assert found.total == pytest.approx(found.air)


def test_a_ramp_slowed_by_the_program_takes_that_much_longer():
    half = ProgramSettings(acceleration=ByKind(air=50), deceleration=ByKind(air=100))
    found = cycle_time(program((1.0, 2.0)), {}, SLOW, half)
    assert found.ramps == pytest.approx(0.5, rel=1e-3)
    elsewhere = ProgramSettings(acceleration=ByKind(on_wheel=50))
    assert cycle_time(program((1.0, 2.0)), {}, SLOW, elsewhere).ramps == pytest.approx(0.25, 1e-3)


def test_written_times_count_where_they_differ_from_the_wanted_ones():
    found = cycle_time(program((1.0, 2.0)), {1: 2.01}, SLOW, PLAIN)
    assert found.total == pytest.approx(2.01 + 0.25, rel=1e-3)


def test_waits_count_and_what_nobody_knows_is_said():
    timers = cycle_time(program((1.0, 2.0), actions=[Dwell(1.5)]), {}, SLOW, PLAIN)
    assert timers.waits == 1.5 and not timers.open_ended
    assert timers.total == pytest.approx(timers.air + 1.5)
    for unknown in (WaitInput(1, True), Call("OTHER")):
        assert cycle_time(program((1.0, 2.0), actions=[unknown]), {}, SLOW, PLAIN).open_ended


def test_a_program_that_goes_nowhere_takes_no_time():
    assert cycle_time(program(), {}, SLOW, PLAIN).total == 0.0


def test_the_parts_of_a_grinding_program_add_up_to_its_written_times_and_ramps():
    settings = ProgramSettings(actions=Actions(before_pass=(Dwell(0.5),)))
    planned = plan_moves(verified_motion(), "A", MAX_SPEED, actions=settings.actions)
    written = write_jobs(planned, ROBOT, settings, DX200, DATE)
    found = cycle_time(planned, written.times, ROBOT, settings)
    at_speed = sum(written.times[move.motion_index] for move in planned.moves[1:])
    assert found.total == pytest.approx(at_speed + found.ramps + 2 * 0.5)
    assert found.waits == 1.0 and found.ramps > 0.0
    ground = [m for m in planned.moves if m.kind is Purpose.WHEEL]
    assert found.passes >= sum(written.times[move.motion_index] for move in ground)
    # the quicker the joints, the nearer to the written speeds
    quick = replace(ROBOT, max_acceleration=100.0 * ROBOT.max_acceleration)
    assert cycle_time(planned, written.times, quick, settings).ramps < 0.05 * found.ramps


def test_the_time_of_every_part_is_told_in_order():
    planned = plan_moves(verified_motion(), "A", MAX_SPEED)
    written = write_jobs(planned, ROBOT, PLAIN, DX200, DATE)
    found = cycle_time(planned, written.times, ROBOT, PLAIN)
    names = [part.part.value for part in found.parts]
    one = ["approach", "pass", "retract"]
    assert names == ["from_home", *one, "link", *one, "to_home"]
    assert [part.pass_index for part in found.parts] == [0, 0, 0, 0, 1, 1, 1, 1, -1]
    assert all(part.seconds > 0.0 for part in found.parts)
    for purpose, members in (
        (found.passes, {"pass"}),
        (found.leads, {"approach", "retract"}),
        (found.air, {"from_home", "link", "to_home"}),
    ):
        total = sum(part.seconds for part in found.parts if part.part.value in members)
        assert total == pytest.approx(purpose)
