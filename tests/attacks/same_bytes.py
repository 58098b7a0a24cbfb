"""Runs of a job under conditions that must not matter, compared byte for byte.

    python -m tests.attacks.same_bytes SECONDS [JOB.yaml | arch]...

Each job is run with two threads, with one, beside four busy loops, with another hash seed, as on a
processor of another maker, and stopped for so many seconds in the middle of its run. Ends with
status 1 if a byte of program, table, pictures, motion or result differs, the times of stages aside;
``arch`` is a part that does not come with opl.
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
from tests.support.small_programs import write_arch

TREE = Path(opl.__file__).parents[1]
START = "import sys; from opl.cli.commands import main; sys.exit(main(prog_name='opl'))"
BUSY = "while True: pass"
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")

CONDITIONS = (
    "two threads", "one thread", "four busy loops", "another hash seed", "another processor",
    "stopped",
)  # fmt: skip

# what compiles kernels, and the functions of the C library, take it for one without wide vectors
# and fused multiplication; of numpy and OpenBLAS that is for opl to see to
OLDER = {
    "NUMBA_CPU_NAME": "generic",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4",
}


def run(job: Path, out: Path, condition: str, stop: tuple[float, float]) -> dict[str, bytes]:
    """Run a job under a condition; return its files, the times of stages taken out.

    `stop` is when it is stopped, in [s] from its start, and for how long.
    """
    threads = "2" if condition == "two threads" else "1"
    seed = "12345" if condition == "another hash seed" else "0"
    env = {
        **os.environ, **dict.fromkeys(THREADS, threads), "PYTHONHASHSEED": seed,
        "PYTHONPATH": str(TREE), "SOURCE_DATE_EPOCH": "1700000000",
    }  # fmt: skip
    if condition == "another processor":
        env.update(OLDER)
    loops = 4 if condition == "four busy loops" else 0
    others = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(loops)]
    try:
        command = [sys.executable, "-c", START, "run", str(job), "--out", str(out), "-q"]
        process = subprocess.Popen(command, env=env, stderr=subprocess.PIPE, text=True)
        if condition == "stopped":
            time.sleep(stop[0])
            if process.poll() is not None:
                raise RuntimeError(f"{job}: ended before it was stopped")
            process.send_signal(signal.SIGSTOP)
            time.sleep(stop[1])
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


def differences(job: Path, home: Path, pause: float) -> list[str]:
    """Return which files differ under which conditions, one line each."""
    first: dict[str, bytes] = {}
    found, middle = [], 0.0
    for number, condition in enumerate(CONDITIONS):
        start = time.monotonic()
        files = run(job, home / str(number), condition, (middle, pause))
        # of the quickest so far, so that it is stopped before it ends
        middle = min(middle or 1e9, 0.4 * (time.monotonic() - start))
        first = first or files
        names = sorted(files.keys() | first.keys())
        found += [f"{condition}: {name}" for name in names if files.get(name) != first.get(name)]
    assert "result.json" in first
    return found


def main() -> None:
    pause, *jobs = sys.argv[1:]
    differing = 0
    for name in jobs:
        with tempfile.TemporaryDirectory() as scratch:
            home = Path(scratch)
            job = write_arch(home / "job") if name == "arch" else Path(name)
            told = differences(job, home, float(pause))
        differing += len(told)
        same = f"the same bytes in {len(CONDITIONS)} conditions"
        print(f"{name}: {'; '.join(told) or same}", flush=True)
    sys.exit(differing > 0)


if __name__ == "__main__":
    main()
