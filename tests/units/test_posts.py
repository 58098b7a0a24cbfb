import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from opl.cell.robot import forward_kinematics
from opl.cli.commands import main
from opl.errors import InputError, OplError
from opl.geometry.frames import pose
from opl.program.actions import Actions, Call, Dwell, Remark, SetOutput, WaitInput
from opl.program.export import StraightLimit, export_program
from opl.program.inform import job_faults, parse
from opl.program.inform.job_layout import VARIABLES, JobLayout, JobStep
from opl.program.led import StationaryTool
from opl.program.moves import Program, plan_moves
from opl.program.posts import find_post, known_posts, reader_for
from opl.program.profiles import PROFILES
from opl.program.settings import (
    ByKind,
    Load,
    MotionForm,
    PositionForm,
    ProgramSettings,
    UserFrame,
)
from tests.support.example_post import install, install_example_post
from tests.support.program_samples import (
    DATE,
    MAX_SPEED,
    ROBOT,
    UNVERIFIED,
    slowed,
    verified_motion,
)

YASKAWA = ("NX100", "DX100", "DX200", "YRC1000")
OTHERS = ("RAPID", "KRL", "FANUC", "URSCRIPT")
ACTIONS = Actions(
    at_start=(Remark("BELT 1 MUST RUN"), WaitInput(7, True)),
    before_pass=(SetOutput(3, True), WaitInput(4, True, timeout=5.0)),
    after_pass=(SetOutput(3, False), Dwell(0.5)),
    at_end=(Call("PARK"),),
)
CORNERS = np.array(np.meshgrid(*([-0.1, 0.1],) * 3)).reshape(3, -1).T


def write(controller, *, robot=ROBOT, name="SAMPLE", n_passes=2, **changes):
    settings = ProgramSettings(controller=controller, actions=ACTIONS, title="MADE BY THE TESTS")
    limit = StraightLimit(CORNERS, 1e-3)
    motion = verified_motion(n_passes=n_passes, n_points=6)
    settings = replace(settings, **changes)
    if (controller, settings.motion) == ("KRL", MotionForm.JOINT):
        motion = slowed(motion, 0.2)  # else too slow for whole percents
    return export_program(motion, name, robot, settings, limit, DATE, ["CELL 7"])


def programs(controller, **changes):
    _, files = write(controller, **changes)
    return {name: text for name, text in files.items() if not name.endswith(".csv")}


@pytest.mark.parametrize("controller", YASKAWA + OTHERS)
def test_whole_programs_are_the_golden_ones(controller, assert_golden):
    for name, text in programs(controller).items():
        assert_golden(f"{controller}/joint/{name}", text)
    for name, text in programs(controller, motion=MotionForm.STRAIGHT).items():
        assert_golden(f"{controller}/straight/{name}", text)


@pytest.mark.parametrize(("controller", "name"), [("RAPID", "SAMPLE.mod"), ("FANUC", "SAMPLE.LS")])
def test_program_past_a_stationary_tool_is_the_golden_one(controller, name, assert_golden):
    wheel = pose(
        Rotation.from_euler("xyz", [90, 0, 90], degrees=True).as_matrix(), np.array([1.1, 0.5, 0.6])
    )
    part = pose(np.eye(3), np.array([0.0, 0.0, 0.1]))
    texts = programs(
        controller,
        motion=MotionForm.STRAIGHT,
        stationary=StationaryTool(wheel, part),
        user_frame=UserFrame(3, wheel),
        load=Load(1.25, np.array([0.01, 0.0, 0.13])),
    )
    assert_golden(f"{controller}/stationary/{name}", texts[name])


def test_user_frame_that_fanuc_has_not_is_refused():
    frame = UserFrame(10, np.eye(4))
    with pytest.raises(InputError, match="user_frame: must be 1 to 9, got 10"):
        programs("FANUC", stationary=StationaryTool(np.eye(4), np.eye(4)), user_frame=frame)


