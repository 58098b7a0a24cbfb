from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opl.errors import OplError, PassTimeError
from opl.program.inform import parse, write_jobs
from opl.program.moves import Purpose, plan_moves
from opl.program.posts import pass_times
from opl.program.profiles import DX200, NX100
from opl.program.pulses import PulseScale
from opl.program.settings import ProgramSettings
from opl.program.speeds import SpeedRange, speeds_keeping_time
from tests.support.program_samples import DATE, MAX_SPEED, ROBOT, slowed, verified_motion

VJ = SpeedRange(0.01, 100.0, 2)


def pass_times_of(text, program):
    """Recompute the time of each pass from the text of a pulse job alone."""
    job = parse(text)
    q = PulseScale.of(ROBOT).to_angles(np.array([p.values for p in job.positions]))
    speed = np.array([float(move.tag("VJ")) / 100.0 for move in job.moves])
    times = (np.abs(np.diff(q, axis=0)) / MAX_SPEED).max(axis=1) / speed[1:]
    sums = {}
    for move, time in zip(program.moves[1:], times, strict=True):
        if move.ground_pass is not None:
            sums[move.ground_pass] = sums.get(move.ground_pass, 0.0) + time
    return [sums[k] for k in sorted(sums)]


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0.01"), (0.014, "0.01"), (5.0, "5.00"), (100.4, "100.00")]
)
def test_speed_is_written_with_its_decimals_and_in_its_range(value, text):
    assert VJ.text(value) == text


def test_nearest_in_time_is_chosen_not_nearest_in_speed():
    # 0.0146 would round to 0.01, which is 46 % too slow; 0.02 is 27 % too fast
    assert VJ.keeping_time(distance=0.0146, time=1.0) == 0.02


@given(st.lists(st.tuples(st.floats(0.02, 100.0), st.floats(0.01, 5.0)), min_size=1, max_size=60))
def test_a_chain_is_never_off_by_more_than_one_of_its_moves(moves):
    ways = [speed * time for speed, time in moves]
    times = [time for _, time in moves]
    chained = [False] + [True] * (len(moves) - 1)
    speeds = speeds_keeping_time(ways, times, [VJ] * len(moves), chained)
    assert abs((np.array(ways) / speeds).sum() - sum(times)) <= max(times)


def test_chains_do_not_make_up_for_each_other():
    speeds = speeds_keeping_time([0.014] * 4, [1.0] * 4, [VJ] * 4, [False, True, False, True])
    assert speeds.tolist() == [*speeds[:2], *speeds[:2]]


@pytest.mark.parametrize("factor", [1.0, 5.0, 20.0, 50.0])
@pytest.mark.parametrize("profile", [DX200, NX100])
def test_each_pass_keeps_its_time_within_two_percent_read_from_the_file(factor, profile):
    program = plan_moves(slowed(verified_motion(n_points=60), factor), "SAMPLE", MAX_SPEED)
    written = write_jobs(program, ROBOT, ProgramSettings(), profile, DATE)
    seen = pass_times_of(written.files["SAMPLE.JBI"], program)
    for one, recomputed in zip(written.pass_times, seen, strict=True):
        assert one.written == pytest.approx(recomputed)
        assert abs(one.error) < 0.02
        assert one.wanted == pytest.approx(5.9 * factor)


def test_pass_that_cannot_be_slow_enough_is_refused_with_both_times():
    program = plan_moves(slowed(verified_motion(), 300.0), "SAMPLE", MAX_SPEED)
    with pytest.raises(OplError, match=r"pass 1 would take .* s instead of .* s: DX200"):
        write_jobs(program, ROBOT, ProgramSettings(), DX200, DATE)


def test_a_lead_that_no_speed_is_low_enough_for_is_refused():
    program = plan_moves(verified_motion(n_passes=1), "SAMPLE", MAX_SPEED)
    times = {move.motion_index: move.duration or 0.0 for move in program.moves}
    assert len(pass_times(program, times, "DX200")) == 1
    last = next(move for move in reversed(program.moves) if move.kind is Purpose.LEAD)
    moves = [replace(one, duration=2.0) if one is last else one for one in program.moves]
    times[last.motion_index] = 1.5  # as slow as can be written
    with pytest.raises(PassTimeError, match=r"pass 1 would take 1\.50 s instead of 2\.00 s"):
        pass_times(replace(program, moves=tuple(moves)), times, "DX200")
