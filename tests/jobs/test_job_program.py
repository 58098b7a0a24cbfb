from pathlib import Path

import numpy as np
import pytest

from opl.errors import (
    InputError,
    OplError,
    PassTimeError,
    SettingError,
    TimeLawError,
    UnsafeError,
)
from opl.files.documents import read
from opl.job.program import ProgramSection
from opl.job.refusals import keys_named
from opl.job.source import Source
from opl.program.actions import Actions, Call, Dwell, Remark, SetOutput, WaitInput
from opl.program.export import try_out
from opl.program.inform import TEMPLATE
from opl.program.led import StationaryTool
from opl.program.moves import Purpose
from opl.program.settings import ByKind, MotionForm, PositionForm, ProgramSettings
from tests.support.program_samples import HOME, ROBOT, UNVERIFIED

EYE = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 180], [0, 0, 0, 1]]"


AT_WHEEL = StationaryTool(np.eye(4), np.eye(4))


def settings(tmp_path, text, robot=ROBOT):
    path = tmp_path / "job.yaml"
    path.write_text(text)
    source = Source.of_file(path)
    section = read(path, ProgramSection)
    counted = section.robot_as_counted(source, robot)
    return section.in_si(source, "SAMPLE", counted, HOME, AT_WHEEL, None)


def test_nothing_asked_for_is_a_pulse_job_of_joint_moves(tmp_path):
    found = settings(tmp_path, "{}")
    assert (found.controller, found.motion, found.positions) == (
        "DX200", MotionForm.JOINT, PositionForm.PULSES
    )  # fmt: skip
    assert found.levels == ByKind(1, 1, 1) and found.acceleration == ByKind()
    assert found.accepted_pulses == () and found.template is None and found.corner_radii == {}
    np.testing.assert_array_equal(found.T_flange_tool, np.eye(4))


def test_every_key_reaches_the_program_in_si(tmp_path):
    (tmp_path / "own.j2").write_text(TEMPLATE.read_text())
    found = settings(
        tmp_path,
        f"""
        controller: YRC1000
        tool: 3
        T_flange_tool_mm: {EYE}
        motion: straight
        positions: user
        user_frame: {{number: 2, T_base_user_mm: {EYE}}}
        accept_unverified_pulses: [T]
        position_levels: {{on_wheel: 2, lead: none, free_move: 8}}
        corner_radius_mm: {{on_wheel: 2.5}}
        acceleration_percent: {{on_wheel: 50}}
        deceleration_percent: {{free_move: 30}}
        comment: PART 4711
        at_start: [{{comment: BELT MUST RUN}}]
        before_pass:
          - {{output: 12, state: on}}
          - {{wait_input: 3, state: off, timeout_s: 2.5}}
        after_pass: [{{dwell_s: 0.5}}]
        at_end: [{{call: PARK}}]
        template: own.j2
        """,
    )
    assert found.T_flange_tool[2, 3] == 0.18
    assert found.user_frame.number == 2 and found.user_frame.T_base_user[2, 3] == 0.18
    assert (found.tool, found.title) == (3, "PART 4711")
    assert found.levels == ByKind(2, None, 8)
    assert found.corner_radii == {Purpose.WHEEL: 0.0025}
    assert (found.acceleration, found.deceleration) == (ByKind(on_wheel=50), ByKind(air=30))
    assert found.actions.at_start == (Remark("BELT MUST RUN"),)
    assert found.actions.before_pass == (SetOutput(12, True), WaitInput(3, False, 2.5))
    assert found.actions.after_pass == (Dwell(0.5),)
    assert found.actions.at_end == (Call("PARK"),)
    assert found.template == tmp_path / "own.j2"