PART_KG, GRIPPER_KG = (
    Load(1.25, np.array([0.01, 0.0, 0.13])),
    Load(3.75, np.array([0.0, 0.02, 0.05])),
)
# of both together: sums of moments over the sum of masses
BOTH = 5.0, (2.5, 15.0, 70.0)
LOADS = {
    "DX200": ("TOOL.CND", r"\r\n(\S+),(\S+),(\S+)\r\n(5\.000)\r\n", "mm last"),
    "KRL": ("SAMPLE.src", r"\$LOAD = {M (\S+),CM {X (\S+),Y (\S+),Z (\S+),A", "mm"),
    "URSCRIPT": ("SAMPLE.script", r"set_target_payload\((\S+), \[(\S+), (\S+), (\S+)\]\)", "m"),
}


@pytest.mark.parametrize("controller", LOADS)
def test_load_of_part_and_gripper_stands_where_the_controller_keeps_it(controller):
    file, pattern, form = LOADS[controller]
    changes = {"load": PART_KG, "tool": 3 if controller == "DX200" else 0}
    (found,) = re.findall(pattern, programs(controller, gripper=GRIPPER_KG, **changes)[file])
    mass, *centre = (found[-1], *found[:-1]) if "last" in form else found
    assert float(mass) == BOTH[0]
    millimetres = np.array(centre, dtype=float) * (1e3 if form == "m" else 1.0)
    np.testing.assert_allclose(millimetres, BOTH[1], atol=0.05)
    texts = programs(controller, **changes)
    if controller != "DX200":  # the gripper is unknown, and the whole load with it
        assert not re.search(pattern, texts[file])
    assert "GRIPPER NOT IN IT" in "".join(texts.values())


def test_rapid_has_the_load_of_the_part_in_the_frame_of_its_tool():
    tool = pose(np.eye(3), np.array([0.0, 0.0, 0.03]))
    text = programs("RAPID", load=PART_KG, T_flange_tool=tool, tool=2)["SAMPLE.mod"]
    assert "loaddata opl_load := [1.250,[10.000,0.000,100.000],[1,0,0,0],0,0,0];" in text
    assert text.index("GripLoad opl_load;") < text.index("MoveAbsJ")


def test_fanuc_tells_the_load_to_people_alone():
    text = programs("FANUC", load=PART_KG, gripper=GRIPPER_KG)["SAMPLE.LS"]
    assert "!PART 1.250 KG ;" in text and "!WITH GRIPPER 5.000 KG ;" in text
    assert "PAYLOAD" not in text


@pytest.mark.parametrize("controller", OTHERS)
def test_programs_with_loads_are_read_without_doubt_and_the_load_is_something_they_do(controller):
    changes = {"load": PART_KG, "gripper": GRIPPER_KG, "motion": MotionForm.JOINT}
    _, files = write(controller, **changes)
    reader = find_post(controller).reader
    content = {name: text.encode() for name, text in files.items() if name.endswith(reader.suffix)}
    settings = ProgramSettings(controller=controller, actions=ACTIONS, **changes)
    reading = reader.read(content, ROBOT, settings)
    assert reading.findings == ()
    before = [event.text for event in reading.playback.events if event.after < 0]
    loads = {"RAPID": "GripLoad", "KRL": "$LOAD", "URSCRIPT": "set_target_payload", "FANUC": "\0"}
    found = [text for text in before if text.startswith(loads[controller])]
    assert len(found) == (controller != "FANUC")


@pytest.mark.parametrize("controller", YASKAWA)
def test_cartesian_programs_are_the_golden_ones(controller, assert_golden):
    frame = UserFrame(2, np.eye(4))
    ramps = {"acceleration": ByKind(on_wheel=50, air=80), "deceleration": ByKind(on_wheel=40)}
    texts = programs(
        controller, positions=PositionForm.USER, user_frame=frame, motion=MotionForm.STRAIGHT,
        levels=ByKind(2, 1, 4), **ramps,
    )  # fmt: skip
    for name, text in texts.items():
        assert_golden(f"{controller}/user/{name}", text)


@pytest.mark.parametrize("controller", YASKAWA)
def test_jobs_keep_every_limit_of_their_controller(controller):
    profile = PROFILES[controller]
    long = {"name": "LONGER_THAN_NX100_TAKES", "n_passes": 85}
    for changes in ({"motion": MotionForm.STRAIGHT}, long):
        for name, text in programs(controller, **changes).items():
            assert job_faults(text, profile) == ()
            job = parse(text)
            assert name == f"{job.name}.JBI" and len(job.name) <= profile.name_length
            assert text.isascii() and "\n" not in text.replace("\r\n", "")
            assert job.npos[0] == len(job.positions) == len(job.moves) <= profile.step_limit
            for move in job.moves:
                assert (move.tag("VJ") is None) == (move.word == "MOVL")


