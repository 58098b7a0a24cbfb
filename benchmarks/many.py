"""Measures a night of small jobs: python -m benchmarks.many [--jobs 200].

One batch with one worker, one with two, and the second once more when nothing has changed; beside
the times, the most memory that a worker had. Needs Linux (/proc) and two free cores.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.jobs import WORKPIECES, v_document

LOOK = 0.2  # [s] between two looks at the memory of the workers
GAIN, MOST_MB, MOST_SKIP = 1.8, 700.0, 3.0  # what is asked for: times, MB a worker, s
# of which each is planned, proven and written in about a second
SMALL = {
    "passes": {"rows": 1, "max_chord_error_mm": 0.3, "max_step_mm": 60},
    "search": {"contact_positions": 9, "max_contact_step": 10, "max_contact_error_mm": 0.5},
    "wheel": {"max_belt_penetration_mm": 1.0},
}


@dataclass(frozen=True)
class Batch:
    """How a batch ended.

    Attributes:
        wall: Seconds from its start to its end.
        worker_mb: Most memory of a worker (resident), 0 if there was none.
        rows: What it told of each job.
    """

    wall: float
    worker_mb: float
    rows: list[dict[str, object]]

    def count(self, key: str, value: object) -> int:
        """Return how many jobs have a value."""
        return sum(row[key] == value for row in self.rows)


def main() -> int:
    """Measure; return 1 where less is reached than was asked for."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.many", description=__doc__)
    parser.add_argument("--jobs", type=int, default=200)
    count = parser.parse_args().jobs
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        for number in range(count):
            _write(home / "jobs" / f"{number:04d}", number)
        one = _batch(home, "one", 1)
        two = _batch(home, "two", 2)
        again = _batch(home, "two", 2)
    ended = [batch.count("status", "ok") for batch in (one, two)]
    gain, memory = one.wall / two.wall, max(one.worker_mb, two.worker_mb)
    skipped = again.count("unchanged", True)
    print(f"{count} jobs, programs made: {ended[0]} with one worker, {ended[1]} with two")
    print(f"one worker {one.wall:.1f} s, two {two.wall:.1f} s: {gain:.2f} times, {GAIN} asked for")
    print(f"most memory of a worker {memory:.0f} MB, {MOST_MB:.0f} allowed")
    print(f"once more: {skipped} skipped in {again.wall:.2f} s, {MOST_SKIP:.0f} s allowed")
    reached = gain >= GAIN and memory < MOST_MB and again.wall <= MOST_SKIP
    return 0 if reached and ended == [count, count] and skipped == count else 1


def _write(place: Path, number: int) -> None:
    """Write a job that has its own name and feed."""
    process = v_document()["process"]
    process = {**process, "approach_mm": 20, "feed_mm_s": 20 + number / 100}
    document = v_document(**SMALL, process=process)
    shutil.copytree(WORKPIECES / "v_shape", place)
    text = json.dumps({**document, "name": f"N{number:04d}"})
    (place / "job.yaml").write_text(text, encoding="utf-8")


def _batch(home: Path, out: str, workers: int) -> Batch:
    command = [sys.executable, "-c", "from opl.cli.commands import main; main()"]
    command += ["batch", "jobs", "--out", out, "--workers", str(workers), "--json"]
    log, memory, start = home / f"{out}.json", 0.0, time.perf_counter()
    with log.open("w") as told:
        process = subprocess.Popen(command, cwd=home, stdout=told, stderr=subprocess.DEVNULL)
        while process.poll() is None:
            memory = max([memory, *(_most_mb(pid) for pid in _children(process.pid))])
            time.sleep(LOOK)
    return Batch(time.perf_counter() - start, memory, json.loads(log.read_text()))


def _children(pid: int) -> list[int]:
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rsplit(")", 1)[1].split()[1])
        except OSError:  # it has ended meanwhile
            continue
        if parent == pid:
            found.append(int(stat.parent.name))
    return found


def _most_mb(pid: int) -> float:
    """Return the most memory that a process has had in MB, 0 if it is gone."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) / 1e3 * 1.024 for line in lines if line.startswith("VmHWM"))


if __name__ == "__main__":
    sys.exit(main())