def test_stationary_tool_stands_at_the_wheel_or_in_the_user_frame_of_the_job(tmp_path):
    straight = "motion: straight\ncontroller: "
    assert settings(tmp_path, straight + "RAPID").stationary is AT_WHEEL
    assert settings(tmp_path, straight + "RAPID\nstationary_tool: false").stationary is None
    assert settings(tmp_path, straight + "FANUC").stationary is None
    fanuc = straight + "FANUC\nstationary_tool: true"
    found = settings(tmp_path, fanuc)
    assert found.user_frame.number == 1
    np.testing.assert_array_equal(found.stationary.T_base_tool, AT_WHEEL.T_base_tool)
    found = settings(tmp_path, fanuc + f"\nuser_frame: {{number: 4, T_base_user_mm: {EYE}}}")
    assert found.user_frame.number == 4 and found.stationary.T_base_tool[2, 3] == 0.18


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("controller: DX300", "controller: unknown controller 'DX300'; known: DX100, DX200"),
        ("accept_unverified_pulses: [Z]", "no such joint 'Z'; have: S, L, U, R, B, T"),
        ("tool: 64", "program.tool: must be 0 to 63, got 64"),
        (
            f"positions: user\nuser_frame: {{number: 64, T_base_user_mm: {EYE}}}",
            "program.user_frame.number: must be 1 to 63, got 64",
        ),
        ("user_frame: {number: 2}", "user_frame goes with positions: user only"),
        (
            "motion: straight\nstationary_tool: true",
            "stationary_tool: must not be true: Yaskawa DX200 .INFORM. has none that public",
        ),
        ("controller: FANUC\nstationary_tool: true", "stationary_tool: needs motion: straight"),
        ("controller: FANUC\nuser_frame: {number: 2}", "goes with positions: user only"),
        (
            "controller: RAPID\nmotion: straight\nstationary_tool: true\nuser_frame: {number: 2}",
            "user_frame: is for Yaskawa controllers",
        ),
        (
            "tool: 2\nmotion: straight",
            "T_flange_tool_mm: .* need the data of tool 2",
        ),
        (
            "controller: KRL\nposition_levels: {free_move: 2}",
            "position_levels: is for Yaskawa controllers, not for KUKA",
        ),
        ("controller: RAPID\npositions: base", "positions: is for Yaskawa controllers"),
        ("at_end: [{output: 3}]", "state .on or off. goes with output and wait_input"),
        ("at_end: [{comment: A, state: on}]", "goes with output and wait_input, and only there"),
        ("at_end: [{dwell_s: 1, call: A}]", "needs exactly one of comment, output"),
        ("at_end: [{}]", "needs exactly one of"),
        ("at_end: [{dwell_s: 1, timeout_s: 2}]", "timeout_s goes with wait_input only"),
        ("at_end: [{dwell: 1}]", "unknown key; known here: call, comment, dwell_s"),
        ("position_levels: {on_wheel: 9}", "levels.on_wheel: must be a whole .* none, got 9"),
        ("position_levels: {lead: true}", "levels.lead: must be a whole .* 8, or none, got true"),
        ("position_levels: {lead: null}", "levels.lead: must be a whole .* 8, or none, got null"),
        (
            "corner_radius_mm: {lead: 5}",
            "corner_radius_mm.lead: goes with motion: straight only; joint moves take position_lev",
        ),
        (
            "motion: straight\ncorner_radius_mm: {free_move: 5}",
            "corner_radius_mm: free_move: is for straight moves, those in the air are joint moves",
        ),
        (
            "motion: straight\ncorner_radius_mm: {on_wheel: 0.05}",
            "corner_radius_mm: must be 0.1 to 6553.5 mm, got 0.05",
        ),
        (
            "controller: RAPID\nmotion: straight\ncorner_radius_mm: {on_wheel: 5}",
            "corner_radius_mm: is for Yaskawa controllers, not for ABB",
        ),
        (f"T_flange_tool_mm: {EYE.replace('[1, 0', '[2, 0')}", "away from a rotation"),
    ],
)
def test_section_that_makes_no_sense_is_refused_with_its_key(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        settings(tmp_path, text)
    assert caught.value.where.startswith(str(Path(tmp_path) / "job.yaml"))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"tool": 64}, "tool: must be 0 to 63, got 64"),
        ({"title": 33 * "X"}, "program comment: has 33 characters"),
        ({"controller": "NX100", "tool": 24}, "must be 0 to 23"),
        ({"acceleration": ByKind(on_wheel=10)}, "ACC must be 20 to 100, got 10"),
        ({"deceleration": ByKind(lead=10)}, "DEC must be 20 to 100, got 10"),
        ({"actions": Actions(before_pass=(SetOutput(9999, True),))}, "must be 1 to 4096"),
        ({"actions": Actions(after_pass=(Call("park"),))}, "must be of A-Z"),
        ({"template": Path("none.j2")}, "none.j2: cannot be read"),
    ],
)
def test_what_the_controller_does_not_take_is_told_before_planning(changes, message):
    try_out("SAMPLE", HOME, ROBOT, ProgramSettings())
    with pytest.raises(InputError, match=message):
        try_out("SAMPLE", HOME, ROBOT, ProgramSettings(**changes))


@pytest.mark.parametrize(
    ("error", "kind", "message"),
    [
        (SettingError("tool", "must be 0"), InputError, "job: program.tool: must be 0"),
        (
            PassTimeError("too slow"),
            OplError,
            "too slow; raise process.feed_mm_s, or write",
        ),
        (TimeLawError("no law"), UnsafeError, "no law; raise process.max_acceleration_deg_s2"),
    ],
)
def test_refusals_of_the_rooms_below_get_the_keys_of_the_job(error, kind, message):
    with pytest.raises(kind, match=message) as caught, keys_named(Source("job", Path())):
        raise error
    assert caught.type is kind and caught.value.exit_status == error.exit_status


def test_pulse_ratios_of_the_controller_make_acceptance_needless(tmp_path):
    with pytest.raises(InputError, match=r"accept_unverified_pulses: .*\[R, B, T\]"):
        settings(tmp_path, "{}", UNVERIFIED)
    with pytest.raises(InputError, match=r"accept_unverified_pulses: .*\[B\]"):
        settings(tmp_path, "accept_unverified_pulses: [R, T]", UNVERIFIED)
    assert settings(tmp_path, "controller: RAPID", UNVERIFIED)
    axes = "".join(f"  - {{name: {name}, per_degree: 1000.0}}\n" for name in "RBT")
    (tmp_path / "own.yaml").write_text("robot: mh24\nsource: pendant\naxes:\n" + axes)
    assert settings(tmp_path, "pulse_ratios: own.yaml", UNVERIFIED)
    with pytest.raises(InputError, match=r"program.pulse_ratios: .*none.yaml: cannot be read"):
        settings(tmp_path, "pulse_ratios: none.yaml", UNVERIFIED)
