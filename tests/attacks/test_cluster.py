"""Jobs on a real scheduler with two worker processes: the same bytes, lost workers, versions."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

import opl
from opl.store.values import Outcome, Task
from opl.work import cluster
from opl.work.worker import BEAT, Limits, WorkerDied
from tests.support.jobs import opl as command
from tests.support.jobs import write_job

distributed = pytest.importorskip("distributed", reason="needs the extra opl[cluster]")
EPOCH = {"SOURCE_DATE_EPOCH": "1700000000"}
CHILD = {**os.environ, **EPOCH, "PYTHONPATH": str(Path(opl.__file__).parents[1])}
SMALL = {"passes.max_step_mm": 40, "search.contact_positions": 15}


def started(scheduler, home):
    """Return the address of a scheduler that is starting, whose port is one that was free."""
    deadline = time.monotonic() + 60.0
    while scheduler.poll() is None and time.monotonic() < deadline:
        with suppress(FileNotFoundError, json.JSONDecodeError):  # not there, or half written
            return json.loads((home / "scheduler.json").read_text())["address"]
        time.sleep(0.1)
    raise AssertionError(f"no scheduler in 60 s:\n{(home / 'scheduler.err').read_text()}")


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    """Start a scheduler and two workers that stand in folders of their own; yield its address."""
    home = tmp_path_factory.mktemp("cluster")
    scheduler = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1",
                 "--port", "0", "--scheduler-file", "scheduler.json", "--no-dashboard"]  # fmt: skip
    with (home / "scheduler.err").open("w") as errors:
        processes = [subprocess.Popen(scheduler, cwd=home, env=CHILD, stderr=errors)]
    try:
        address = started(processes[0], home)
        for number in range(2):
            place = home / str(number)
            place.mkdir()
            worker = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--nthreads",
                      "1", "--no-dashboard", "--local-directory", str(place)]  # fmt: skip
            processes.append(
                subprocess.Popen(worker, cwd=place, env=CHILD, stderr=subprocess.DEVNULL)
            )
        client = distributed.Client(address, timeout="60s", set_as_default=False)
        client.wait_for_workers(2, timeout=60)
        yield address, client
        client.close()
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(30)


def made(folder):
    """Return what jobs made in a folder, without what is measured."""
    found = {}
    for path in sorted(folder.glob("*/*")):
        if path.name == "report.html":
            continue
        content = path.read_bytes()
        if path.name == "result.json":
            result = json.loads(content)
            del result["seconds"]
            content = json.dumps(result).encode()
        found[path.relative_to(folder).as_posix()] = content
    return found


def test_the_same_bytes_come_back_though_a_worker_is_killed(machines, tmp_path, monkeypatch):
    address, client = machines
    monkeypatch.setenv(*next(iter(EPOCH.items())))
    monkeypatch.chdir(tmp_path)
    for number in range(6):
        changes = {**SMALL, "name": f"J{number}", "process.feed_mm_s": 20 + number}
        write_job(tmp_path / "jobs" / str(number), changes)
    write_job(tmp_path / "jobs" / "bad", {**SMALL, "name": "BAD", "wheel.width_mm": -3})
    batch = subprocess.Popen(
        [sys.executable, "-c", "import sys; from opl.cli.commands import main; sys.exit(main())",
         "batch", "jobs", "--scheduler", address, "--out", "there", "--json"],
        cwd=tmp_path, env=CHILD, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120.0
    while not list((tmp_path / "there").glob("*/result.json")):
        assert time.monotonic() < deadline and batch.poll() is None
        time.sleep(0.1)
    victim = next(iter(client.run(os.getpid).values()))
    os.kill(victim, signal.SIGKILL)
    out, _ = batch.communicate(timeout=300)
    rows = {Path(row["job"]).parent.name: row for row in json.loads(out)}
    assert [rows[str(number)]["message"] for number in range(6)] == [""] * 6
    assert [rows[str(number)]["status"] for number in range(6)] == ["ok"] * 6
    assert (
        rows["bad"]["message"] == "jobs/bad/job.yaml: wheel.width_mm: must be more than 0, got -3"
    )
    assert batch.returncode == 2
    assert command("batch", "--audit", "--out", "there").status == 0
    assert command("batch", "jobs/0", "jobs/3", "--out", "here", "-q").status == 0
    here, there = made(tmp_path / "here"), made(tmp_path / "there")
    assert len(here) == 12
    assert {name: there[name] for name in here} == here
    again = json.loads(command("batch", "jobs", "--out", "there", "--json").out)
    assert all(row["unchanged"] for row in again)  # where they were done makes no difference


def test_other_versions_are_refused_with_the_reason(machines, tmp_path, monkeypatch):
    _, client = machines
    monkeypatch.chdir(write_job(tmp_path, SMALL).parent)
    versions = {**cluster.made_with(), "numpy": "1.0", "code": "other"}
    monkeypatch.setattr(cluster, "made_with", lambda: versions)
    doer = cluster.ClusterDoer(client, Limits())
    outcome = doer.do(Task("run", "job.yaml", "out"), lambda *_: True)
    assert isinstance(outcome, Outcome) and (outcome.status, outcome.final) == ("error", False)
    assert outcome.message.startswith("job.yaml: a worker of the cluster has other versions")
    assert (
        f"numpy {versions and __import__('numpy').__version__} there, 1.0 here" in outcome.message
    )
    assert not (tmp_path / "out").exists()


def test_outcomes_come_back_however_long_they_take_to_fetch(machines, tmp_path, monkeypatch):
    _, client = machines
    monkeypatch.chdir(write_job(tmp_path, SMALL).parent)
    monkeypatch.setattr(cluster, "made_with", lambda: {"code": "other"})  # an outcome at once
    fetch = client._gather_remote

    async def slowly(*arguments):
        await asyncio.sleep(4.0 * BEAT)
        return await fetch(*arguments)

    monkeypatch.setattr(client, "_gather_remote", slowly)
    doer = cluster.ClusterDoer(client, Limits())
    for _ in range(3):
        outcome = doer.do(Task("run", "job.yaml", "out"), lambda *_: True)
        assert "a worker of the cluster has other versions" in outcome.message


def cut_off(dask_scheduler):
    """Break the connections of all clients, as a fault of the network would."""
    for comm in list(dask_scheduler.client_comms.values()):
        comm.comm.abort()


def test_a_task_of_a_connection_that_breaks_goes_back(machines, tmp_path, monkeypatch):
    _, client = machines
    monkeypatch.chdir(write_job(tmp_path, SMALL).parent)
    doer = cluster.ClusterDoer(client, Limits())

    def beat(_):
        with suppress(OSError):  # the answer would come by the connection that is cut
            client.run_on_scheduler(cut_off)
        return True

    with pytest.raises(WorkerDied):
        doer.do(Task("run", "job.yaml", "out"), beat)
    outcome = doer.do(Task("run", "job.yaml", "out"), lambda *_: True)  # the next one
    assert (outcome.status, outcome.message) == ("ok", "")


def test_a_task_for_a_scheduler_that_was_lost_is_refused(machines, tmp_path, monkeypatch):
    address, _ = machines
    monkeypatch.chdir(write_job(tmp_path, SMALL).parent)
    client = distributed.Client(address, timeout="20s", set_as_default=False)
    client.close()  # as it closes itself, when it finds no scheduler any more
    outcome = cluster.ClusterDoer(client, Limits()).do(Task("run", "job.yaml", "out"), lambda *_: 1)
    assert (outcome.status, outcome.final) == ("error", False)
    assert outcome.message == "job.yaml: the scheduler of the cluster does not answer any more"


def test_what_cannot_travel_is_refused(machines, tmp_path, monkeypatch):
    _, client = machines
    mesh = write_job(tmp_path / "a", SMALL).parent / "v_shape.stl"
    job = write_job(tmp_path / "b", {**SMALL, "workpiece.mesh": str(mesh)})
    monkeypatch.chdir(job.parent)
    doer = cluster.ClusterDoer(client, Limits())
    outcome = doer.do(Task("run", "job.yaml", "out"), lambda *_: True)
    assert outcome.message == f"job.yaml: names {mesh}, which other machines do not have"


def test_a_scheduler_that_does_not_answer_is_refused(monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", "1s")
    with pytest.raises(opl.InputError, match=r"--scheduler tcp://127.0.0.1:9: does not answer"):
        cluster.Cluster("tcp://127.0.0.1:9")
