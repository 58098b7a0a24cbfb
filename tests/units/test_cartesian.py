from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opl.cell.robot import forward_kinematics
from opl.errors import InputError, UnsafeError
from opl.geometry.frames import from_roll_pitch_yaw, pose
from opl.program.inform import parse, write_jobs
from opl.program.inform.cartesian import configurations, nameable, rconf_of, rectan_pose
from opl.program.inform.times import job_configurations
from opl.program.moves import Move, Program, plan_moves
from opl.program.profiles import DX200, NX100
from opl.program.settings import PositionForm, ProgramSettings, UserFrame
from tests.support.program_samples import DATE, ROBOT, verified_motion

T_FLANGE_TOOL = from_roll_pitch_yaw(np.deg2rad([10.0, 20.0, 30.0]), np.array([0.01, 0.0, 0.2]))
T_BASE_USER = pose(np.eye(3)[[1, 2, 0]], np.array([1.0, 0.2, -0.3]))


def write(q, profile=DX200, **changes):
    moves = tuple(
        Move(configuration, 0.1, True, False, k) for k, configuration in enumerate(np.atleast_2d(q))
    )
    form = ProgramSettings(positions=PositionForm.BASE, T_flange_tool=T_FLANGE_TOOL, tool=5)
    program = Program("ANY", moves=moves)
    files = write_jobs(program, ROBOT, replace(form, **changes), profile, DATE).files
    return files["ANY.JBI"]


SHARES = st.lists(st.floats(0.02, 0.98), min_size=6, max_size=6)


@settings(max_examples=100)
@given(SHARES)
def test_a_configuration_is_among_those_its_pose_and_rconf_name(shares):
    q = ROBOT.lower + np.array(shares) * (ROBOT.upper - ROBOT.lower)
    if abs(q[4]) < 0.05 or min(abs(abs(q[[0, 3, 5]]) - np.pi)) < 0.01:
        return
    found = configurations(ROBOT, forward_kinematics(ROBOT, q), rconf_of(ROBOT, q))
    assert np.abs(found - q).max(axis=1).min() < 1e-6


@pytest.mark.parametrize(
    ("q_deg", "expected"),
    [
        # saved by controllers for a hand that points down in front of the arm
        ((0, -40, 1, 0, -130, 0), (1, 0, 0, 0, 0, 0)),
        ((0, -40, 1, 0, 50, 0), (0, 0, 0, 0, 0, 0)),
        ((0, 0, 0, 190, -60, 0), (1, 0, 0, 1, 0, 0)),
        ((0, 0, 0, 0, -60, -200), (1, 0, 0, 0, 1, 0)),
        ((0, -90, 150, 0, -60, 0), (1, 0, 1, 0, 0, 0)),
        ((0, 90, 150, 0, -60, 0), (1, 1, 0, 0, 0, 0)),
    ],
)
def test_rconf_of_known_configurations(q_deg, expected):
    assert rconf_of(ROBOT, np.deg2rad(q_deg)) == expected


@pytest.mark.parametrize("form", [PositionForm.BASE, PositionForm.ROBOT, PositionForm.USER])
@pytest.mark.parametrize("profile", [DX200, NX100])
def test_cartesian_job_leads_to_the_configurations_it_was_made_of(form, profile):
    frame = UserFrame(7, T_BASE_USER) if form is PositionForm.USER else None
    T_base_frame = T_BASE_USER if frame else np.eye(4)
    q = np.array([move.q for move in plan_moves(verified_motion(), "A", ROBOT.max_speed).moves])
    job = parse(write(q, profile, positions=form, user_frame=frame))
    seen = job_configurations(job, ROBOT, T_base_frame, T_FLANGE_TOOL)
    np.testing.assert_allclose(seen, q, atol=4e-4 if profile is NX100 else 4e-6)
    written = T_base_frame @ rectan_pose(job.positions[3].values)
    np.testing.assert_allclose(
        written[:3, 3], (forward_kinematics(ROBOT, q[3]) @ T_FLANGE_TOOL)[:3, 3], atol=1e-6
    )


