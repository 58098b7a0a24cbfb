"""Many jobs: one that fails leaves the others alone, and every one is accounted for."""

import json
import os
import re
import xml.etree.ElementTree as ET
from dataclasses import fields
from pathlib import Path
from typing import ClassVar

import pytest

from opl.errors import InputError
from opl.files.claiming import write_files
from opl.job import keys
from opl.job.reference import json_schema
from opl.run.batch import find_jobs
from opl.run.result import FixedReport, PathReport, Report, RobotReport, to_json
from opl.store.made import note_files
from opl.store.values import Outcome, Task
from opl.work import batch, doing
from opl.work import inbox as inbox_module
from opl.work.worker import WorkerDied
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


class Pretending:
    """A worker without a process: what becomes of a job is the name of its file."""

    did: ClassVar[list[str]] = []

    def __init__(self, limits):
        self.limits = limits

    def start(self):
        pass

    def end(self):
        pass

    def do(self, task, beat):
        path = Path(task.job)
        Pretending.did.append(path.stem)
        if path.stem == "dies":
            raise WorkerDied
        if path.stem == "fails":
            return Outcome("no_path", 3, "no path: none\nbecause")
        if path.stem == "late":
            return Outcome("error", 1, f"{path}: takes more than it may", final=False)
        name = task.changes.get("name", path.stem.upper())
        values = {
            "cutter_points": 7,
            "seconds": {"total": 1.25},
            "path": made_of(PathReport, {"joint_ranges_rad": [0.5, 1.5], "joint_range_sum_rad": 2}),
        }
        folder = Path(task.out) / name
        written = write_files(folder, {"result.json": to_json(made_of(Report, values))})
        return Outcome("ok", 0, "", str(folder), "result.json", note_files(written))


def made_of(kind, values):
    """Return a report with some values; None stands for the others, nothing for lists of others."""
    empty = (
        {"compared": {}, "inputs": {}, "fixed": made_of(FixedReport, {})} if kind is Report else {}
    )
    empty |= {"robot": RobotReport("r", [])} if kind is Report else {}
    return kind(**{one.name: {**empty, **values}.get(one.name) for one in fields(kind)})


@pytest.fixture
def pretended(tmp_path, monkeypatch):
    """Return what runs jobs by name with pretending workers, in an empty folder."""
    monkeypatch.setattr(batch, "Worker", Pretending)
    monkeypatch.setattr(Pretending, "did", [])
    monkeypatch.chdir(tmp_path)

    def run(names, *options):
        for name in names:
            if not Path(f"{name}.yaml").exists():
                touch(tmp_path / f"{name}.yaml", f"name: {name.upper()}\nworkpiece: {{}}\n")
        return opl("batch", *(f"{name}.yaml" for name in names), *options)

    return run


def rows_of(ended):
    return [(row["job"], row["status"], row["message"]) for row in json.loads(ended.out)]


def cells_of(ended):
    return [
        [cell.strip() for cell in line.strip("│").split("│")]
        for line in ended.out.splitlines()
        if line.startswith("│")
    ]


def test_the_table_tells_all_and_reasons_follow_it(pretended):
    ended = pretended(["good", "fails"])
    assert ended.status == 3
    assert cells_of(ended) == [
        ["good.yaml", "ok", "7", "2.0000", "1.2", "out/GOOD"],
        ["fails.yaml", "no_path", "", "", "", ""],
    ]
    assert "range sum [rad]" in ended.out and "time [s]" in ended.out
    assert ended.out.endswith("fails.yaml: no path: none\n  because\n1 of 2 jobs have a program\n")
    assert sorted(ended.err.splitlines()) == ["no_path: fails.yaml", "ok: good.yaml"]


def test_quiet_prints_the_table_only(pretended):
    ended = pretended(["good"], "-q")
    assert (ended.status, ended.err) == (0, "")
    assert "1 of 1 jobs have a program" in ended.out


def test_a_worker_that_dies_takes_no_other_job_with_it(pretended):
    ended = pretended(["dies", "good"], "--workers", "1", "--json")
    assert ended.status == 1
    assert rows_of(ended) == [
        ("dies.yaml", "error", "dies.yaml: its worker process died, 3 times"),
        ("good.yaml", "ok", ""),
    ]


def test_a_bug_in_one_job_is_an_outcome_that_says_so(tmp_path, monkeypatch):
    def stumble(*_, **__):
        raise ZeroDivisionError("oh")

    monkeypatch.setattr(doing, "load_job", stumble)
    outcome = doing.do(Task("run", "job.yaml", "out"), lambda *_: True)
    assert (outcome.status, outcome.exit_status, outcome.folder) == ("error", 1, None)
    assert re.fullmatch(r"ZeroDivisionError: oh \(a bug: .*\)", outcome.message)
    assert not outcome.final


# as a build