@pytest.mark.parametrize("controller", ["NX100"])
def test_five_thousand_points_split_off_the_belt_and_the_master_calls_every_part(controller):
    motion = verified_motion(n_passes=50, n_points=100)
    settings = ProgramSettings(controller=controller, actions=ACTIONS)
    program, files = export_program(
        motion, "GRIND_LONG", ROBOT, settings, StraightLimit(CORNERS, 0.0), DATE
    )
    jobs = {name: parse(text) for name, text in files.items() if name.endswith(".JBI")}
    master, *parts = jobs.values()
    assert list(master.calls) == [part.name for part in parts]
    assert len(set(master.calls)) == len(parts) > 2
    assert sum(len(part.moves) for part in parts) == len(program.moves) + len(parts) - 1
    assert len(program.moves) > 5000
    off_wheel = {tuple(m.q) for m in program.moves if not m.on_wheel and m.exact_stop}
    pulses = {tuple(np.rint(np.array(q) * ROBOT.pulses_per_radian)) for q in off_wheel}
    for part in parts:
        assert part.positions[0].values in pulses and part.positions[-1].values in pulses
        assert part.moves[-1].tag("PL") == "0"
    # each is done once, however many parts there are
    texts = "".join(files[f"{part.name}.JBI"] for part in parts)
    assert texts.count("DOUT OT#(3) ON") == texts.count("DOUT OT#(3) OFF") == 50
    assert texts.count("CALL JOB:PARK") == 1


def test_actions_stand_in_front_of_the_wheel_with_the_robot_at_rest():
    (text,) = programs("DX200").values()
    lines = text.split("\r\n")
    on, off = lines.index("DOUT OT#(3) ON"), lines.index("DOUT OT#(3) OFF")
    assert lines[on - 1].endswith("PL=0") and lines[off - 1].endswith("PL=0")
    assert lines[on + 1 : on + 5] == [
        "*WAIT1",
        "WAIT IN#(4)=ON T=5.00",
        "PAUSE IF IN#(4)=OFF",
        "JUMP *WAIT1 IF IN#(4)=OFF",
    ]
    assert lines[off + 1] == "TIMER T=0.50"
    assert lines[-3:] == ["CALL JOB:PARK", "END", ""]
    at_home = lines.index("'BELT 1 MUST RUN")
    assert lines[at_home - 1].startswith("MOVJ C00000") and lines[at_home + 1] == "WAIT IN#(7)=ON"
    program, _ = write("DX200")
    for move in program.moves:
        assert not move.actions or (move.exact_stop and not move.on_wheel)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (SetOutput(0, True), "input or output: must be 1 to 4096, got 0"),
        (WaitInput(4097, True), "input or output: must be 1 to 4096, got 4097"),
        (Dwell(1000.0), "time: must be 0.01 to 655.35 s, got 1000"),
        (WaitInput(1, True, 0.001), "time: must be 0.01"),
        (Call("park"), "call: must be of A-Z"),
        (Call("SAMPLE"), "call: SAMPLE is the name of the program itself"),
        (Remark("Gr\u00f6\u00dfe"), "comment: must be printable ASCII"),
        (Remark(33 * "X"), "comment: has 33 characters"),
    ],
)
def test_action_the_controller_does_not_take_is_refused(action, message):
    with pytest.raises(InputError, match=f"program: {message}"):
        programs("DX200", actions=Actions(before_pass=(action,)))


@pytest.mark.parametrize("number", [19, 101])
def test_ramps_out_of_range_are_refused(number):
    with pytest.raises(InputError, match=f"ACC must be 20 to 100, got {number}"):
        programs("DX200", acceleration=ByKind(on_wheel=number))


