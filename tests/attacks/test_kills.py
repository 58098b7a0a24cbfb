"""SIGKILL at any moment of a batch and of the service: old or new, never half, and nothing lost.

A few kills each; all that were asked for (50 each, 300 broken files, 2000 requests) with
``OPL_ATTACKS=full``, by hand, on a quiet machine.
"""

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml

from opl.client import Client, ServiceError
from opl.files.writing import HIDDEN
from opl.store.made import changed_files
from opl.work.state import open_store
from tests.attacks.test_hostile_input import spoiled_value
from tests.support.jobs import V_SHAPE, document, opl, write_job
from tests.support.serving import CHILD, START, serving, started

FULL = os.environ.get("OPL_ATTACKS") == "full"
KILLS = 50 if FULL else 5
BROKEN = 300 if FULL else 24
REQUESTS = 2000 if FULL else 80
JOBS = 6
SEED = 16
# planned, proven and written in a second
TINY = {"passes.max_step_mm": 60, "search.contact_positions": 9, "search.max_contact_step": 10}


def children(pid, deep=True):
    """Return the processes that a process began, and, deep, those that they began."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            one = int(stat.parent.name)
            if int(stat.read_text().rsplit(")", 1)[1].split()[1]) == pid:
                found += [one, *(children(one) if deep else ())]
        except (OSError, IndexError):
            continue
    return found


def killed(rng, process):
    """Kill a process or one of its workers; return whether it was the process itself."""
    workers = children(process.pid)
    victim = process.pid if rng.random() < 0.7 or not workers else rng.choice(workers)
    try:
        os.kill(victim, signal.SIGKILL)
    except ProcessLookupError:
        return False
    return victim == process.pid


def halves(out):
    """Return what is half: files that no result.json describes, results without their files."""
    wrong = []
    for result in out.glob("*/result.json"):
        try:
            program = json.loads(result.read_bytes())["program"]
        except ValueError:
            wrong.append(f"{result}: torn")
            continue
        names = [] if program is None else program["files"]
        wrong += [
            f"{result}: without {name}" for name in names if not (result.parent / name).exists()
        ]
    return wrong


def jobs_of_a_batch(home, feed):
    for number in range(JOBS):
        changes = {**TINY, "name": f"J{number}", "process.feed_mm_s": feed + number}
        write_job(home / str(number), changes)


def test_a_batch_that_is_killed_again_and_again(tmp_path):
    """Each round some jobs have changed, so there is always work that a kill can meet."""
    rng, kills, rounds = random.Random(SEED), 0, 0
    command = [sys.executable, "-c", START, "batch", "jobs", "--out", "out", "--workers", "2", "-q"]
    while kills < KILLS:
        rounds += 1
        jobs_of_a_batch(tmp_path / "jobs", 20 + rounds)
        for _ in range(10):
            process = subprocess.Popen(
                command, cwd=tmp_path, env=CHILD, stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )  # fmt: skip
            try:
                process.wait(rng.uniform(0.5, 12.0))
                break
            except subprocess.TimeoutExpired:
                kills += 1
                if killed(rng, process):
                    process.wait(10)
                    assert halves(tmp_path / "out") == []
                else:  # a worker: the batch goes on and does its job again
                    process.kill() if rng.random() < 0.5 else None
                    try:
                        process.wait(60)
                    except subprocess.TimeoutExpired:
                        process.kill()
                        process.wait(10)
            if kills >= KILLS:
                break
    ended = subprocess.run(
        [*command, "--json"], cwd=tmp_path, env=CHILD, capture_output=True, text=True, timeout=280
    )
    rows = json.loads(ended.stdout)
    assert [row["status"] for row in rows] == ["ok"] * JOBS, ended.stdout[-2000:]
    audit = opl("batch", "--audit", "--out", tmp_path / "out", "--json")
    assert json.loads(audit.out)["wrong"] == []
    assert [p for p in (tmp_path / "out").rglob("*") if p.name.startswith(HIDDEN)] == []
    print(f"{kills} kills in {rounds} rounds of {JOBS} jobs")


def files_of(number):
    changes = {**TINY, "name": f"S{number}", "process.feed_mm_s": 20 + 0.01 * number}
    return {
        "job.yaml": json.dumps(document(changes)),
        "surface.json": (V_SHAPE / "surface.json").read_bytes(),
        "v_shape.stl": (V_SHAPE / "v_shape.stl").read_bytes(),
    }


def test_a_service_that_is_killed_again_and_again(tmp_path):
    """Every job that was accepted is done in the end, with files that are what was written."""
    rng, kills, accepted, number = random.Random(SEED + 1), 0, [], 0
    store = tmp_path / "store"
    while kills < KILLS:
        process, address = started(store, "--workers", "2")
        client = Client(address)
        try:
            until = time.monotonic() + rng.uniform(0.3, 14.0)
            while time.monotonic() < until and process.poll() is None:
                if number < 3 * kills + 4:
                    accepted.append(client.submit("run", files_of(number)).id)
                    number += 1
                time.sleep(0.2)
        except ServiceError as error:
            assert error.status == 0  # it was killed meanwhile, and has accepted nothing
        kills += 1
        if not killed(rng, process):
            time.sleep(rng.uniform(0.0, 3.0))
            process.kill()
        process.wait(10)
        process.stdout.close()
    with serving(store, "--workers", "2") as client:
        deadline = time.monotonic() + 10.0 * len(accepted)
        while client.counts()["queued"] + client.counts()["running"]:
            assert time.monotonic() < deadline
            time.sleep(0.5)
        states = {id_: client.job(id_).status for id_ in accepted}
    assert set(states.values()) == {"ok"}, states
    kept = open_store(store)
    assert kept.check() == []
    for job in kept.jobs():
        folder = Path(job.task.home) / job.outcome.folder
        assert changed_files(folder, job.outcome.files, every_byte=True) == []
    assert {path.name for path in (store / "jobs").iterdir()} == {job.id for job in kept.jobs()}
    assert [path for path in store.rglob("*") if path.name.startswith((HIDDEN, ".new-"))] == []
    print(f"{kills} kills, {len(accepted)} jobs accepted")


def broken_jobs(rng):
    """Yield broken jobs: values spoiled, or bytes of the text."""
    whole = document(TINY)
    while True:
        if rng.random() < 0.7:
            content = spoiled_value(rng, whole)
            try:
                text = yaml.safe_dump(content, sort_keys=False)
            except (yaml.YAMLError, ValueError):
                continue
        else:
            text = yaml.safe_dump(whole, sort_keys=False)
            at = rng.randrange(len(text))
            piece = rng.choice(
                ["{", "- ", ": ", "\t", "&a *a ", "!!python/name:os.system ", "\x00"]
            )
            text = text[:at] + piece + text[at + rng.randrange(20) :]
        yield text


@pytest.fixture(scope="module")
def broken(tmp_path_factory):
    """Write broken jobs that `opl check` refuses; return their folder."""
    home, rng = tmp_path_factory.mktemp("broken"), random.Random(SEED)
    count = 0
    for text in broken_jobs(rng):
        place = write_job(home / f"{count:03d}", TINY)
        text = text.replace("name: V_SHAPE", f"name: B{count:03d}")
        place.write_text(text, encoding="utf-8", errors="replace")
        ended = opl("check", place)
        if ended.status == 2:
            count += 1
        if count == BROKEN:
            return home
    return None


def test_broken_jobs_through_a_batch(broken, tmp_path):
    jobs = sorted(broken.glob("*/job.yaml"))
    ended = opl("batch", *jobs, "--out", tmp_path / "out", "--workers", "2", "--json")
    rows = json.loads(ended.out)
    assert {row["job"] for row in rows} == set(map(str, jobs)) and ended.status == 2
    faults = [
        row["message"]
        for row in rows
        if row["status"] != "bad input"
        or "Traceback" in row["message"]
        or not row["message"].startswith(row["job"])
    ]
    assert faults == []
    assert [path.name for path in (tmp_path / "out").iterdir() if path.is_dir()] == []
    assert "Traceback" not in ended.err


def test_broken_jobs_through_the_service(broken, tmp_path):
    """The same reasons; `check` and `run` alike, nothing written."""
    jobs = sorted(broken.glob("*/job.yaml"))
    with serving(tmp_path / "store", "--workers", "1") as client:
        for path in jobs:
            files = {one.name: one.read_bytes() for one in path.parent.iterdir()}
            found = client.submit("run", files, wait_s=60)
            assert (found.status, found.exit_status, found.files) == ("bad input", 2, ()), path
            assert "Traceback" not in found.message and str(tmp_path) not in found.message
    assert list((tmp_path / "store").rglob("out")) == []


def resident(pid):
    """Return the memory of a process in bytes."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def memory(pid):
    """Return the memory of a service and its workers in bytes."""
    return [resident(one) for one in (pid, *children(pid, deep=False))]


