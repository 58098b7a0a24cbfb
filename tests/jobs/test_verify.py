"""The proof of the file itself: good programs pass, and every fault put into a file is found."""

import json
import re
import shutil
from dataclasses import replace
from datetime import datetime
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
import trimesh
import yaml

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.geometry.frames import transform
from opl.job.load import load_job
from opl.motion.timing import time_motion
from opl.program.inform.parse import decode, read_jobs
from opl.program.inform.playback import play_jobs
from opl.program.inform.post import write_jobs
from opl.program.profiles import DX200
from opl.program.pulses import PulseScale
from opl.proof.digest import digests_in, read_result
from opl.proof.prove import reader_of, rule_of
from opl.run import stages
from opl.run.stages import run_job
from opl.run.surfacing import cut_surface
from opl.verification.recognise import recognise
from tests.support.jobs import V_SHAPE, opl, write_job, write_robot

pytestmark = pytest.mark.usefixtures("no_pictures")

# two rows of the V, few contact positions, long steps, and a home near the wheel
FEW = {
    "passes.rows": 2,
    "passes.max_step_mm": 12,
    "search.contact_positions": 40,
    "search.method": "recursive",
    "process.approach_mm": 20,
    "process.home_deg": [20, -30, -55, -5, 48, 120],
}
SHORT = {**FEW, "passes.rows": 1}
COARSE = {key: FEW[key] for key in ("search.method", "process.home_deg")}
HOMES = []


@cache
def planned(short=True):
    """Plan and write a program once; return its folder, which holds job.yaml and out/."""
    home = Path(mkdtemp(prefix="opl-verify-"))
    HOMES.append(home)
    job = write_job(home, SHORT if short else FEW, quick=False)
    ended = opl("run", job, "--out", home / "out")
    assert ended.status == 0, ended.err
    return home


@pytest.fixture(scope="module", autouse=True)
def _tidy_up():
    yield
    for home in HOMES:
        shutil.rmtree(home, ignore_errors=True)


@cache
def columns():
    """Return the table of the short program: one row a written configuration."""
    lines = (planned() / "out" / "V_SHAPE.csv").read_text().splitlines()
    rows = [dict(zip(lines[0].split(","), line.split(","), strict=True)) for line in lines[1:]]
    return [row for row in rows if row["speed"]]


def ground(n):
    """Return the number of the first written configuration from a cutter point on."""
    places = [float(row["cutter_point"] or "nan") for row in columns()]
    return next(k for k, place in enumerate(places) if place >= n)


class Text:
    """A job file that is tampered with."""

    def __init__(self):
        self.text = (planned() / "out" / "V_SHAPE.JBI").read_bytes().decode("ascii")

    def pulses(self, number):
        return [int(v) for v in re.search(rf"C{number:05d}=(.*)\r", self.text)[1].split(",")]

    def put(self, number, pulses):
        written = ",".join(str(int(v)) for v in pulses)
        self.text, n = re.subn(rf"C{number:05d}=.*\r", f"C{number:05d}={written}\r", self.text)
        assert n == 1
        return self

    def replace(self, pattern, by):
        self.text, n = re.subn(pattern, by, self.text)
        assert n == 1, f"{n} times {pattern}"
        return self


def verify(tmp_path, text, changes=(), job=None):
    """Verify a text as the program of the short job, or of it with changes."""
    if job is None:
        job = write_job(tmp_path / "job", {**SHORT, **dict(changes)}, quick=False)
    program = tmp_path / "V_SHAPE.JBI"
    program.write_bytes(text.text.encode("ascii"))
    return opl("verify", job, program)


def refuses(ended, *words):
    """Assert that a program is not proven for a reason that holds these words."""
    assert ended.status == 4, ended.err or ended.out
    assert any(all(word in line for word in words) for line in ended.err.splitlines()), ended.err
    return True


# what is as written passes


def test_an_untouched_program_is_proven():
    home = planned(short=False)
    ended = opl("verify", home / "job.yaml", home / "out" / "V_SHAPE.JBI", "--json")
    assert ended.status == 0, ended.err
    told = json.loads(ended.out)
    result = json.loads((home / "out" / "result.json").read_text())
    assert told["proven"] is True and told["findings"] == []
    assert told["cutter_points"] == told["cutter_points_ground"] == result["cutter_points"]
    assert told["positions"] == result["program"]["moves"]
    assert told["duration_s"] == pytest.approx(result["program"]["duration_s"], rel=0.01)
    proof = result["verification"]
    assert told["collisions"] == told["limit_violations"] == 0
    assert told["min_clearance_mm"] == pytest.approx(proof["min_clearance_mm"], abs=0.01)
    assert told["max_contact_error_mm"] <= 0.1