def test_what_has_not_changed_is_left_as_it_is(pretended):
    first = json.loads(pretended(["good", "fails", "late"], "--json").out)
    assert Pretending.did == ["good", "fails", "late"]
    again = json.loads(pretended(["good", "fails", "late"], "--json").out)
    assert Pretending.did[3:] == ["late"]  # it would not end so again for sure
    assert [row["unchanged"] for row in again] == [True, True, False]
    for one, other in zip(first[:2], again[:2], strict=True):
        assert {**one, "unchanged": True} == other


def test_what_has_changed_is_run_again(pretended, tmp_path):
    pretended(["one", "two", "three", "four"])
    touch(tmp_path / "one.yaml", "name: ONE\nworkpiece: {mesh: other.stl}\n")
    (tmp_path / "out" / "TWO" / "result.json").write_text("{}")
    (tmp_path / "out" / "THREE" / "result.json").unlink()
    assert [line.split(": ")[0] for line in opl("batch", ".", "--status").out.splitlines()] == [
        "unchanged, last time ok", "changed, last time ok", "files changed, last time ok",
        "files changed, last time ok", "1 of 4 jobs are unchanged",
    ]  # fmt: skip
    del Pretending.did[:]
    assert pretended(["one", "two", "three", "four"]).status == 0
    assert sorted(Pretending.did) == ["one", "three", "two"]
    touch(tmp_path / "other.stl", "now it is there")
    del Pretending.did[:]
    pretended(["one", "two"])
    assert Pretending.did == ["one"]
    pretended(["one", "two"], "--force")
    assert sorted(Pretending.did) == ["one", "one", "two"]


def test_another_version_of_opl_runs_all_again(pretended, monkeypatch):
    pretended(["good"])
    monkeypatch.setattr("opl.store.identity.made_with", lambda: {"opl": "9.9"})
    pretended(["good"])
    assert Pretending.did == ["good", "good"]


def test_the_audit_reads_every_byte(pretended, tmp_path):
    pretended(["one", "two"])
    clean = opl("batch", "--audit")
    assert clean == Ended(0, "2 files looked at, 0 faults\n", "")
    path = tmp_path / "out" / "ONE" / "result.json"
    before, content = path.stat(), path.read_bytes()
    path.write_bytes(content.replace(b"7", b"8", 1))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    (tmp_path / "out" / "TWO" / "result.json").unlink()
    (tmp_path / "out" / ".opl-file-x").touch()
    ended = opl("batch", "--audit", "--json")
    assert ended.status == 1
    told = [line.split(" (")[0] for line in json.loads(ended.out)["wrong"]]
    assert told == [
        "out/ONE/result.json: is not what was written",
        "out/TWO/result.json: is gone",
        "out/.opl-file-x: was left by a run that was killed; the next batch clears it",
    ]
    assert opl("batch", "--audit", "--out", "none").status == 2


def test_a_job_whose_files_change_while_it_is_run_is_run_as_it_is_then(pretended, monkeypatch):
    do = Pretending.do

    def edited(worker, task, beat):
        outcome = do(worker, task, beat)
        touch(Path("good.yaml"), "name: GOOD\nworkpiece: {unit: mm}\n")
        return outcome

    monkeypatch.setattr(Pretending, "do", edited)
    assert pretended(["good"], "-q").status == 0
    assert Pretending.did == ["good", "good"]
    assert pretended(["good"], "-q").status == 0
    assert Pretending.did == ["good", "good"]


def test_build_servers_get_junit(pretended, tmp_path):
    pretended(["good"])
    pretended(["good", "fails", "late"], "--junit", "made.xml")
    suite = ET.parse(tmp_path / "made.xml").getroot()
    assert {key: suite.get(key) for key in ("tests", "failures", "errors", "skipped")} == {
        "tests": "3", "failures": "1", "errors": "1", "skipped": "1",
    }  # fmt: skip
    assert suite.find("testcase/failure").text == "no path: none\nbecause"


def test_jobs_are_listed_and_shown(pretended):
    pretended(["good", "fails"], "--log", "log")
    listed = opl("jobs").out.splitlines()
    assert [line.split("  ")[2] for line in listed[:2]] == ["FAILS", "GOOD"]
    assert listed[2] == "0 queued, 0 running, 1 done, 1 failed, 0 cancelled"
    id_ = listed[0].split()[0]
    shown = opl("jobs", "out", id_).out
    assert "failed no_path" in shown and "  because" in shown
    events = [json.loads(line) for line in Path("log").read_text().splitlines()]
    assert [(one["event"], one["name"]) for one in events if one["job"].startswith(id_)] == [
        ("begun", "FAILS"), ("ended", "FAILS"),
    ]  # fmt: skip
    assert opl("jobs", "out", "nothing").status == 2


# sweeps


