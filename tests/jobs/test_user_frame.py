"""Programs in a user frame at the wheel: written, proven, carried along when it is touched up."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from opl.job.load import load_job
from opl.program.inform import parse
from tests.support.jobs import GONE, document, opl, write_job

pytestmark = pytest.mark.usefixtures("no_pictures")

USER = {"program.positions": "user", "program.accept_unverified_pulses": GONE}
# what the wheel was moved by when the frame was touched up, in [mm] and [deg]
SHIFT_MM = np.array([3.0, -2.0, 4.0])
SHIFT = Rotation.from_rotvec([0.2, -0.3, 0.25], degrees=True)


@cache
def ran():
    """Run the quick V job in a user frame, home and contact positions as shipped; its folder."""
    home = Path(mkdtemp(prefix="opl-user-frame-"))
    changes = {**USER, "search.contact_positions": 140}
    ended = opl("run", write_job(home, changes), "--out", home / "out")
    assert ended.status == 0, ended.err
    assert "read back from V_SHAPE.JBI, UFRAME.CND" in ended.out
    return home


def shifted_wheel():
    """Return the pose of the wheel after it was moved, as a job gives it."""
    T = np.array(document()["wheel"]["T_base_contact0_mm"])
    T[:3, :3] = SHIFT.as_matrix() @ T[:3, :3]
    T[:3, 3] += SHIFT_MM
    return T.tolist()


def frame_entry(T_mm):
    """Return the line of a user frame by another route than opl's: R = Rz Ry Rx."""
    T = np.array(T_mm)
    rz, ry, rx = Rotation.from_matrix(T[:3, :3]).as_euler("ZYX", degrees=True)
    lengths = ",".join(f"{value:.3f}" for value in T[:3, 3])
    return f"////BUSER {lengths},{rx:.4f},{ry:.4f},{rz:.4f}"


def test_frame_of_the_wheel_is_written_as_text_and_as_an_entry():
    out = ran() / "out"
    wanted = frame_entry(document()["wheel"]["T_base_contact0_mm"])
    text = (out / "UFRAME.CND").read_bytes().decode("ascii")
    assert text.startswith("//UFRAME 1\r\n") and f"{wanted}\r\n" in text
    job = parse((out / "V_SHAPE.JBI").read_bytes().decode("ascii"))
    assert {(p.frame, p.user) for p in job.positions} == {("USER", 1)}
    x, y, z, rx, ry, rz = wanted.removeprefix("////BUSER ").split(",")
    comments = [step.comment for step in job.instructions if step.word == "'"]
    for line in (f"UF1 X {x} Y {y}", f"UF1 Z {z} RX {rx}", f"UF1 RY {ry} RZ {rz}"):
        assert line in comments


def test_home_at_half_a_turn_is_moved_clear_of_it_and_the_program_says_so():
    assert document()["process"]["home_deg"][5] == -180
    program = (ran() / "out" / "V_SHAPE.JBI").read_bytes()
    assert b"'HOME T -177.00, NOT -180.00\r\n" in program
    plain = load_job(write_job(ran() / "pulses"))
    assert np.rad2deg(plain.process.home[5]) == pytest.approx(-180.0)


def test_touched_up_frame_carries_the_program_to_the_moved_wheel(tmp_path):
    """The bytes of the program stay; frame and wheel move, and it is proven in the moved cell."""
    job = write_job(tmp_path, {**USER, "wheel.T_base_contact0_mm": shifted_wheel()})
    program = (ran() / "out" / "V_SHAPE.JBI").read_bytes()
    (tmp_path / "V_SHAPE.JBI").write_bytes(program)
    frames = (ran() / "out" / "UFRAME.CND").read_bytes().decode()
    before = frame_entry(document()["wheel"]["T_base_contact0_mm"])
    assert frames.count(before) == 1
    touched = frames.replace(before, frame_entry(shifted_wheel()))
    (tmp_path / "UFRAME.CND").write_bytes(touched.encode())
    ended = opl("verify", job, tmp_path / "V_SHAPE.JBI")
    assert ended.status == 0, ended.err
    assert "UFRAME.CND" in ended.out

    # the frame that was not touched up contradicts the moved wheel
    (tmp_path / "UFRAME.CND").write_bytes(frames.encode())
    ended = opl("verify", job, tmp_path / "V_SHAPE.JBI")
    assert ended.status == 4
    assert "UFRAME.CND: user frame 1 is at 890.363,235.685,323.189" in ended.err

    # and the program is not one for a wheel elsewhere while its frame stays
    there = document()["wheel"]["T_base_contact0_mm"]
    at_old = {"number": 1, "T_base_user_mm": there}
    stays = {**USER, "wheel.T_base_contact0_mm": shifted_wheel(), "program.user_frame": at_old}
    ended = opl("verify", write_job(tmp_path / "stays", stays), tmp_path / "V_SHAPE.JBI")
    assert ended.status == 4