def test_what_was_proven_is_told_in_words():
    home = planned()
    ended = opl("verify", home / "job.yaml", home / "out" / "V_SHAPE.JBI")
    assert ended.status == 0 and ended.err == ""
    n = int(float(max((r["cutter_point"] for r in columns() if r["cutter_point"]), key=float))) + 1
    assert f"{n} of {n} cutter points recognised in order" in ended.out
    assert "0 collisions" in ended.out and ended.out.rstrip().endswith("proven")
    assert "not proven" not in ended.out


def test_a_run_ends_with_reading_back_what_it_writes():
    result = json.loads((planned() / "out" / "result.json").read_text())
    proof = result["verification"]["file"]
    assert proof["proven"] is True and proof["files"] == ["V_SHAPE.JBI"]
    assert proof["postures"] == result["program"]["moves"]
    assert proof["largest_difference_mm"] == 0.0 and proof["replayed"] is False
    assert 0.0 < proof["largest_rounding_mm"] < 0.05


def test_proven_and_written_configurations_are_one():
    scale = PulseScale.of(load_job(planned() / "job.yaml").cell.robot)
    (job,) = read_jobs(decode((planned() / "out" / "V_SHAPE.JBI").read_bytes())[0])
    written = np.array([position.values for position in job.positions])
    proven = np.array([[float(row[f"{n}_deg"]) for n in "SLURBT"] for row in columns()])
    counted = np.deg2rad(proven) * scale.pulses_per_radian
    assert np.abs(counted - written).max() < 0.1  # the table's own four digits


def test_no_exact_stop_of_the_written_file_is_on_the_belt():
    home = planned(short=False)
    job, text = load_job(home / "job.yaml"), (home / "out" / "V_SHAPE.JBI").read_text()
    points, cell = cut_surface(job).points, job.cell
    scale = PulseScale.of(cell.robot)
    pulses = {int(k): v.split(",") for k, v in re.findall(r"^C(\d+)=(.*)$", text, re.MULTILINE)}
    moves = re.findall(r"^MOVJ C(\d+) .*PL=(\d)", text, re.MULTILINE)
    assert len(moves) == len(pulses)
    touching = {}
    for place, (number, _) in enumerate(moves):
        q = scale.to_angles(np.array(pulses[int(number)], dtype=float))
        T_base_workpiece = forward_kinematics(cell.robot, q) @ cell.T_flange_workpiece
        p_base = transform(T_base_workpiece, points.Ts_workpiece_cutter[:, :3, 3])
        p_contact0 = transform(np.linalg.inv(cell.wheel.T_base_contact0), p_base)
        away = np.abs(cell.wheel.signed_distance(p_contact0))
        if away.min() < 2e-4:
            touching.setdefault(int(points.pass_index[away.argmin()]), []).append(place)
    assert sorted(touching) == [0, 1]
    stops = [place for place, (_, level) in enumerate(moves) if level == "0"]
    assert len(stops) > 4
    for contacts in touching.values():
        assert not [place for place in stops if contacts[0] <= place <= contacts[-1]]


# the file tampered with


def test_one_pulse_changed_by_one_is_found_beside_the_result_of_the_run(tmp_path):
    """It moves the part by a hundredth of a millimetre: what the program says is proven still."""
    for name in ("result.json", "V_SHAPE.JBI"):
        shutil.copy(planned() / "out" / name, tmp_path)
    job = planned() / "job.yaml"
    told = json.loads(opl("verify", job, tmp_path / "V_SHAPE.JBI", "--json").out)
    assert told["as_written"] is True and told["proven"] is True
    number = ground(20)
    text = Text()
    pulses = text.pulses(number)
    pulses[4] += 1
    changed = text.put(number, pulses)
    ended = verify(tmp_path, changed, job=job)
    assert refuses(ended, "file at", "V_SHAPE.JBI", "not the bytes that opl run proved")
    assert len(ended.err.splitlines()) == 2  # nothing else is wrong
    (tmp_path / "result.json").unlink()
    ended = verify(tmp_path, changed, job=job)
    assert ended.status == 0 and "no result.json beside it" in ended.out


@pytest.mark.parametrize("content", ["", "[]", '{"program": null}', '{"program": {"sha256": 3}}'])
def test_a_result_that_tells_no_digests_vouches_for_nothing(content):
    assert digests_in(read_result(content.encode())) == {}


