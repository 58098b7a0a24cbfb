"""The store: one job for each target, states that only go where they should, nothing lost."""

import subprocess
import sys

import pytest

from opl.errors import InputError
from opl.files.confining import confine_to, require_inside
from opl.files.names import checked_name
from opl.job.files import files_of_job
from opl.store.jobs import MOST_DEATHS, Store
from opl.store.made import changed_files, note_files
from opl.store.values import FileRecord, Outcome, Progress, State, Task
from tests.support.jobs import write_job, write_robot

TASK = Task("run", "job.yaml", "out", changes={"passes.rows": 2}, programs=("A.JBI",))
MADE = Outcome("ok", 0, "", "out/A", "result.json", {"A.JBI": FileRecord("00", 1, 2)})


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "store.sqlite")


def other(store):
    """Return the store as another living process sees it."""
    found = Store(store.path)
    found._owner = f"elsewhere {1} {1}"
    return found


# states


def test_a_job_comes_back_as_it_was_given(store):
    job = store.submit("1", "A", "name", TASK)
    assert (job.task, job.state, job.outcome) == (TASK, State.QUEUED, None)
    assert store.claim().state is State.RUNNING
    store.finish("1", MADE)
    assert store.get("1").outcome == MADE
    assert store.get("1").state is State.DONE
    assert Store(store.path).of_target("A") == store.get("1")
    assert store.counts()["done"] == 1 and store.check() == []


def test_what_is_done_is_answered_and_done_again_only_on_request(store):
    store.submit("1", "A", "", TASK)
    store.claim()
    store.finish("1", MADE)
    assert store.submit("1", "A", "", TASK).state is State.DONE
    assert store.claim() is None
    assert store.submit("1", "A", "", TASK, again=True).state is State.QUEUED


@pytest.mark.parametrize("final", [True, False])
def test_a_failure_is_an_answer_unless_a_limit_or_a_crash_made_it(store, final):
    store.submit("1", "A", "", TASK)
    store.claim()
    store.finish("1", Outcome("no_path", 3, "none", final=final))
    wanted = State.FAILED if final else State.QUEUED
    assert store.submit("1", "A", "", TASK).state is wanted


def test_a_changed_job_takes_the_place_of_the_one_before(store):
    store.submit("1", "A", "", TASK)
    store.submit("2", "A", "", TASK)
    assert store.get("1") is None and store.of_target("A").id == "2"


def test_what_somebody_works_on_is_not_replaced(store):
    store.submit("1", "A", "", TASK)
    assert other(store).claim().id == "1"
    assert store.submit("2", "A", "", TASK).id == "1"
    assert store.claim() is None


def test_jobs_are_claimed_once_and_the_oldest_first(store):
    for id_ in ("1", "2", "3"):
        store.submit(id_, id_, "", TASK)
    assert [other(store).claim().id, store.claim("3").id, store.claim().id] == ["1", "3", "2"]
    assert store.claim() is None and store.claim("1") is None


def test_a_job_of_an_owner_that_is_gone_is_free_again(store):
    script = (
        "import sys; from pathlib import Path; from opl.store.jobs import Store;"
        f"Store(Path({str(store.path)!r})).claim()"
    )
    store.submit("1", "A", "", TASK)
    subprocess.run([sys.executable, "-c", script], check=True)
    assert store.get("1").state is State.RUNNING
    assert store.claim().attempts == 2


def test_a_lease_that_is_not_renewed_ends(store, monkeypatch):
    monkeypatch.setattr("opl.store.jobs.LEASE", -1.0)
    store.submit("1", "A", "", TASK)
    other(store).claim()
    assert store.claim().attempts == 2
    assert not other(store).renew("1", Progress("search", 0.5, 2.5, 2.25))
    other(store).finish("1", Outcome("error", 1))  # too late: it is somebody else's
    assert store.get("1").state is State.RUNNING


def test_a_job_that_kills_its_workers_fails_in_the_end(store):
    store.submit("1", "A", "", TASK)
    for _ in range(MOST_DEATHS):
        assert store.claim() is not None
        store.give_back("1", died=True)
    assert store.claim() is None
    assert store.get("1").outcome.message == "its worker process died, 3 times"


