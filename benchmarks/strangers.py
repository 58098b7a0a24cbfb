"""Runs random jobs that nobody tuned anything to. By hand: python -m benchmarks.strangers --seed 7.

Each job is drawn, written as files into a folder of its own, and run as `opl run` does up to its
path, or to its program with --whole, in a process that is ended when it takes too long. A job that
is refused before its search, or has no path, counts with its cause and is drawn again, until as
many as asked for were searched. The same seed draws the same jobs.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import shutil
import subprocess
import time
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import opl
from benchmarks.stranger_jobs import Stranger, draw_job
from opl.cell.wheel_distance import use_threads
from opl.run.preparing import prepare
from opl.run.searches import search_path

CLOSED = 0.002  # gap that counts as closed
LONGEST = 120.0  # [s] that a job may take as a whole
MOST_DRAWS = 12  # of one job until one can be searched
LIBRARIES = ("numpy", "scipy", "numba", "pin", "pybullet")
Facts = dict[str, Any]  # fields of an outcome
SEARCHED = ("ok", "unsafe", "timed out", "error")  # what counts; the others are drawn again


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    Attributes:
        index: Which job.
        attempt: Which draw of it.
        status: ``ok``, ``unsafe``, ``no_path``, ``bad input``, ``not reached``, ``timed out`` or
            ``error``.
        family: Of its part.
        robot: Its arm.
        axle: How the axle of its wheel lies.
        points: Number of cutter points, 0 if they are not known.
        passes: Number of passes.
        sum_rad: Joint range sum found in [rad]; None if there is none.
        bound_rad: Its lower bound in [rad].
        search_s: Processor time of search and clearance in [s].
        total_s: Wall-clock time from the job file on in [s].
        cause: Why there is no program, or no gap.
    """

    index: int
    attempt: int
    status: str
    family: str
    robot: str
    axle: str
    points: int = 0
    passes: int = 0
    sum_rad: float | None = None
    bound_rad: float | None = None
    search_s: float = 0.0
    total_s: float = 0.0
    cause: str = ""

    @property
    def gap(self) -> float | None:
        """Fraction by which the sum may exceed the least there is; None if nothing is proven."""
        if self.sum_rad is None or self.bound_rad is None:
            return None
        return 1.0 - self.bound_rad / self.sum_rad

    @property
    def closed(self) -> bool:
        """Whether the gap is as small as it should be."""
        return self.gap is not None and self.gap <= CLOSED


