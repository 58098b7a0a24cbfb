"""Runs of a job under conditions that must not matter, compared byte for byte.

python -m tests.attacks.same_bytes SECONDS JOB.yaml...   stops each run for so long in its middle
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import opl

TREE = Path(opl.__file__).parents[1]
START = "import sys; from opl.cli.commands import main; sys.exit(main(prog_name='opl'))"
BUSY = "while True: pass"
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")

CONDITIONS = ("two threads", "one thread", "four busy loops", "stopped", "another hash seed")


def run(job: Path, out: Path, condition: str, stop: float) -> dict[str, bytes]:
    """Run a job under a condition; return its files, the times of stages taken out."""
    threads = "2" if condition == "two threads" else "1"
    seed = "12345" if condition == "another hash seed" else "0"
    env = {
        **os.environ, **dict.fromkeys(THREADS, threads), "PYTHONHASHSEED": seed,
        "PYTHONPATH": str(TREE), "SOURCE_DATE_EPOCH": "1700000000",
    }  # fmt: skip
    loops = 4 if condition == "four busy loops" else 0
    others = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(loops)]
    try:
        command = [sys.executable, "-c", START, "run", str(job), "--out", str(out), "-q"]
        process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True)
        if condition == "stopped":
            time.sleep(0.4 * stop)
            process.send_signal(signal.SIGSTOP)
            time.sleep(stop)
            process.send_signal(signal.SIGCONT)
        _, err = process.communicate()
    finally:
        for other in others:
            other.kill()
            other.wait()
    if process.returncode not in (0, 3, 4):
        raise RuntimeError(f"{job}: {condition}: status {process.returncode}: {err}")
    return {path.name: _timeless(path) for path in sorted(out.iterdir())}


def _timeless(path: Path) -> bytes:
    content = path.read_bytes()
    if path.name == "result.json":
        result = json.loads(content)
        del result["seconds"]
        content = json.dumps(result).encode()
    return content if path.suffix != ".html" else b""  # the page shows the times


def differences(job: Path, home: Path, stop: float) -> list[str]:
    """Return which files differ under which conditions, one line each."""
    first: dict[str, bytes] = {}
    found = []
    for number, condition in enumerate(CONDITIONS):
        files = run(job, home / str(number), condition, stop)
        first = first or files
        names = sorted(files.keys() | first.keys())
        found += [
            f"{job}: {condition}: {name}" for name in names if files.get(name) != first.get(name)
        ]
    return found


if __name__ == "__main__":
    pause, *jobs = sys.argv[1:]
    for name in jobs:
        with tempfile.TemporaryDirectory() as scratch:
            told = differences(Path(name), Path(scratch), float(pause))
        print(
            name, "; ".join(told) or f"the same bytes in {len(CONDITIONS)} conditions", flush=True
        )