def test_cartesian_job_says_what_its_positions_are():
    text = write(verified_motion().motion.q[0], positions=PositionForm.USER,
                 user_frame=UserFrame(7, T_BASE_USER))  # fmt: skip
    head = text.split("C00000=")[0].split("\r\n")
    assert head[4:9] == [
        "///USER 7",
        "///TOOL 5",
        "///POSTYPE USER",
        "///RECTAN",
        "///RCONF 1,0,0" + 21 * ",0",
    ]
    assert "///ATTR SC,RW,RJ\r\n////FRAME USER 7\r\n///GROUP1 RB1" in text
    assert "///RCONF 1,0,0,0,0,0,0,0\r\n" in write(verified_motion().motion.q[0], NX100)


def test_rconf_is_written_where_it_changes_only():
    q = np.deg2rad([[0, 0, 0, 0, -60, k] for k in (170, 175, 185, 190, 170)])
    lines = [line for line in write(q).split("\r\n") if line.startswith("///RCONF")]
    assert [line[9:20] for line in lines] == ["1,0,0,0,0,0", "1,0,0,0,1,0", "1,0,0,0,0,0"]


def test_configuration_that_the_controller_could_mistake_is_refused():
    with pytest.raises(UnsafeError, match=r"joint T from -310\.0 deg"):
        write(np.deg2rad((0, 0, 0, 0, -60, 410)))


@pytest.mark.parametrize(
    ("joint", "angle", "written"),
    [
        (5, 180.0, 179.985),
        (5, -180.0, -179.985),
        (5, 180.004, 180.015),
        (5, -179.996, -179.985),
        (5, 180.02, 180.02),
        (0, 180.0, 179.985),  # the limit of S
        (3, -180.0, -179.985),
    ],
)
def test_joint_at_half_a_turn_is_written_beside_it(joint, angle, written):
    q = np.deg2rad([0.0, 0.0, 0.0, 0.0, -60.0, 0.0])
    q[joint] = np.deg2rad(angle)
    job = parse(write(q))
    seen = job_configurations(job, ROBOT, np.eye(4), T_FLANGE_TOOL)[0]
    assert np.rad2deg(seen[joint]) == pytest.approx(written, abs=2e-4)
    assert job.positions[0].rconf[{3: 3, 5: 4, 0: 5}[joint]] == (abs(written) > 180.0)
    rest = np.arange(6) != joint
    np.testing.assert_allclose(seen[rest], q[rest], atol=4e-6)


def test_what_can_be_named_is_clear_of_half_a_turn_and_of_other_turns():
    angles = [0, 179.0, 179.96, 180.04, 181.0, 200.0, 264.0, 266.0, 410.0, -181.0, -410.0]
    q = np.zeros((len(angles), 6))
    q[:, 5] = np.deg2rad(angles)
    found = nameable(q, ROBOT, np.deg2rad(0.05))
    # T turns to 455 either way: from 265 on, the same pose is beyond half a turn at -455, too
    assert found.tolist() == [True, True, False, False, True, True, True, False, False, True, False]
    assert not nameable(q[[1, 4]], ROBOT, np.deg2rad(3.0)).any()


@pytest.mark.parametrize(("bend", "no_flip"), [(60, 0), (-60, 1)])
def test_flip_is_the_configuration_with_b_not_negative(bend, no_flip):
    text = write(np.deg2rad([0, 0, 0, 0, bend, 0]))
    assert f"///RCONF {no_flip},0,0,0,0,0" in text and "NOT VERIFIED" not in text


@pytest.mark.parametrize(("number", "profile"), [(64, DX200), (25, NX100)])
def test_user_frame_the_controller_does_not_have_is_refused(number, profile):
    with pytest.raises(InputError, match=r"user_frame: must be 1 to"):
        write(verified_motion().motion.q[0], profile, positions=PositionForm.USER,
              user_frame=UserFrame(number, T_BASE_USER))  # fmt: skip