@pytest.mark.parametrize("controller", YASKAWA)
def test_pulses_nobody_confirmed_are_refused_until_accepted_by_name(controller):
    with pytest.raises(InputError, match=r"R, B, T are not verified.*\[R, B, T\]"):
        programs(controller, robot=UNVERIFIED)
    texts = programs(controller, robot=UNVERIFIED, accepted_pulses=("R", "B", "T"))
    assert all("'PULSE RATIO NOT VERIFIED: R B T" in text for text in texts.values())
    # positions in a frame do not depend on them
    assert programs(controller, robot=UNVERIFIED, positions=PositionForm.BASE)


# other makers


def moves_read(controller, text):
    """Joint angles [deg] and time [s] of each move, as far as the text says them."""
    if controller == "RAPID":
        rows = re.findall(r"MoveAbsJ \[\[(.*?)\],.*?NoEOffs, v\d+(?:\\T:=([0-9.]+))?,", text)
        return [(eval(f"[{a}]"), float(t or "nan")) for a, t in rows]
    if controller == "FANUC":
        axes = np.array(re.findall(r"J[1-6]= ([-0-9.]+) deg", text), dtype=float).reshape(-1, 6)
        axes[:, 2] += axes[:, 1]
        times = re.findall(r"[JL] P\[\d+\] (?:(\d+)msec|5%)", text)
        return [(list(a), float(t or "nan") / 1e3) for a, t in zip(axes, times, strict=True)]
    rows = re.findall(r"movej\(\[(.*?)\], (?:t=([0-9.]+))?", text)
    return [(list(np.rad2deg(eval(f"[{a}]"))), float(t or "nan")) for a, t in rows]


@pytest.mark.parametrize("controller", ["RAPID", "FANUC", "URSCRIPT"])
def test_other_makers_go_to_the_same_configurations_in_the_same_time(controller):
    program, files = write(controller)
    (text,) = [text for name, text in files.items() if not name.endswith(".csv")]
    for move, (angles, time) in zip(program.moves, moves_read(controller, text), strict=True):
        np.testing.assert_allclose(angles, np.rad2deg(move.q), atol=1.1e-3)
        if move.duration is not None:
            assert time == pytest.approx(move.duration, abs=6e-4)


def test_krl_goes_to_the_same_configurations_in_whole_percents():
    program, files = write("KRL")
    text = files["SAMPLE.src"]
    rows = re.findall(r"BAS\(#VEL_PTP, (\d+)\)\r\nPTP \{(.*?)\}( C_PTP)?\r\n", text)
    for move, (percent, axes, blended) in zip(program.moves, rows, strict=True):
        angles = [float(axis.split()[1]) for axis in axes.split(",")]
        np.testing.assert_allclose(angles, np.rad2deg(move.q), atol=1e-4)
        assert 1 <= int(percent) <= 100 and bool(blended) != move.exact_stop


@pytest.mark.parametrize("controller", OTHERS)
def test_other_makers_keep_the_time_of_each_pass(controller):
    for motion in MotionForm:
        program, _ = write(controller, motion=motion)
        assert len(program.pass_times) == 2
        assert all(abs(one.error) < 0.02 for one in program.pass_times)


def test_straight_moves_of_rapid_and_krl_lead_to_the_pose_of_the_tool():
    T_flange_tool = np.eye(4)
    T_flange_tool[:3, 3] = 0.01, 0.02, 0.2
    changes = {"motion": MotionForm.STRAIGHT, "T_flange_tool": T_flange_tool, "tool": 2}
    program, files = write("RAPID", **changes)
    q = [move.q for move in program.moves if move.straight]
    wanted = (forward_kinematics(ROBOT, np.array(q)) @ T_flange_tool)[:, :3, 3] * 1e3
    rapid = re.findall(r"MoveL \[\[([^]]*)\]", files["SAMPLE.mod"])
    krl = re.findall(r"LIN \{X (\S+),Y (\S+),Z (\S+),A", write("KRL", **changes)[1]["SAMPLE.src"])
    np.testing.assert_allclose([eval(f"[{p}]") for p in rapid], wanted, atol=1e-3)
    np.testing.assert_allclose(np.array(krl, dtype=float), wanted, atol=1e-3)
    assert ", tool2;" in files["SAMPLE.mod"]