def test_file_that_is_no_condition_file_is_refused(tmp_path):
    job = write_job(tmp_path, USER)
    (tmp_path / "UFRAME.CND").write_text("nothing")
    ended = opl("verify", job, ran() / "out" / "V_SHAPE.JBI", tmp_path / "UFRAME.CND")
    assert ended.status == 2 and "holds no user frame and no tool" in ended.err


def test_one_job_per_pass_is_proven_in_order_and_the_load_stands_in_the_tool_data(tmp_path):
    changes = {
        **USER,
        "passes.rows": 2,
        "search.method": "recursive",
        "program.one_job_per_pass": True,
        "program.tool": 4,
        "program.T_flange_tool_mm": np.eye(4).tolist(),
        "program.at_start": [{"output": 5, "state": True}],
        "workpiece.density_kg_m3": 7850.0,
    }
    job = write_job(tmp_path, changes)
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 0, ended.err
    assert "switches the belt" not in ended.out
    assert "each pass is a job from home to home" in ended.out
    files = [tmp_path / "out" / f"V_SHAPE{end}.JBI" for end in ("", "00", "01", "02", "03")]
    master = parse(files[0].read_bytes().decode())
    assert master.calls == tuple(f"V_SHAPE0{k}" for k in range(4)) and not master.moves
    assert "'PASS 2 OF 2" in files[3].read_text()
    assert opl("verify", job, *files).status == 0
    # passes in another order are not the program
    swapped = tmp_path / "swapped"
    swapped.mkdir()
    for file in files[1:]:
        (swapped / file.name).write_bytes(file.read_bytes())
    text = files[0].read_bytes().replace(b"JOB:V_SHAPE01", b"JOB:X")
    text = text.replace(b"JOB:V_SHAPE02", b"JOB:V_SHAPE01").replace(b"JOB:X", b"JOB:V_SHAPE02")
    (swapped / "V_SHAPE.JBI").write_bytes(text)
    assert opl("verify", job, *(swapped / file.name for file in files)).status == 4

    cell = load_job(job).cell
    solid = trimesh.load(tmp_path / "v_shape.stl")
    mass = 7850.0 * solid.volume * 1e-9
    x, y, z = (cell.T_flange_workpiece @ [*solid.center_mass * 1e-3, 1.0])[:3] * 1e3
    rows = (tmp_path / "out" / "TOOL.CND").read_text().split()
    assert rows[:3] == ["//TOOL", "4", "///NAME"]
    np.testing.assert_allclose([float(v) for v in rows[4].split(",")], [x, y, z], atol=2e-3)
    assert float(rows[5]) == pytest.approx(mass, abs=1e-3)
    assert f"'PART {mass:.3f} KG" in files[2].read_text()


def test_program_that_switches_no_belt_is_cautioned_unless_the_job_says_who_does(tmp_path):
    switched = write_job(tmp_path, {**USER, "program.belt_switched_by": "the operator"})
    assert (
        "caution: nothing in the program switches the belt"
        in opl("run", write_job(tmp_path / "plain"), "--out", tmp_path / "out").out
    )
    ended = opl("run", switched, "--out", tmp_path / "other")
    assert "the belt is switched by the operator, says the job" in ended.out
