"""The feed, measured from the bytes of written programs with nothing of what wrote their speeds.

Each language is read here anew: the number that sets the speed of a move, and what that number
means on the controller. How far the ground point moves is known from the cutter points.
"""

import re

import numpy as np
import pytest

from opl.cell.robot import forward_kinematics
from opl.job.load import load_job
from opl.motion.timing import Cause
from opl.program.settings import MotionForm
from tests.support.jobs import GONE, write_job
from tests.support.small_programs import ARMS, small_program

AS_WANTED = 0.05  # of the feed


def leading_joint(robot, start, end):
    """Return the time at top speed of the joint that takes longest."""
    return np.max(np.abs(end - start) / robot.max_speed)


def tool_point(program, start, end):
    """Return how far the tool point in the hand moves in [m]."""
    ends = forward_kinematics(program.job.cell.robot, np.stack([start, end]))
    places = (ends @ program.job.program.T_flange_tool)[:, :3, 3]
    return np.linalg.norm(places[1] - places[0])


def inform_times(program, q):
    speeds = re.findall(r"^MOV[JL] C\d+ (VJ|V)=([0-9.]+)", program.text, re.M)
    for (word, number), start, end in zip(speeds[1:], q[:-1], q[1:], strict=True):
        if word == "VJ":
            yield leading_joint(program.job.cell.robot, start, end) / (float(number) / 100.0)
        else:
            yield tool_point(program, start, end) / (float(number) / 1000.0)


def over_part(program, start, end):
    """Return how far the origin of contact frame 0 of the wheel moves over the part in [m]."""
    cell = program.job.cell
    ends = forward_kinematics(cell.robot, np.stack([start, end])) @ cell.T_flange_workpiece
    places = [np.linalg.solve(T, cell.wheel.T_base_contact0[:, 3])[:3] for T in ends]
    return np.linalg.norm(places[1] - places[0])


def rapid_times(program, q):
    found = re.findall(r"(?:\\T:=([0-9.]+)|\[([0-9.]+),500,5000,1000\]), \w+, ", program.text)
    for (seconds, millimetres), start, end in zip(found, q[:-1], q[1:], strict=True):
        yield (
            float(seconds) if seconds else over_part(program, start, end) * 1e3 / float(millimetres)
        )


def krl_times(program, q):
    found = re.findall(
        r"(?:BAS\(#VEL_PTP, (\d+)\)|\$VEL\.CP = ([0-9.]+))\s+(?:PTP|LIN) ", program.text
    )
    for (percent, metres), start, end in zip(found[1:], q[:-1], q[1:], strict=True):
        if percent:
            yield leading_joint(program.job.cell.robot, start, end) / (float(percent) / 100.0)
        else:
            yield tool_point(program, start, end) / float(metres)


def fanuc_times(program, q):
    """A straight move has a time, or with RTCP a speed of the origin of its frame over the part."""
    found = re.findall(r" (\d+)(msec|mm/sec) (?:FINE|CNT100)( RTCP)?", program.text)
    for (number, unit, remote), start, end in zip(found, q[:-1], q[1:], strict=True):
        assert remote or unit == "msec"
        length = over_part(program, start, end) if unit == "mm/sec" else 1.0
        yield length * 1e3 / float(number) if unit == "mm/sec" else float(number) / 1e3


def ur_times(program, q):
    yield from (float(time) for time in re.findall(r", t=([0-9.]+),", program.text))


TIMES = {
    "DX200": inform_times,
    "RAPID": rapid_times,
    "KRL": krl_times,
    "FANUC": fanuc_times,
    "URSCRIPT": ur_times,
}
# KRL has joint speeds of whole percents: too coarse, and not written unless a job insists
FORMS = [
    (name, motion) for name in sorted(ARMS) for motion in ("joint", "straight")
    if (name, motion) != ("KRL", "joint")
] + [("FANUC", "stationary")]  # fmt: skip


def feeds(program):
    """Return the feed of each move that nothing but the feed limits, as a fraction of the wanted.

    From one written configuration to the next; that no joint and no pivoting slows the move down is
    what the planner's timing says.
    """
    timing, feed = program.run.proven.planned.timing, program.job.process.feed
    rows = [move.motion_index for move in program.run.program.moves]
    q = program.run.proven.motion.motion.q[rows]
    times = list(TIMES[program.job.program.controller](program, q))
    assert len(times) == len(rows) - 1
    found = []
    # the timing knows the written configurations only
    rows = np.searchsorted(program.run.proven.motion.motion.positions, rows)
    for before, row, time in zip(rows, rows[1:], times, strict=False):
        between = range(before + 1, row + 1)
        if all(timing.timed.motion.grinding[k] and timing.cause[k] is Cause.NONE for k in between):
            found.append(timing.surface_distance[between].sum() / time / feed)
    assert len(found) > 5
    return np.array(found)