@pytest.mark.parametrize("controller", OTHERS)
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "A-B"}, "program name: .* a letter and up to"),
        ({"title": "gr\u00f6sse"}, "program comment: .* printable ASCII"),
        ({"actions": Actions(at_end=(Call("A B"),))}, "program name"),
        ({"actions": Actions(at_end=(Remark(81 * "X"),))}, "program comment"),
    ],
)
def test_other_makers_refuse_what_their_language_does_not_take(controller, changes, message):
    with pytest.raises(InputError, match=message):
        programs(controller, **changes)


DAMAGE = [
    ("{{ name }}", "{{ nam }}", "'nam' is undefined", OTHERS),
    ("{{ name }}", "\u00e4", "not ASCII", OTHERS),
    ("in steps %}", "in steps[1:] %}", "loses or moves", ("RAPID", "KRL", "URSCRIPT")),
    ("in step.actions %}", "in step.actions[1:] %}", "loses or moves", ("RAPID", "URSCRIPT")),
    ("{{ step.move }}", "{{ step.move }}\n{{ step.move }}", "moves instead of", ("RAPID", "KRL")),
    ("{{ step.speed }}\n", "", "loses or moves", ("KRL",)),
    ("in lines %}", "in lines[1:-1] %}", "loses or moves", ("FANUC",)),
    ("in positions %}", "in positions[1:] %}", "loses or changes a position", ("FANUC",)),
]


@pytest.mark.usefixtures("warm_processes")
@pytest.mark.parametrize(
    ("controller", "old", "new", "message"),
    [(name, *damage) for *damage, names in DAMAGE for name in names],
)
def test_other_makers_read_back_what_a_template_gives(tmp_path, controller, old, new, message):
    text = find_post(controller).template.read_text()
    assert old in text
    own = tmp_path / "own.j2"
    own.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError, match=message):
        programs(controller, template=own)


def test_pass_too_slow_for_whole_percents_is_refused():
    program = plan_moves(slowed(verified_motion(), 2.0), "SAMPLE", MAX_SPEED)
    with pytest.raises(OplError, match="pass 1 would take"):
        find_post("KRL").write(program, ROBOT, ProgramSettings(), DATE)


# the registry


def test_every_post_comes_from_an_entry_point_and_tells_its_variables():
    assert set(known_posts()) >= {*YASKAWA, *OTHERS}
    told = CliRunner().invoke(main, ["templates", "vars"]).output
    for name in known_posts():
        post = find_post(name)
        assert post.template.is_file() and f"{name}: {post.title}" in told
        template = post.template.read_text()
        for variable, meaning in post.variables.items():
            assert meaning in told
            assert variable.split(".")[-1] in template or name in OTHERS


def test_documented_variables_of_jobs_are_the_ones_given():
    layout = JobLayout("A", "0", None, "PULSE", "PULSE", "", None, "", None, (), (), ())
    own = {name for name in VARIABLES if "." not in name}
    steps = {name.partition(".")[2] for name in VARIABLES if "." in name}
    assert own == set(layout.values())
    assert steps == set(JobStep.__dataclass_fields__)


def test_unknown_controller_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match=r"unknown controller 'DX300'; known: .*DX200, FANUC, KRL"):
        find_post("DX300")
    shown = CliRunner().invoke(main, ["templates", "vars", "DX300"])
    assert shown.exit_code == 2 and "unknown controller" in shown.output


def test_a_site_adds_its_own_post_without_touching_opl(tmp_path, monkeypatch):
    install_example_post(tmp_path, monkeypatch)
    text = programs("OUR_CELL")["SAMPLE.txt"]
    assert text.startswith("PROGRAM SAMPLE 2024-03-05\nGO 0.000 -20.000 10.000 0.000 -60.000")
    assert "OUR_CELL: our own cell" in CliRunner().invoke(main, ["templates", "vars"]).output


@pytest.mark.parametrize(
    ("value", "message"), [("nowhere:POST", "cannot be loaded"), ("math:pi", "is no .*Post")]
)
def test_broken_post_of_a_site_is_told(tmp_path, monkeypatch, value, message):
    install(tmp_path, {"BROKEN": value})
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=message):
        find_post("BROKEN")
    # programs of other controllers are read all the same
    assert reader_for(Path("A.mod")) is find_post("RAPID").reader


def test_program_without_moves_is_written_too():
    for controller in YASKAWA + OTHERS:
        assert find_post(controller).write(Program("EMPTY"), ROBOT, ProgramSettings(), DATE).files
