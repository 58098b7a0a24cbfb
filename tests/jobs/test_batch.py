"""Many jobs: one that fails leaves the others alone, and every one is accounted for."""

import json
import multiprocessing
import os
import re
from concurrent.futures import Future
from dataclasses import fields
from pathlib import Path

import pytest

from opl.errors import InputError
from opl.run import batch
from opl.run.batch import BatchRow, find_jobs
from opl.run.result import PathReport, Report
from tests.support.jobs import Ended, opl, write_job, write_trough


def touch(path, text):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


# which files are jobs


def test_a_folder_means_every_job_file_in_it_and_no_other_yaml(tmp_path):
    jobs = [
        touch(tmp_path / "a.yaml", "workpiece: {}\n"),
        touch(tmp_path / "b" / "c.yml", "wheel: {}\nworkpeice: {}\n"),
        touch(tmp_path / "b" / "torn.yaml", "name: {\n"),
    ]
    touch(tmp_path / "robots" / "robot.yaml", "name: mine\njoints: []\n")
    touch(tmp_path / "list.yaml", "- workpiece\n")
    touch(tmp_path / "empty.yaml", "")
    touch(tmp_path / "surface.json", '{"workpiece": 1}')
    touch(tmp_path / ".venv" / "x.yaml", "workpiece: {}\n")
    (tmp_path / "folder.yaml").mkdir()
    assert find_jobs([tmp_path]) == jobs


def test_files_named_come_in_their_order_and_once(tmp_path, monkeypatch):
    first = touch(tmp_path / "z.yaml", "workpiece: {}\n")
    second = touch(tmp_path / "a.yaml", "not a job at all\n")
    assert find_jobs([first, second, tmp_path]) == [first, second]
    monkeypatch.chdir(tmp_path)
    assert find_jobs([first, Path("z.yaml"), Path(".")]) == [first]


def test_nothing_to_do_is_bad_usage(tmp_path):
    (tmp_path / "empty").mkdir()
    for place, told in (("none", "no such file or folder"), ("empty", r"holds no job file \(\*")):
        with pytest.raises(InputError, match=f"{place}: {told}"):
            find_jobs([tmp_path / place])
    ended = opl("batch", tmp_path / "none")
    assert ended == Ended(2, "", f"error: {tmp_path / 'none'}: no such file or folder\n")


def test_an_out_that_is_a_file_is_refused_before_the_work(tmp_path):
    job = touch(tmp_path / "job.yaml", "workpiece: {}\n")
    ended = opl("batch", job, "--out", job)
    assert ended.status == 2
    assert ended.err == f"error: {job}: must be a folder for the files, is something else\n"


# good, bad and impossible jobs together


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """Run a folder with a good, a bad, an impossible job and two of one name, by two workers."""
    home = tmp_path_factory.mktemp("mixed")
    touch(home / "jobs" / "notes.yaml", "remember: the belt\n")
    write_job(home / "jobs" / "good", {"name": "GOOD"})
    write_job(home / "jobs" / "bad", {"name": "BAD", "wheel.width_mm": -3, "wheel.colour": "red"})
    write_trough(home / "jobs" / "narrow")
    for twin in ("twin1", "twin2"):
        write_job(home / "jobs" / twin, {"name": "TWIN"})
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(home)
        ended = opl("batch", "jobs", "--out", "made", "--workers", "2", "--json")
    return home, ended, json.loads(ended.out)


def test_every_job_has_its_row_in_the_order_of_the_files(mixed):
    _, ended, rows = mixed
    assert ended.err == ""
    assert [(row["job"], row["status"], row["exit_status"]) for row in rows] == [
        ("jobs/bad/job.yaml", "bad input", 2),
        ("jobs/good/job.yaml", "ok", 0),
        ("jobs/narrow/job.yaml", "no_path", 3),
        ("jobs/twin1/job.yaml", "bad input", 2),
        ("jobs/twin2/job.yaml", "bad input", 2),
    ]
    assert ended.status == 3


def test_the_good_job_has_its_files_and_the_impossible_one_its_page_only(mixed):
    home, _, rows = mixed
    made = {
        path.name: sorted(file.name for file in path.iterdir())
        for path in (home / "made").iterdir()
        if path.is_dir()
    }
    assert "TROUGH/report.html" in (home / "made" / "report.html").read_text(encoding="utf-8")
    assert made == {
        "GOOD": [
            "GOOD.JBI",
            "GOOD.csv",
            "GOOD_contact.svg",
            "GOOD_joints.svg",
            "GOOD_motion.json",
            "report.html",
            "result.json",
        ],
        "TROUGH": ["report.html", "result.json"],
    }
    told = {row["job"]: row for row in rows}["jobs/good/job.yaml"]
    assert told["folder"] == "made/GOOD" and told["message"] == ""
    assert told["result"] == json.loads((home / "made" / "GOOD" / "result.json").read_text())