@pytest.mark.parametrize("joint", [0, 4, 5])
def test_one_pulse_count_changed_by_200_is_found(tmp_path, joint):
    number = ground(20)
    text = Text()
    pulses = text.pulses(number)
    pulses[joint] += 200
    ended = verify(tmp_path, text.put(number, pulses))
    assert refuses(ended, "order at cutter point")
    assert refuses(ended, "contact at pass 1")


def test_a_swapped_branch_in_the_middle_is_found(tmp_path):
    number = ground(20)
    text = Text()
    robot = load_job(planned() / "job.yaml").cell.robot
    scale = PulseScale.of(robot)
    q = scale.to_angles(np.array(text.pulses(number)))
    slots = inverse_kinematics(robot.arm, forward_kinematics(robot, q), q)
    here = int(np.abs(np.remainder(slots - q + np.pi, 2 * np.pi) - np.pi).max(axis=1).argmin())
    other = slots[(here + 4) % 8]  # the same pose, the wrist flipped
    ended = verify(tmp_path, text.put(number, scale.to_pulses(other)))
    assert refuses(ended, "contact at pass 1", "wheel's surface")


def test_two_points_exchanged_are_found(tmp_path):
    text = Text()
    one, other = ground(20), ground(20) + 1
    first, second = text.pulses(one), text.pulses(other)
    ended = verify(tmp_path, text.put(one, second).put(other, first))
    assert refuses(ended, "order at cutter point")


def test_a_deleted_point_is_found(tmp_path):
    text, number = Text(), ground(20)
    last = len(columns()) - 1
    text.replace(rf"C{number:05d}=.*\r\n", "").replace(rf"MOVJ C{number:05d} .*\r\n", "")
    for later in range(number + 1, last + 1):
        text.text = text.text.replace(f"C{later:05d}", f"C{later - 1:05d}")
    text.replace(rf"NPOS {last + 1},", f"NPOS {last},")
    ended = verify(tmp_path, text)
    assert refuses(ended, "order at cutter point")
    assert "file at" not in ended.err


def test_full_speed_on_the_wheel_is_found(tmp_path):
    text = Text().replace(rf"(C{ground(20):05d}) VJ=[0-9.]+", r"\1 VJ=100.00")
    ended = verify(tmp_path, text)
    assert refuses(ended, "speed at pass 1", "times the feed")


@pytest.mark.parametrize("line", ["TIMER T=2.00", "WAIT IN#(1)=ON", "PAUSE"])
def test_standing_still_on_the_wheel_is_found(tmp_path, line):
    text = Text().replace(rf"(MOVJ C{ground(20):05d} .*\r\n)", rf"\1{line}\r\n")
    ended = verify(tmp_path, text)
    assert refuses(ended, "wait at pass 1, cutter point", "stands still on the wheel", line)


def test_a_fast_first_move_and_rounded_corners_are_found(tmp_path):
    text = Text().replace(r"C00000 VJ=5.00", "C00000 VJ=50.00")
    text.replace(r"(C00001 VJ=\S+) PL=0", r"\1 PL=8")
    ended = verify(tmp_path, text)
    assert refuses(ended, "speed at V_SHAPE line", "VJ=50")
    assert refuses(ended, "level at free move from home", "PL=0 at most", "got PL=8")


def test_a_program_that_goes_elsewhere_than_home_is_found(tmp_path):
    text = Text()
    pulses = text.pulses(0)
    pulses[0] += 2000
    assert refuses(verify(tmp_path, text.put(0, pulses)), "home at free move from home", "joint S")


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("SFTON P001 UF#(1)", "nobody can tell"),
        ("JUMP *THERE IF IN#(1)=ON", "label"),
        ("CALL JOB:MINE IF IN#(1)=ON", "condition"),
    ],
)
def test_what_nobody_can_follow_is_not_proven(tmp_path, line, told):
    text = Text()
    text.text = text.text.replace("MOVJ C00003 ", f"{line}\r\nMOVJ C00003 ")
    assert refuses(verify(tmp_path, text), "program at V_SHAPE line", told)


# the cell is another than the one planned for


def test_a_shifted_wheel_is_found(tmp_path):
    rows = yaml.safe_load((V_SHAPE / "job.yaml").read_text())["wheel"]["T_base_contact0_mm"]
    rows[0][3] += 2.0
    ended = verify(tmp_path, Text(), {"wheel.T_base_contact0_mm": rows})
    assert refuses(ended, "order at cutter point 0")
    assert "seems" not in ended.out + ended.err  # too far for a shift to be told
    rows[0][3] -= 1.8
    ended = verify(tmp_path, Text(), {"wheel.T_base_contact0_mm": rows})
    # between written positions the contact is off by up to the allowed 0.1 mm, and so a little here
    told = re.search(r"the wheel seems (0\.\d\d) mm farther away than planned", ended.err)
    assert ended.status == 4 and abs(float(told[1]) - 0.2) <= 0.02