def test_mixed_requests(tmp_path):
    """Good, bad, oversized, cancelled, hostile: none lost, nothing from outside, memory flat."""
    rng = random.Random(SEED)
    secret = tmp_path / "secret.txt"
    secret.write_text("root:secret")
    bomb = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"{chr(98 + k)}: &{chr(98 + k)} [{','.join(9 * ['*' + chr(97 + k)])}]\n" for k in range(8)
    )
    evil = [
        lambda f: {**f, "job.yaml": bomb},
        lambda f: {**f, "../escape": "x"},
        lambda f: {**f, "/etc/escape": "x"},
        lambda f: {**f, "job.yaml": f["job.yaml"].replace("v_shape.stl", "../../../../secret.txt")},
        lambda f: {**f, "job.yaml": f["job.yaml"].replace("v_shape.stl", str(secret))},
        lambda f: {**f, "big": bytes(2_500_000)},
        lambda f: {**f, "job.yaml": f["job.yaml"][:-200]},
        lambda f: {**f, "job.yaml": "[" * 5000},
        lambda f: {**f, "job.yaml": f["job.yaml"].replace('"mh24"', '"../../../mh24"')},
    ]
    sizes, lost, accepted, lock = [], [], [], threading.Lock()

    def ask(number):
        kind, files = rng.random(), files_of(10_000 + number % 40)
        try:
            if kind < 0.35:
                job = client.submit("check", {**files, "n": str(number)})
            elif kind < 0.45:
                job = client.submit("run", files)
            elif kind < 0.6:
                job = client.submit("points", {**files, "n": str(number)})
                client.cancel(job.id)
            else:
                job = client.submit("check", rng.choice(evil)({**files, "n": str(number)}))
            with lock:
                accepted.append(job.id)
        except ServiceError as error:
            if error.status not in (400, 413, 0):
                lost.append(str(error))

    with serving(tmp_path / "store", "--workers", "2", "--max-upload", "2") as client:
        for quarter in range(4):
            with ThreadPoolExecutor(4) as pool:
                numbers = range(quarter * REQUESTS // 4, (quarter + 1) * REQUESTS // 4)
                list(pool.map(ask, numbers))
            deadline = time.monotonic() + 300.0 + 2.0 * REQUESTS
            while client.counts()["queued"] + client.counts()["running"]:
                assert time.monotonic() < deadline
                time.sleep(0.5)
            sizes.append(memory(client.pid))
        ended = {id_: client.job(id_) for id_ in set(accepted)}
    assert lost == [] and all(job.ended for job in ended.values())
    for job in ended.values():
        assert "root:secret" not in json.dumps(job.result) + (job.message or "")
        assert job.status != "error", job.message
    by_process = list(zip(*sizes, strict=True))
    series = [", ".join(f"{size / 1e6:.0f}" for size in own) for own in by_process]
    print(f"{REQUESTS} requests, {len(ended)} jobs; MB at rest after each quarter: {series}")
    for _, half, _, last in by_process:
        assert last < half + 60e6 and last < 700e6