def test_every_failure_says_why(mixed):
    bad, _, narrow, first, second = (row["message"] for row in mixed[2])
    assert bad.splitlines()[:2] == [
        "jobs/bad/job.yaml: 2 faults",
        "wheel.width_mm: must be more than 0, got -3",
    ]
    assert narrow.startswith("no path: no free configuration at cutter point 0")
    assert "part cuts into wheel" in narrow
    assert first == (
        "jobs/twin1/job.yaml: name: must be another for each job, TWIN is also that of "
        "jobs/twin2/job.yaml"
    )
    assert second.endswith("TWIN is also that of jobs/twin1/job.yaml")


# the table, and workers that die; what the workers do is replaced


def pretend(path, out):
    """Stand for a run in a worker: what becomes of a job is its name."""
    if path.stem == "dies":
        os._exit(9)
    if path.stem == "fails":
        return BatchRow(path, "no_path", 3, out / "F", "no path: none\nbecause", None)
    values = {
        "cutter_points": 7,
        "seconds": {"total": 1.25},
        "path": made_of(PathReport, {"joint_ranges_rad": [0.5, 1.5], "joint_range_sum_rad": 2.0}),
    }
    return BatchRow(path, "ok", 0, out / path.stem, "", made_of(Report, values))


def made_of(kind, values):
    """Return a report with some values; None stands for the others."""
    return kind(**{field.name: values.get(field.name) for field in fields(kind)})


class OneByOne:
    """A pool without processes."""

    def __init__(self, workers):
        assert workers >= 1

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def submit(self, function, *arguments):
        future = Future()
        future.set_result(function(*arguments))
        return future


def run_pretended(tmp_path, monkeypatch, names, *options):
    monkeypatch.setattr(batch, "_run_one", pretend)
    monkeypatch.chdir(tmp_path)
    for name in names:
        touch(tmp_path / f"{name}.yaml", "workpiece: {}\n")
    return opl("batch", *(f"{name}.yaml" for name in names), *options)


def test_the_table_tells_all_and_reasons_follow_it(tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "_pool", OneByOne)
    ended = run_pretended(tmp_path, monkeypatch, ["good", "fails"])
    assert ended.status == 3
    cells = [
        [cell.strip() for cell in line.strip("│").split("│")]
        for line in ended.out.splitlines()
        if line.startswith("│")
    ]
    assert cells == [
        ["good.yaml", "ok", "7", "2.0000", "1.2", "out/good"],
        ["fails.yaml", "no_path", "", "", "", "out/F"],
    ]
    assert "range sum [rad]" in ended.out and "time [s]" in ended.out
    assert ended.out.endswith("fails.yaml: no path: none\n  because\n1 of 2 jobs have a program\n")
    assert sorted(ended.err.splitlines()) == ["no_path: fails.yaml", "ok: good.yaml"]


def test_quiet_prints_the_table_only(tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "_pool", OneByOne)
    ended = run_pretended(tmp_path, monkeypatch, ["good"], "-q")
    assert (ended.status, ended.err) == (0, "")
    assert "1 of 1 jobs have a program" in ended.out


def test_a_worker_that_dies_takes_no_other_job_with_it(tmp_path, monkeypatch):
    ended = run_pretended(tmp_path, monkeypatch, ["dies", "good"], "--workers", "1", "--json")
    assert ended.status == 1
    assert [(row["job"], row["status"], row["message"]) for row in json.loads(ended.out)] == [
        ("dies.yaml", "error", "dies.yaml: its worker process died"),
        ("good.yaml", "ok", ""),
    ]
    assert not multiprocessing.active_children()


def test_a_bug_in_one_job_is_a_row_that_says_so(tmp_path, monkeypatch):
    def stumble(path):
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(batch, "load_job", stumble)
    row = batch._run_one(tmp_path / "job.yaml", tmp_path)
    assert (row.status, row.exit_status, row.folder) == ("error", 1, None)
    assert re.fullmatch(r"ZeroDivisionError: oh \(a bug: .*\)", row.message)