def test_a_part_two_millimetres_too_big_is_found(tmp_path):
    job = write_job(tmp_path / "job", SHORT, quick=False)
    mesh = trimesh.load(job.parent / "v_shape.stl")
    factor = 1.0 + 2.0 / np.ptp(mesh.vertices, axis=0).max()
    mesh.apply_scale(factor)
    mesh.export(job.parent / "v_shape.stl")
    ended = verify(tmp_path, Text(), job=job)
    assert ended.status == 4
    surface = json.loads((job.parent / "surface.json").read_text())
    surface["control_points_mm"] = (factor * np.array(surface["control_points_mm"])).tolist()
    (job.parent / "surface.json").write_text(json.dumps(surface))
    assert refuses(verify(tmp_path, Text(), job=job), "order at cutter point")


def test_a_limit_crossed_between_two_points_is_found(tmp_path):
    """On a straight move a joint can go beyond what both ends have; on a joint move none can."""
    text = Text().replace(r"MOVJ (C00001) VJ=\S+", r"MOVL \1 V=50.0")
    program = tmp_path / "V_SHAPE.JBI"
    program.write_bytes(text.text.encode("ascii"))
    job = load_job(planned() / "job.yaml")
    (read,) = read_jobs(decode(program.read_bytes())[0])
    playback, _ = play_jobs({read.name: read}, job.cell.robot, job.program)
    end = int(playback.stations[1])
    way = playback.q[: end + 1]
    rest = np.concatenate([playback.q[:1], playback.q[end:]])
    above = np.rad2deg(way.max(axis=0) - rest.max(axis=0))
    joint = int(above.argmax())
    assert above[joint] > 0.05
    limit = np.rad2deg(rest.max(axis=0)[joint]) + above[joint] / 2.0
    name = job.cell.robot.joint_names[joint]
    lower = float(np.rad2deg(job.cell.robot.lower[joint]))
    write_robot(tmp_path / "job" / "arm", {name: (lower, float(limit))})
    ended = verify(tmp_path, text, {"robot": "arm"})
    assert refuses(ended, "limit at free move from home", f"joint {name}", "beyond its limit")


def test_a_collision_only_between_two_points_is_found(tmp_path):
    cell = load_job(planned() / "job.yaml").cell
    scale = PulseScale.of(cell.robot)
    q = [scale.to_angles(np.array(Text().pulses(k))) for k in (0, 1)]
    middle = forward_kinematics(cell.robot, (q[0] + q[1]) / 2.0) @ cell.T_flange_workpiece
    at = (middle[:3, :3] @ cell.part.vertices.mean(axis=0) + middle[:3, 3]) * 1e3
    plate = {"name": "plate", "box_mm": [2, 60, 2], "at_mm": at.round(1).tolist()}
    ended = verify(tmp_path, Text(), {"obstacles": [plate]})
    assert refuses(ended, "collision at free move from home", "part and plate")
    assert "pass 1" not in ended.err and "free move to home" not in ended.err


# programs in parts, and other ways to write


