"""Ctrl-C and SIGTERM at any moment: an end within two seconds, nothing left running."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import opl
from opl.files.writing import HIDDEN
from tests.support.jobs import write_job

CHILD = {**os.environ, "PYTHONPATH": str(Path(opl.__file__).parents[1])}
START = "import sys; from opl.cli.commands import main; sys.exit(main(prog_name='opl'))"
WITHIN = 2.0  # [s]
EXITING = 0x4  # PF_EXITING of the kernel: it runs nothing any more, only its entry is left


def started(*arguments, cwd):
    return subprocess.Popen(
        [sys.executable, "-c", START, *map(str, arguments)],
        cwd=cwd, env=CHILD, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip


def left_of(session):
    """Return the processes of a session that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        # a process closes its files, and so ends its output, before it is a zombie
        if int(fields[3]) == session and fields[0] != "Z" and not int(fields[6]) & EXITING:
            found.append(stat.parent.name)
    return found


def ended(process, number, to_group):
    """Stop a command; return its status, its output, and how long it took."""
    (os.killpg if to_group else os.kill)(process.pid, number)
    start = time.monotonic()
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err, time.monotonic() - start


def leftovers(place):
    return [path for path in place.rglob("*") if path.name.startswith(HIDDEN)]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("after", [0.6, 1.5, 3.0, 5.0, 8.0])
def test_a_run_stops_at_any_moment(tmp_path, number, after):
    job = write_job(tmp_path, quick=False)
    process = started("run", job, "--out", "out", cwd=tmp_path)
    time.sleep(after)
    status, out, err, took = ended(process, number, to_group=False)
    assert (status, out, err) == (1, "", "error: stopped\n") or process.returncode in (0, 1)
    assert "Traceback" not in err
    assert took < 3.0 * WITHIN  # on a machine with other work
    assert left_of(process.pid) == []
    assert leftovers(tmp_path) == []
    assert not (tmp_path / "out").exists() or status == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("to_group", [True, False])
def test_a_batch_stops_and_tells_what_was_done(tmp_path, number, to_group):
    write_job(tmp_path / "jobs" / "0", {"name": "A", "passes.rows": 0})  # refused at once
    for name in ("B", "C", "D"):
        write_job(tmp_path / "jobs" / name, {"name": name}, quick=False)
    process = started("batch", "jobs", "--out", "out", "--workers", "2", cwd=tmp_path)
    while "bad input" not in process.stderr.readline():
        pass
    time.sleep(2.0)  # the others are at work
    status, out, err, took = ended(process, number, to_group)
    assert status == 1
    assert "0/job.yaml" in out and "bad input" in out  # the table
    assert err.endswith("error: stopped; 3 jobs have not ended\n")
    assert "Traceback" not in err + out
    assert took < 3.0 * WITHIN
    assert left_of(process.pid) == []
    assert leftovers(tmp_path / "out") == []


def test_workers_end_with_a_batch_that_is_killed(tmp_path):
    for name in ("B", "C"):
        write_job(tmp_path / "jobs" / name, {"name": name}, quick=False)
    process = started("batch", "jobs", "--out", "out", "--workers", "2", cwd=tmp_path)
    time.sleep(6.0)
    process.kill()
    process.wait()
    deadline = time.monotonic() + 10.0
    while left_of(process.pid) and time.monotonic() < deadline:
        time.sleep(0.2)
    assert left_of(process.pid) == []