class Processor:
    """Processor time of the stages of a run."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._start: dict[str, float] = {}

    def __call__(self, stage: opl.Stage, fraction: float) -> None:
        """Take note of the end of a stage."""
        now = time.process_time()
        if fraction == 0.0:
            self._start[stage.value] = now
        elif fraction == 1.0:
            self.seconds[stage.value] += now - self._start[stage.value]


def _path(job: opl.Job, watch: opl.Watch) -> Facts:
    """Search the path of a job; return the facts of an outcome."""
    surfaced = opl.cut_surface(job, watch)
    points = surfaced.points
    facts: Facts = {"points": len(points), "passes": points.n_passes}
    prepared = prepare(surfaced, watch)
    try:
        with watch.stage(opl.Stage.SEARCH):
            plan = search_path(job.search, prepared.problem).plan
    except opl.NoPathError as error:
        return {**facts, "status": "no_path", "cause": str(error)}
    facts.update(sum_rad=plan.path.joint_range_sum, bound_rad=plan.lower_bound)
    return {**facts, "status": "ok"}


def _program(job: opl.Job, out: Path, watch: opl.Watch) -> Facts:
    """Run a job to its end; return the facts of an outcome."""
    run = opl.run_job(job, watch)
    opl.deliver(run, out)
    report = opl.make_report(run)
    facts: Facts = {
        "status": run.status,
        "points": report.cutter_points,
        "passes": report.passes,
        "cause": "; ".join(report.reasons),
    }
    if report.path is not None:
        facts["sum_rad"] = report.path.joint_range_sum_rad
        facts["bound_rad"] = report.path.lower_bound_rad
    return facts


def _serve(pipe: Connection, whole: bool) -> None:
    """Run the jobs that come through a pipe, until None comes."""
    use_threads(1)
    while (path := pipe.recv()) is not None:
        processor = Processor()
        facts: Facts
        try:
            job, watch = opl.load_job(path), opl.Watch(processor)
            facts = _program(job, path.parent / "out", watch) if whole else _path(job, watch)
        except opl.InputError as error:
            facts = {"status": "bad input", "cause": str(error)}
        except Exception as error:  # what breaks here is a case, not the end of the benchmark
            facts = {"status": "error", "cause": f"{type(error).__name__}: {error}"}
        facts["search_s"] = processor.seconds["search"] + processor.seconds["clearance"]
        pipe.send(facts)


class Worker:
    """A process that runs one job after the other, and is replaced when one takes too long.

    Args:
        whole: Whether jobs are run to their end, not only to their path.
    """

    def __init__(self, whole: bool) -> None:
        self._whole = whole
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other, self._whole), daemon=True)
        self._process.start()
        other.close()

    def run(self, path: Path) -> Facts:
        """Return what became of a job file."""
        started = time.perf_counter()
        self._pipe.send(path)
        try:
            if self._pipe.poll(LONGEST):
                return {**self._pipe.recv(), "total_s": time.perf_counter() - started}
            status, cause = "timed out", f"not done after {LONGEST:g} s"
        except EOFError:
            status, cause = "error", "its process died"
        self._process.kill()
        self._process.join()
        self._start()
        return {"status": status, "cause": cause, "total_s": time.perf_counter() - started}

    def close(self) -> None:
        """End the process."""
        self._pipe.send(None)
        self._process.join()


def run_strangers(
    seed: int, indices: range, folder: Path, whole: bool, done: Callable[[Outcome], None]
) -> list[Outcome]:
    """Draw jobs and run them; return what became of every draw.

    Args:
        seed: Of all jobs.
        indices: Which jobs.
        folder: Each draw gets a folder in here.
        whole: Whether jobs are run to their end, not only to their path.
        done: Called with each draw as it ends.
    """
    outcomes, worker = [], Worker(whole)
    for index in indices:
        for attempt in range(MOST_DRAWS):
            own = folder / f"{seed}_{index}_{attempt}"
            shutil.rmtree(own, ignore_errors=True)
            own.mkdir(parents=True)
            drawn = draw_job(seed, index, attempt, own)
            outcome = _outcome(index, attempt, drawn, worker)
            if drawn is None:
                own.rmdir()
            outcomes.append(outcome)
            done(outcome)
            if outcome.status in SEARCHED:
                break
    worker.close()
    return outcomes


def _outcome(index: int, attempt: int, drawn: Stranger | None, worker: Worker) -> Outcome:
    if drawn is None:
        return Outcome(index, attempt, "not reached", "", "", "", cause="placed nowhere in reach")
    facts = worker.run(drawn.job)
    return Outcome(index, attempt, family=drawn.family, robot=drawn.robot, axle=drawn.axle, **facts)


def row(outcome: Outcome) -> str:
    """Return a line of the table."""
    gap = "-" if outcome.gap is None else f"{100.0 * outcome.gap:.3f} %"
    found = "-" if outcome.sum_rad is None else f"{outcome.sum_rad:.4f}"
    cause = outcome.cause.split("\n")[0].replace("|", "/")[:160]
    cells = (
        f"{outcome.index}.{outcome.attempt}",
        outcome.family,
        outcome.robot,
        outcome.axle,
        f"{outcome.points} in {outcome.passes}",
        outcome.status,
        "yes" if outcome.closed else "no",
        gap,
        found,
        f"{outcome.search_s:.1f}",
        f"{outcome.total_s:.1f}",
        cause,
    )
    return "| " + " | ".join(cells) + " |"


HEAD = (
    "| job | part | arm | axle | points, passes | status | closed | gap | sum, rad | search, s "
    "| total, s | cause |\n|" + "---|" * 12
)


def page(seed: int, outcomes: list[Outcome]) -> str:
    """Return the results as a page of Markdown."""
    searched = [one for one in outcomes if one.status in SEARCHED]
    closed = [one for one in searched if one.closed]
    quick = [one for one in closed if one.search_s <= 10.0]
    unproven = [one for one in searched if one.gap is None]
    again = Counter(one.status for one in outcomes if one.status not in SEARCHED)
    slowest = max((one.search_s for one in searched), default=0.0)
    revision = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        capture_output=True, text=True, cwd=Path(__file__).parent, check=False,
    ).stdout.strip()  # fmt: skip
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    drawn_again = ", ".join(f"{count} {status}" for status, count in sorted(again.items()))
    return "\n".join(
        [
            f"# Strangers, seed {seed}",
            "",
            f"{len(searched)} random jobs searched: {len(closed)} with a gap of at most "
            f"{100.0 * CLOSED:g} %, {len(quick)} of them within 10 s of processor; "
            f"{len(unproven)} without a bound; slowest {slowest:.1f} s. "
            f"Drawn again: {drawn_again or 'none'}.",
            "",
            f"opl {opl.__version__} at {revision}, Python {platform.python_version()}, {versions}; "
            f"{os.cpu_count()} processors. Search: processor time of search and clearance; total: "
            "wall clock from the job file on.",
            "",
            HEAD,
            *map(row, outcomes),
            "",
        ]
    )


def main() -> None:
    """Run the jobs, print the table line by line, and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="index of the first job")
    parser.add_argument("--folder", type=Path, default=Path("strangers"), help="of the jobs")
    parser.add_argument("--whole", action="store_true", help="replay, program and files as well")
    arguments = parser.parse_args()
    folder, seed = arguments.folder, arguments.seed
    folder.mkdir(parents=True, exist_ok=True)
    log = folder / f"{seed}.jsonl"

    def done(outcome: Outcome) -> None:
        print(row(outcome), flush=True)
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(outcome)) + "\n")

    print(HEAD)
    indices = range(arguments.first, arguments.first + arguments.count)
    run_strangers(seed, indices, folder, arguments.whole, done)
    # what earlier runs of the same seed found counts too, the last of each draw
    lines = log.read_text(encoding="utf-8").splitlines()
    known = {(one.index, one.attempt): one for one in (Outcome(**json.loads(x)) for x in lines)}
    text = page(seed, [known[key] for key in sorted(known)])
    (folder / f"{seed}.md").write_text(text, encoding="utf-8")
    print(text.split("\n")[2])


if __name__ == "__main__":
    main()
