"""The folder of a run: files whole or not at all, and no program that nothing vouches for."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from opl.errors import InputError, NoPathError
from opl.files import writing
from opl.job.load import load_job
from opl.run.delivery import claim_folder, deliver
from opl.run.stages import run_job
from opl.run.values import Refused
from tests.support.jobs import POST, document, opl, write_job, write_robot, write_trough

PROVEN = (
    "proven: no motion along these passes, at any contact positions, on along each pass and never "
    "back, each on an IK branch and count of full turns of its own, keeps reach, limits and the "
    "plan's clearances, with leads as the job sets them"
)
PROGRAM = [
    "V_SHAPE.JBI",
    "V_SHAPE.csv",
    "V_SHAPE_contact.svg",
    "V_SHAPE_joints.svg",
    "V_SHAPE_motion.json",
]


def written(folder):
    return sorted(path.name for path in folder.iterdir())


def result_in(folder):
    return json.loads((folder / "result.json").read_text(encoding="utf-8"))


def leave_earlier_run(folder, job="V_SHAPE"):
    """Put the files of a good run of a job into a folder, and something that is not of a run."""
    folder.mkdir()
    for name in (*PROGRAM, "notes.txt"):
        (folder / name).write_text("earlier")
    told = {"status": "ok", "job": job, "program": {"files": [*PROGRAM, "../outside.txt"]}}
    (folder / "result.json").write_text(json.dumps(told), encoding="utf-8")
    (folder.parent / "outside.txt").write_text("not ours")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    changes = {"search.method": "recursive"}
    return run_job(load_job(write_job(tmp_path_factory.mktemp("job"), changes)))


def with_files(run, *names):
    """A run with files, of which only the names matter."""
    return replace(run, files=dict.fromkeys(names, "new\r\n"))


def refused(run):
    prepared = run.proven.planned.prepared
    return Refused(prepared, NoPathError("no path", ["because"]), (), run.seconds)


# the folder


def test_files_are_written_to_the_byte(run, tmp_path):
    paths = deliver(with_files(run, "A.JBI"), tmp_path / "new" / "folder")
    assert [path.name for path in paths] == ["A.JBI", "report.html", "result.json"]
    assert paths[0].read_bytes() == b"new\r\n"
    assert written(tmp_path / "new" / "folder") == ["A.JBI", "report.html", "result.json"]


def test_a_run_without_a_program_takes_the_earlier_program_away(run, tmp_path):
    leave_earlier_run(tmp_path / "out")
    deliver(refused(run), tmp_path / "out")
    assert written(tmp_path / "out") == ["notes.txt", "report.html", "result.json"]
    assert result_in(tmp_path / "out")["status"] == "no_path"
    assert (tmp_path / "outside.txt").is_file()


def test_a_run_with_other_files_takes_the_earlier_ones_away(run, tmp_path):
    leave_earlier_run(tmp_path / "out")
    deliver(with_files(run, "V_SHAPE.JBI"), tmp_path / "out")
    assert written(tmp_path / "out") == ["V_SHAPE.JBI", "notes.txt", "report.html", "result.json"]
    assert (tmp_path / "out" / "V_SHAPE.JBI").read_text() == "new\n"


@pytest.mark.parametrize("text", ["", "[]", '{"program": null}', '{"program": {"files": 3}}'])
def test_a_result_that_cannot_be_read_hinders_nothing(run, tmp_path, text):
    (tmp_path / "result.json").write_text(text)
    deliver(with_files(run, "A.JBI"), tmp_path)
    assert written(tmp_path) == ["A.JBI", "report.html", "result.json"]


def test_a_write_that_fails_leaves_the_earlier_run_as_it_was(run, tmp_path, monkeypatch):
    write = os.write

    def full_disk(file, data):
        if b"status" in bytes(data):  # the result, written after the others
            raise OSError(28, "No space left on device")
        return write(file, data)

    leave_earlier_run(tmp_path / "out")
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    monkeypatch.setattr(os, "write", full_disk)
    with pytest.raises(InputError, match="out: cannot be written to: No space left on device"):
        deliver(with_files(run, "A.JBI", "B.JBI"), tmp_path / "out")
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
    assert written(tmp_path) == ["out", "outside.txt"]


def test_a_folder_belongs_to_one_job(run, tmp_path):
    leave_earlier_run(tmp_path / "out", "OTHER")
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    told = "belongs to job OTHER, says its result.json: name another folder for job V_SHAPE, or"
    for other in (run, refused(run)):
        with pytest.raises(InputError, match=f"out: {told}"):
            deliver(other, tmp_path / "out")
    ended = opl("run", write_job(tmp_path / "j"), "--out", tmp_path / "out")
    assert (ended.status, ended.out) == (2, "") and told in ended.err
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_a_folder_is_held_from_before_the_work(run, tmp_path):
    job = write_job(tmp_path / "j")
    with claim_folder(tmp_path / "a" / "b", "V_SHAPE") as claim:
        ended = opl("run", job, "--out", tmp_path / "a" / "b")
        told = f"{tmp_path / 'a' / 'b'}: another run writes to it (process {os.getpid()})"
        assert ended.status == 2 and told in ended.err
        deliver(with_files(run, "A.JBI"), claim)
    assert written(tmp_path / "a" / "b") == ["A.JBI", "report.html", "result.json"]
    with claim_folder(tmp_path / "c" / "d", "V_SHAPE"):
        pass  # cut short before it had anything to deliver
    assert not (tmp_path / "c").exists()


def test_the_folder_is_checked_before_the_work_and_not_made(tmp_path, monkeypatch):
    writing.check_folder(tmp_path / "a" / "b")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.chdir(tmp_path)
    writing.check_folder(Path("out/x"))
    (tmp_path / "file").write_text("")
    (tmp_path / "dangling").symlink_to("nowhere")
    for place in ("file", "file/below", "dangling"):
        with pytest.raises(InputError, match="must be a folder for the files, is something else"):
            writing.check_folder(tmp_path / place)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_leave_to_write_is_refused(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o500)
    with pytest.raises(InputError, match="closed: is a folder that cannot be written to"):
        writing.check_folder(tmp_path / "closed" / "out")


def test_leave_to_write_is_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    ended = opl("run", write_job(tmp_path), "--out", tmp_path / "out")
    assert ended.status == 2
    assert ended.err == f"error: {tmp_path}: is a folder that cannot be written to\n"


def test_an_out_that_is_a_file_is_refused_and_kept(tmp_path):
    (tmp_path / "file").write_text("mine")
    for place in ("file", "file/below"):
        ended = opl("run", write_job(tmp_path), "--out", tmp_path / place)
        assert ended.status == 2
        assert ended.err.startswith(f"error: {tmp_path / 'file'}: must be a folder for the files")
    assert (tmp_path / "file").read_text() == "mine"


# no path: why, and nothing left


def run_without_path(job, out, name="V_SHAPE"):
    """Run a job into the folder of an earlier good run; return the lines that say why not."""
    leave_earlier_run(out, name)
    ended = opl("run", job, "--out", out)
    assert ended.status == 3, ended.err
    assert "Traceback" not in ended.err
    assert written(out) == ["notes.txt", "report.html", "result.json"]
    result = result_in(out)
    assert result["status"] == "no_path"
    assert result["program"] is None and result["path"] is None and result["verification"] is None
    told = [*result["reasons"], *result["remedies"]]
    assert ended.err == "error: " + "\n  ".join(told) + "\n"
    return result["reasons"]


def test_a_trough_too_narrow_for_the_wheel_says_how_deep_the_part_would_cut(tmp_path):
    first, *why = run_without_path(write_trough(tmp_path / "t"), tmp_path / "out", "TROUGH")
    assert first == "no path: no free configuration at cutter point 0 (0 of 3 reached)"
    assert why[1:] == [PROVEN]
    assert why[0].startswith(
        "cutter points 0 to 2 (pass 1): nothing is free: 100 % part cuts into wheel; the part cuts "
    )
    depth = float(why[0].split("the part cuts ")[1].split(" mm into the wheel at best")[0])
    assert 8.0 < depth < 15.01  # the walls are 15 mm high and 10 mm thick
    fixed = result_in(tmp_path / "out")["fixed"]
    assert not fixed["feasible"]
    assert fixed["reason"].startswith("part cuts into wheel at 3 of 3 cutter points (0-2), ")


def test_a_trough_wide_enough_for_the_wheel_is_ground(tmp_path):
    job = write_trough(tmp_path / "t", width_mm=80.0, depth_mm=5.0)
    ended = opl("run", job, "--out", tmp_path / "out", "-q")
    assert ended.status == 0, ended.err
    assert "TROUGH.JBI" in written(tmp_path / "out")


def test_a_joint_that_ends_short_is_named(tmp_path):
    write_robot(tmp_path / "j" / "tight", {"S": (60, 180)})
    changes = {"robot": "tight", "process.home_deg": [90, -45, -50, 0, 50, -180]}
    first, *why = run_without_path(write_job(tmp_path / "j", changes), tmp_path / "out")
    assert first.startswith("no path: no free configuration at cutter point 0 (0 of 19 reached)")
    assert why == [
        "cutter points 0 to 18 (pass 1): nothing is free: 100 % beyond the limits of S", PROVEN
    ]  # fmt: skip


def test_an_obstacle_in_the_way_is_named_with_what_hits_it(tmp_path):
    obstacles = [*document()["obstacles"], POST]
    first, *why = run_without_path(
        write_job(tmp_path / "j", {"obstacles": obstacles}), tmp_path / "out"
    )
    assert first.startswith("no path")
    assert any("part hits post" in line for line in why)
    assert why.pop() == PROVEN
    assert all(line.startswith("cutter point") for line in why)


# planned, but not safe


def test_what_the_planner_overlooks_pybullet_finds_and_no_program_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr("opl.motion.collision_check.MoveCheck.colliding", lambda *arguments: [])
    monkeypatch.setattr("opl.planning.track_check.linked", lambda motion, links: motion)
    leave_earlier_run(tmp_path / "out")
    obstacles = [*document()["obstacles"], POST]
    job = write_job(tmp_path / "j", {"obstacles": obstacles})
    ended = opl("run", job, "--out", tmp_path / "out")
    assert ended.status == 4
    assert written(tmp_path / "out") == ["notes.txt", "report.html", "result.json"]
    result = result_in(tmp_path / "out")
    assert result["status"] == "unsafe"
    assert result["program"] is None
    assert result["verification"]["collisions"] > 0
    assert result["path"]["nodes"] == 19
    assert any("part and post: " in reason for reason in result["reasons"])
    first, *further = ended.err.splitlines()
    assert first == "error: planned, but not proven safe; no program was written"
    assert [line.removeprefix("  ") for line in further] == result["reasons"]
    assert all(reason.startswith("collision at ") for reason in result["reasons"])
