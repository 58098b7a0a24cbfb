from dataclasses import replace

import numpy as np
import pytest

from opl.cell.robot import forward_kinematics
from opl.geometry.frames import rotation_angle
from opl.program.inform import parse, write_jobs
from opl.program.inform.times import job_configurations
from opl.program.led import HandTool
from opl.program.lines import stray, with_straight_moves
from opl.program.moves import Purpose, plan_moves
from opl.program.profiles import DX200
from opl.program.settings import ProgramSettings
from tests.support.program_samples import DATE, MAX_SPEED, ROBOT, verified_motion

T_FLANGE_TOOL = np.eye(4)
LED = HandTool(T_FLANGE_TOOL)
CORNERS = np.array(np.meshgrid(*([-0.1, 0.1],) * 3)).reshape(3, -1).T


def straight(tolerance=1e-3):
    program = plan_moves(verified_motion(n_points=40), "SAMPLE", MAX_SPEED)
    return with_straight_moves(program, ROBOT, LED, CORNERS, tolerance)


def test_moves_on_the_wheel_and_along_its_normal_become_straight_and_no_others():
    for move in straight(tolerance=0.1).moves[1:]:
        assert move.straight == (move.kind is not Purpose.AIR)


def test_moves_that_stray_too_far_stay_joint_moves():
    assert not any(move.straight for move in straight(tolerance=0.0).moves)
    program = straight()
    strays = stray(ROBOT, np.array([m.q for m in program.moves]), LED, CORNERS)
    for move, distance in zip(program.moves[1:], strays, strict=True):
        assert not move.straight or distance <= 1e-3


def test_stray_is_what_the_two_paths_are_apart_half_way():
    q = np.deg2rad([[0, 0, 0, 0, -60, 0], [20, 0, 0, 0, -60, 0]])
    wrist = np.zeros((1, 3))
    radius = np.hypot(*forward_kinematics(ROBOT, q[0])[:2, 3])
    sagitta = radius * (1.0 - np.cos(np.deg2rad(10.0)))
    assert stray(ROBOT, q, LED, wrist)[0] == pytest.approx(sagitta)
    assert stray(ROBOT, q[[0, 0]], LED, CORNERS)[0] == pytest.approx(0.0)


def test_speed_of_straight_moves_gives_each_its_wanted_time():
    program = straight()
    written = write_jobs(program, ROBOT, ProgramSettings(), DX200, DATE)
    (text,) = written.files.values()
    job = parse(text)
    q = job_configurations(job, ROBOT, np.eye(4), T_FLANGE_TOOL)
    p = forward_kinematics(ROBOT, q)[:, :3, 3] * 1e3
    lines = [k for k, move in enumerate(job.moves) if move.word == "MOVL"]
    assert len(lines) > 70
    for k in lines:
        move = job.moves[k]
        assert 0.1 <= float(move.tag("V")) <= 1500.0
        time = np.linalg.norm(p[k] - p[k - 1]) / float(move.tag("V"))
        assert time == pytest.approx(program.moves[k].duration, rel=0.2)
    assert all(abs(one.error) < 0.02 for one in written.pass_times)


def test_tool_point_that_only_turns_gets_its_speed_in_degrees():
    q = np.deg2rad([[0, 0, 0, 0, -60, 0], [0, 0, 0, 0, -60, 6]])
    first, second, *_ = straight().moves
    moves = (
        replace(first, q=q[0]),
        replace(second, q=q[1], duration=2.0, straight=True, kind=Purpose.WHEEL),
    )
    program = replace(straight(), moves=moves)
    (text,) = write_jobs(program, ROBOT, ProgramSettings(), DX200, DATE).files.values()
    move = parse(text).moves[1]
    assert (move.word, move.tag("V"), move.tag("VR")) == ("MOVL", None, "3.0")
    assert rotation_angle(*forward_kinematics(ROBOT, q)) == pytest.approx(np.deg2rad(6.0))