@pytest.fixture(scope="module")
def parts():
    """Return the two-row program in parts, as a controller of few steps takes it."""
    home = planned(short=False)
    job = load_job(home / "job.yaml")
    run = run_job(job)
    assert run.read_back.proven
    few = replace(DX200, step_limit=len(run.program.moves) * 2 // 3)
    written = write_jobs(run.program, job.cell.robot, job.program, few, datetime(2024, 1, 1))
    folder = home / "parts"
    folder.mkdir()
    for name, text in written.files.items():
        (folder / name).write_bytes(text.encode("ascii"))
    return home / "job.yaml", [folder / name for name in written.files]


def test_a_master_and_its_parts_are_proven_in_any_order(parts):
    job, files = parts
    assert len(files) == 3
    ended = opl("verify", job, *reversed(files))
    assert ended.status == 0, ended.err


def test_a_missing_part_is_refused(parts):
    job, files = parts
    ended = opl("verify", job, *files[:-1])
    assert ended.status == 2
    assert "calls V_SHAPE02, which is not there" in ended.err


def test_parts_without_their_master_are_refused(parts):
    job, files = parts
    ended = opl("verify", job, *files[1:])
    assert ended.status == 2 and "no job calls V_SHAPE01 or V_SHAPE02" in ended.err


def test_straight_and_cartesian_moves_are_proven_anew(tmp_path):
    changes = {"program.positions": "base", "program.motion": "straight"}
    job = write_job(tmp_path, {**COARSE, **changes})
    ended = opl("run", job, "--out", tmp_path / "out", "--json")
    assert ended.status == 0, ended.err
    assert json.loads(ended.out)["verification"]["file"]["replayed"] is True
    text = (tmp_path / "out" / "V_SHAPE.JBI").read_text()
    assert "MOVL" in text and "///RECTAN" in text


def test_cartesian_joint_moves_read_back_are_the_proven_ones(tmp_path):
    job = write_job(tmp_path, {**COARSE, "program.positions": "base"})
    ended = opl("run", job, "--out", tmp_path / "out", "--json")
    assert ended.status == 0, ended.err
    proof = json.loads(ended.out)["verification"]["file"]
    assert proof["replayed"] is False and proof["largest_difference_mm"] == 0.0


# bad input


def test_what_is_no_job_is_refused(tmp_path):
    ended = opl("verify", planned() / "job.yaml", planned() / "job.yaml")
    assert ended.status == 2 and "a job begins with /JOB" in ended.err
    ended = opl("verify", planned() / "job.yaml", tmp_path / "none.JBI")
    assert ended.status == 2 and "cannot be read" in ended.err


def test_pulses_of_a_robot_with_other_joints_are_refused(tmp_path):
    text = Text()
    ended = verify(tmp_path, text.put(5, text.pulses(5)[:5]))
    assert ended.status == 2 and "has 6 joints" in ended.err
    ended = verify(tmp_path, Text().replace("GROUP1 RB1", "GROUP1 RB2"))
    assert ended.status == 2 and "RB2" in ended.err


def test_a_job_for_another_maker_is_refused(tmp_path):
    job = write_job(tmp_path / "job", {**SHORT, "program.controller": "RAPID"}, quick=False)
    ended = verify(tmp_path, Text(), job=job)
    assert ended.status == 2 and "program.controller" in ended.err


# a run whose files do not say what was proven


def test_a_run_that_writes_something_else_writes_nothing(tmp_path, monkeypatch):
    honest = stages.render_program

    def dishonest(proven, stops):
        program, files = honest(proven, stops)
        lines = files["V_SHAPE.JBI"].split("\r\n")
        k = next(k for k, line in enumerate(lines) if line.startswith("C00010="))
        s, rest = lines[k].removeprefix("C00010=").split(",", 1)
        lines[k] = f"C00010={int(s) + 1},{rest}"
        return program, {**files, "V_SHAPE.JBI": "\r\n".join(lines)}

    monkeypatch.setattr(stages, "render_program", dishonest)
    job = write_job(tmp_path, COARSE)
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 4 and "file at V_SHAPE line" in ended.err
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "report.html",
        "result.json",
    ]
    assert json.loads((tmp_path / "out" / "result.json").read_text())["status"] == "unsafe"


def test_times_are_asked_for_by_the_places_that_are_recognised_in_the_file():
    home = planned(short=False)
    job = load_job(home / "job.yaml")
    run = run_job(job)
    points = run.proven.surfaced.points
    reader = reader_of(job)
    playback = reader.read(
        {name: text.encode() for name, text in run.files.items() if name.endswith(reader.suffix)},
        job.cell.robot,
        job.program,
    ).playback
    found = recognise(
        job.cell, points, playback.q, playback.duration, playback.stations, rule_of(job)
    )
    asked = time_motion(found.timed.motion, points, job.process, job.cell.robot).timed
    times = run.proven.planned.timing.timed
    # what the digits of the speeds leave
    np.testing.assert_allclose(asked.duration, times.duration, rtol=1e-3, atol=1e-4)
    assert [str(kind) for kind in asked.motion.kind] == [str(kind) for kind in times.motion.kind]


@pytest.mark.parametrize("controller", ["DX200", "RAPID"])
def test_a_part_that_turns_back_on_its_row_comes_the_way_it_left(tmp_path, controller):
    changes = {**SHORT, "passes.order": "both", "program.controller": controller}
    job = write_job(tmp_path, changes, quick=False)
    run = opl("run", job, "--out", tmp_path / "out")
    assert run.status == 0, run.err
    program = next(path for path in (tmp_path / "out").iterdir() if path.suffix in (".JBI", ".mod"))
    verified = opl("verify", job, program)
    assert verified.status == 0, verified.err