def test_a_job_is_not_to_blame_for_those_who_were_stopped(store):
    store.submit("1", "A", "", TASK)
    for _ in range(2 * MOST_DEATHS):
        assert store.claim() is not None
        store.give_back("1", died=False)
    assert store.claim().attempts == 2 * MOST_DEATHS + 1


def test_cancelling(store):
    for id_ in ("1", "2"):
        store.submit(id_, id_, "", TASK)
    store.claim("1")
    assert store.renew("1", Progress("search", 0.5, 2.5, 2.25))
    assert store.get("1").progress == Progress("search", 0.5, 2.5, 2.25)
    assert store.cancel("1").cancelling and store.cancel("2").state is State.CANCELLED
    assert not store.renew("1", Progress("search", 0.6))
    store.finish("1", None)
    assert store.get("1").state is State.CANCELLED
    assert store.cancel("nobody") is None
    assert store.submit("1", "1", "", TASK).state is State.QUEUED


def test_a_cancelled_job_whose_worker_dies_stays_cancelled(store):
    store.submit("1", "A", "", TASK)
    store.claim()
    store.cancel("1")
    store.give_back("1", died=True)
    assert store.get("1").state is State.CANCELLED


def test_only_what_has_ended_is_forgotten(store):
    store.submit("1", "A", "", TASK)
    assert not store.remove("1")
    store.cancel("1")
    assert store.remove("1") and store.get("1") is None


def test_a_file_that_is_no_store_is_refused(tmp_path):
    path = tmp_path / "store.sqlite"
    path.write_bytes(b"no store at all, but longer than the head of a file of SQLite" * 10)
    with pytest.raises(InputError, match=r"store.sqlite: cannot be used: .*remove it"):
        Store(path)


# files


def test_changed_files_are_noticed(tmp_path):
    for name in ("a", "b", "c"):
        (tmp_path / name).write_text(name)
    known = note_files([tmp_path / name for name in ("a", "b", "c")])
    assert changed_files(tmp_path, known, every_byte=True) == []
    (tmp_path / "a").unlink()
    (tmp_path / "b").write_text("longer")
    assert changed_files(tmp_path, known) == ["a", "b"]
    before = (tmp_path / "c").stat()
    (tmp_path / "c").write_text("d")
    import os

    os.utime(tmp_path / "c", ns=(before.st_atime_ns, before.st_mtime_ns))
    assert changed_files(tmp_path, known) == ["a", "b"]  # as it looks
    assert changed_files(tmp_path, known, every_byte=True) == ["a", "b", "c"]


@pytest.mark.parametrize(
    "name",
    ["", "/etc/passwd", "../x", "a/../../x", "a//b", "./a", "C:/x", "a\\b", ".hidden", "a/.git/b",
     "a\0b", "a\nb", "a" * 300, "/".join("a" * 20), " a", "a ", "\ud800", "a/", "~\t", "a|b"],
)  # fmt: skip
def test_names_that_lead_elsewhere_are_refused(name):
    with pytest.raises(InputError, match="must"):
        checked_name(name)


@pytest.mark.parametrize("name", ["job.yaml", "my arm/robot.yaml", "ünï/ß.stl", "~x", "a" * 100])
def test_plain_names_pass(name):
    assert checked_name(name) == name


def test_reading_is_confined(tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "secret").write_text("x")
    (home / "link").symlink_to(tmp_path / "secret")
    (home / "own").write_text("x")
    with confine_to(home):
        require_inside(home / "own")
        for path in (home / "link", home / ".." / "secret", tmp_path / "none"):
            with pytest.raises(InputError, match="lies outside of the job's own files"):
                require_inside(path)
    require_inside(tmp_path / "secret")


def test_all_files_of_a_job_are_found_without_loading_it(tmp_path):
    write_robot(tmp_path / "mine", {})
    job = write_job(tmp_path, {"robot": "mine", "program.template": "own.j2"})
    import yaml

    found = files_of_job(job, yaml.safe_load(job.read_text()))
    assert sorted(found) == [
        "job", "own.j2", "robot: mh24.urdf", "robot: robot.yaml", "surface.json", "v_shape.stl",
    ]  # fmt: skip
    assert found["own.j2"] == tmp_path / "own.j2"  # whether it is there or not
