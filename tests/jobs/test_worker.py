"""A worker: a process with limits, which may die without taking anything with it."""

import os
import signal
from dataclasses import replace

import pytest

from opl.store.values import Task
from opl.work import doing
from opl.work.worker import Limits, Worker, WorkerDied
from tests.support.jobs import write_job


@pytest.fixture
def task(tmp_path):
    return Task("run", "job.yaml", "out", home=str(write_job(tmp_path).parent))


def on(_progress):
    return True


def test_a_job_that_takes_too_long_is_ended(task, tmp_path):
    worker = Worker(Limits(seconds=0.3))
    outcome = worker.do(task, on)
    assert outcome.message == "job.yaml: takes more than the 0.3 s that it may take"
    assert (outcome.status, outcome.final, worker.pid) == ("error", False, None)
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").glob("*/*.JBI"))


def test_a_job_that_takes_too_much_memory_is_ended(task):
    worker = Worker(Limits(memory=300_000_000))
    outcome = worker.do(task, on)
    assert outcome.message == "job.yaml: takes more than the 300 MB of memory that it may take"
    assert not outcome.final
    worker.end()


def test_a_job_is_cancelled_while_it_is_planned_and_one_killed_is_told(task, tmp_path):
    worker, seen = Worker(Limits()), []

    def until_the_search(progress):
        seen.append(progress.stage)
        return progress.stage != "search"

    assert worker.do(task, until_the_search) is None
    assert worker.pid is not None  # it is ready for the next one
    assert "verification" not in seen
    assert not (tmp_path / "out").exists()
    with pytest.raises(WorkerDied):
        worker.do(task, lambda *_: os.kill(worker.pid, signal.SIGKILL) or True)
    assert worker.pid is None


def test_what_a_search_knows_by_now_is_told(task, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    seen = []
    doing.do(
        replace(task, changes={"search.method": "optimal"}), lambda at: seen.append(at) or True
    )
    last = [at for at in seen if at.stage == "search"][-1]
    assert last.fraction == 1.0 and 0.99 * last.value < last.lower_bound <= last.value
    assert {(at.value, at.lower_bound) for at in seen if at.stage != "search"} == {(None, None)}


def test_a_folder_of_somebody_else_is_no_fault_of_the_job(task, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out" / "V_SHAPE").mkdir(parents=True)
    (tmp_path / "out" / "V_SHAPE" / "result.json").write_text('{"job": "OTHER"}')
    outcome = doing.do(task, on)
    assert outcome.message.startswith("out/V_SHAPE: belongs to job OTHER")
    assert (outcome.status, outcome.exit_status, outcome.final) == ("bad input", 2, False)