@pytest.mark.parametrize(("controller", "motion"), FORMS)
def test_feed_of_a_written_file_is_the_wanted_one_wherever_no_joint_limits_it(controller, motion):
    found = feeds(small_program(controller, motion=motion))
    np.testing.assert_allclose(found, 1.0, atol=AS_WANTED)


def test_whole_percents_are_too_coarse_and_so_krl_is_straight_unless_a_job_insists(tmp_path):
    assert np.abs(feeds(small_program("KRL")) - 1.0).max() > 4 * AS_WANTED
    keys = {
        "robot": "kr16",
        "program.controller": "KRL",
        "program.accept_unverified_pulses": GONE,
    }
    assert load_job(write_job(tmp_path, keys)).program.motion is MotionForm.STRAIGHT
    assert load_job(write_job(tmp_path)).program.motion is MotionForm.JOINT


@pytest.mark.parametrize(
    ("controller", "motion", "pattern", "at_least"),
    [
        ("RAPID", "straight", r"MoveL .*\[[0-9.]+,500,5000,1000\], ", 80),
        # whole mm/s: the others have their time
        ("FANUC", "stationary", r"L P\[\d+\] \d+mm/sec (?:FINE|CNT100) RTCP", 40),
    ],
)
def test_stationary_tool_point_is_the_cutter_point_where_the_contact_stays_in_the_middle(
    controller, motion, pattern, at_least
):
    """So the speed of a move in the file is the feed over the surface there."""
    program = small_program(controller, motion=motion)
    q = program.run.proven.planned.prepared.fixed.q
    frames = program.job.program.led.frames(forward_kinematics(program.job.cell.robot, q))
    wanted = program.points.Ts_workpiece_cutter[:, :3, 3]
    np.testing.assert_allclose(frames[:, :3, 3], wanted, atol=1e-9)
    assert len(re.findall(pattern, program.text)) > at_least


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (" RTCP", "", "RTCP goes with straight moves"),
        ("% FINE", "% FINE RTCP", "RTCP goes with straight moves"),
        ("UFRAME_NUM=1", "UFRAME_NUM=2", "is of user frame 1, UFRAME_NUM 2"),
        ("UF : 1, UT", "UF : 2, UT", "is of user frame 2, UFRAME_NUM 1"),
        ("mm/sec CNT100 RTCP", "mm/sec CNT100", "RTCP goes with straight moves"),
    ],
)
def test_remote_tcp_that_is_not_that_of_the_job_is_found(old, new, message):
    program = small_program("FANUC", motion="stationary")
    assert not program.read(program.text).findings
    assert old in program.text
    found = program.read(program.text.replace(old, new, 1)).findings
    assert any(message in str(finding) for finding in found), found


def test_a_program_wholly_in_another_user_frame_moves_past_another_tool():
    program = small_program("FANUC", motion="stationary")
    text = program.text.replace("UFRAME_NUM=1", "UFRAME_NUM=2").replace("UF : 1,", "UF : 2,")
    found = program.read(text).findings
    assert "tool 0 in user frame 2; the job's is 0 in user frame 1" in str(found[0])


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("opl_wheel := [FALSE,[[", "opl_wheel := [FALSE,[[1", "is not what the job"),
        ("wobjdata opl_part := [TRUE", "wobjdata opl_part := [FALSE", "is not what the job"),
        ("LOCAL PERS wobjdata opl_part", "! LOCAL PERS wobjdata opl_part", "is missing"),
        ("VAR bool", "LOCAL PERS loaddata other := [1,[0,0,1],[1,0,0,0],0,0,0];\n  VAR bool",
         "nothing of that name"),
        ("opl_wheel\\WObj:=opl_part;", "tool0;", "moves with tool tool0"),
    ],
)  # fmt: skip
def test_other_stationary_tools_than_that_of_the_job_are_found(old, new, message):
    program = small_program("RAPID", motion="straight")
    assert not program.read(program.text).findings
    assert old in program.text
    found = program.read(program.text.replace(old, new, 1)).findings
    assert any(message in str(finding) for finding in found), found