def test_a_list_where_one_value_belongs_makes_a_job_for_each(pretended, tmp_path):
    text = "name: S\nwheel: {radius_mm: [150, 148], width_mm: 60}\npasses: {rows: [1, 2, 3]}\n"
    touch(tmp_path / "s.yaml", text)
    ended = pretended(["s"])
    assert ended.status == 0 and len(Pretending.did) == 6
    assert cells_of(ended)[6:8] == [
        ["S_1", "150", "1", "ok", "2.0000", "", "", ""],
        ["S_2", "150", "2", "ok", "2.0000", "", "", ""],
    ]
    assert sorted(path.name for path in (tmp_path / "out").iterdir() if path.is_dir()) == [
        f"S_{number}" for number in range(1, 7)
    ]
    rows = json.loads(pretended(["s"], "--json").out)
    assert rows[5]["variant"] == {"wheel.radius_mm": 148, "passes.rows": 3}
    assert all(row["unchanged"] for row in rows)


def test_sweeps_that_make_no_sense_are_refused(pretended, tmp_path):
    touch(tmp_path / "empty.yaml", "name: E\nwheel: {radius_mm: []}\n")
    touch(tmp_path / "many.yaml", f"name: M\nwheel: {{a: {[*range(40)]}, b: {[*range(40)]}}}\n")
    touch(tmp_path / "long.yaml", f"name: {'L' * 27}\nwheel: {{radius_mm: [1, 2]}}\n")
    touch(tmp_path / "twice.yaml", "name: T\nwheel: {radius_mm: [1, 2, 1]}\n")
    touch(tmp_path / "s.yaml", "name: S\nwheel: {radius_mm: [1, 2]}\n")
    touch(tmp_path / "s_1.yaml", "name: S_1\nwheel: {}\n")
    ended = pretended(["empty", "many", "long", "twice", "s", "s_1"], "--json")
    told = [message for _, status, message in rows_of(ended) if status == "bad input"]
    assert [message.partition(", got")[0] for message in told] == [
        "empty.yaml: wheel.radius_mm: must be a value, or a list of values to be tried",
        "many.yaml: makes 1600 jobs, at most 1000 are made of a file",
        "long.yaml: name: must leave room for the numbers of 2 jobs: 26 characters at the most",
        "twice.yaml: wheel.radius_mm: has a value twice, which makes the same job twice",
        "s.yaml: name: must be another for each job, S_1 is also that of s_1.yaml",
        "s_1.yaml: name: must be another for each job, S_1 is also that of s.yaml",
    ]
    assert Pretending.did == ["s"]


def test_the_keys_that_hold_lists_are_those_of_the_model():
    schema = json_schema("job")
    found = {True: set(), False: set()}
    for one in (schema, *schema["$defs"].values()):
        for key, value in one["properties"].items():
            found[holds_lists(value, schema["$defs"])].add(key)
    assert found[True] == keys.LISTS and not found[True] & found[False]


def holds_lists(value, definitions):
    if "$ref" in value:
        return holds_lists(definitions[value["$ref"].split("/")[-1]], definitions)
    inside = [one for key in ("anyOf", "oneOf", "allOf") for one in value.get(key, [])]
    return value.get("type") == "array" or any(holds_lists(one, definitions) for one in inside)


# a folder that is watched


def test_jobs_are_run_as_they_come_and_change(tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "Worker", Pretending)
    monkeypatch.setattr(Pretending, "did", [])
    inbox, outbox = tmp_path / "in", tmp_path / "out"
    inbox.mkdir()
    seen = []

    class Enough(BaseException):
        pass

    def look(_):
        """Stand for the time between two looks: what happens to the folder meanwhile."""
        step = len(seen)
        seen.append(list(Pretending.did))
        if step == 1:
            touch(inbox / "a.yaml", "name: A\nworkpiece: {}\n")
        elif step == 4:
            touch(inbox / "a.yaml", "name: A\nworkpiece: {x: 1}\n")
            touch(inbox / "fails.yaml", "name: F\nworkpiece: {}\n")
        elif step == 8:
            raise Enough

    monkeypatch.setattr(inbox_module.time, "sleep", look)
    rows = []
    with pytest.raises(Enough):
        inbox_module.watch_inbox(inbox, outbox, batch.BatchSettings(), rows.append)
    assert [len(did) for did in seen] == [0, 0, 0, 1, 1, 1, 3, 3, 3]  # when it stays as it is
    assert [(row.job.name, row.status) for row in rows] == [
        ("a.yaml", "ok"), ("a.yaml", "ok"), ("fails.yaml", "no_path"),
    ]  # fmt: skip
    assert (outbox / "report.html").is_file()
    with pytest.raises(InputError, match="must be the folder that jobs come into"):
        inbox_module.watch_inbox(tmp_path / "none", outbox, batch.BatchSettings(), rows.append)
