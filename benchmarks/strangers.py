"""Runs random jobs that nobody tuned anything to. By hand: python -m benchmarks.strangers --seed 7.

Each job is drawn, written as files into a folder of its own, and run as `opl run` does up to its
path, or to its program with --whole, in a process that is ended when it takes too long; as many
side by side as --workers says, which share the cores. A job that is refused before its search, or
has no path, counts with its cause and is drawn again, until as many as asked for were searched. The
same seed draws the same jobs, which --cases picks from: `--cases 3.0 17.2`; they are searched for
the least of --objective. Parts are of all --families but those between walls, unless it names some.
With --uncommon they have what few jobs have, see `benchmarks/uncommon.py`. With --write the table
goes into STRANGERS.md.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import shutil
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from threading import Lock
from typing import Any

import numpy as np

import opl
from benchmarks.stranger_jobs import Stranger, draw_job
from benchmarks.stranger_parts import FAMILIES, WALLED
from benchmarks.stranger_table import HEAD, SEARCHED, UNITS, Outcome, page, row
from opl.files.kernels import use_threads
from opl.geometry.frames import Array
from opl.run.preparing import prepare
from opl.run.searches import proves_range, search_path

LONGEST = 120.0  # [s] that a job may take as a whole
MOST_DRAWS = 12  # of one job until one can be searched
TABLE = Path(__file__).with_name("STRANGERS.md")
Facts = dict[str, Any]  # fields of an outcome
Draw = tuple[int, int]  # which job, and which draw of it


class Clock:
    """Time of the stages of a run: on the wall, and of the processor."""

    def __init__(self) -> None:
        self._seconds: dict[str, Array] = defaultdict(lambda: np.zeros(2))
        self._start: dict[str, Array] = {}

    def __call__(self, stage: opl.Stage, fraction: float) -> None:
        """Take note of the beginning or the end of a stage."""
        if fraction == 0.0:
            self._start[stage.value] = _now()
        elif fraction == 1.0 and stage.value in self._start:  # one may report its end itself
            self._seconds[stage.value] += _now() - self._start.pop(stage.value)

    def of(self, stage: str) -> Array:
        """Return both times of a stage in [s], until now if it was broken off, shape (2,)."""
        begun = self._start.get(stage)
        return self._seconds[stage] + (0.0 if begun is None else _now() - begun)


def _now() -> Array:
    return np.array([time.perf_counter(), time.process_time()])


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
        shut = error.message.startswith("no path:") or error.message.startswith("no path beyond")
        status = "no_path" if shut else "not found"
        bound = error.lower_bound if proves_range(job.search) else None
        return {**facts, "status": status, "cause": str(error), "bound": bound}
    facts.update(found=plan.path.joint_range_sum, bound=plan.lower_bound)
    if plan.objective is not None:
        value = plan.objective.value
        facts.update(found=value, bound=value * (1.0 - plan.objective.gap))
    return {**facts, "status": "ok", "cause": plan.open_because or ""}


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
        path, value = report.path, report.path.objective_value
        facts.update(found=path.joint_range_sum_rad, bound=path.lower_bound_rad)
        if value is not None:
            facts.update(found=value.value, bound=value.value * (1.0 - value.gap))
    return facts


def _serve(pipe: Connection, whole: bool, threads: int, begin: Callable[[], None] | None) -> None:
    """Run the jobs that come through a pipe, until None comes."""
    use_threads(threads)
    if begin is not None:
        begin()
    while (path := pipe.recv()) is not None:
        clock = Clock()
        facts: Facts
        try:
            job, watch = opl.load_job(path), opl.Watch(clock)
            facts = _program(job, path.parent / "out", watch) if whole else _path(job, watch)
        except opl.InputError as error:
            cause = str(error).replace(f"{path.parent}/", "")  # the same wherever it is run
            facts = {"status": "bad input", "cause": cause}
        except Exception as error:  # what breaks here is a case, not the end of the benchmark
            facts = {"status": "error", "cause": f"{type(error).__name__}: {error}"}
        both = clock.of("search") + clock.of("clearance")
        facts["search_s"], facts["processor_s"] = both.tolist()
        pipe.send(facts)


class Worker:
    """A process that runs one job after the other, and is replaced when one takes too long.

    Args:
        whole: Whether jobs are run to their end, not only to their path.
        threads: How many threads it may use.
        begin: Called in it before any job, if given.
    """

    def __init__(self, whole: bool, threads: int, begin: Callable[[], None] | None) -> None:
        self._given = whole, threads, begin
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(other, *self._given), daemon=True)
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
    seed: int,
    draws: Sequence[Sequence[Draw]],
    folder: Path,
    workers: int,
    whole: bool,
    done: Callable[[Outcome], None],
    begin: Callable[[], None] | None = None,
    objective: str = "range",
    families: Sequence[str] = tuple(FAMILIES),
    uncommon: bool = False,
) -> None:
    """Draw jobs and run them side by side.

    Args:
        seed: Of all jobs.
        draws: Of each job the draws of it, run until one can be searched.
        folder: Each draw gets a folder in here.
        workers: How many are run at once.
        whole: Whether jobs are run to their end, not only to their path.
        done: Called with each draw as it ends, never twice at once.
        begin: Called in each worker before any job, if given.
        objective: What the searches keep small.
        families: Of the parts.
        uncommon: Whether the jobs have what few jobs have.
    """
    idle: SimpleQueue[Worker] = SimpleQueue()
    for _ in range(workers):
        idle.put(Worker(whole, max((os.cpu_count() or 1) // workers, 1), begin))
    lock = Lock()

    def run(job: Sequence[Draw]) -> None:
        worker = idle.get()
        for index, attempt in job:
            own = folder / f"{seed}_{index}_{attempt}"
            shutil.rmtree(own, ignore_errors=True)
            own.mkdir(parents=True)
            drawn = draw_job(seed, index, attempt, own, objective, families, uncommon)
            outcome = _outcome(index, attempt, drawn, worker)
            if drawn is None:
                own.rmdir()
            with lock:
                done(outcome)
            if outcome.status in SEARCHED:
                break
        idle.put(worker)

    with ThreadPoolExecutor(workers) as threads:
        list(threads.map(run, draws))
    for _ in range(workers):
        idle.get().close()


def _outcome(index: int, attempt: int, drawn: Stranger | None, worker: Worker) -> Outcome:
    if drawn is None:
        return Outcome(index, attempt, "not reached", "", "", "", cause="placed nowhere in reach")
    facts = worker.run(drawn.job)
    return Outcome(index, attempt, family=drawn.family, robot=drawn.robot, axle=drawn.axle, **facts)


def main() -> None:
    """Run the jobs, print the table line by line, and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="index of the first job")
    parser.add_argument("--cases", nargs="+", help="draws to be run alone, such as 3.0")
    parser.add_argument("--workers", type=int, default=1, help="jobs run at once")
    parser.add_argument("--objective", choices=UNITS, default="range", help="kept small")
    parser.add_argument(
        "--families", nargs="+", choices=[*FAMILIES, *WALLED], default=list(FAMILIES),
        help="of parts that are drawn from",
    )  # fmt: skip
    parser.add_argument("--uncommon", action="store_true", help="what few jobs have")
    parser.add_argument("--folder", type=Path, default=Path("strangers"), help="of the jobs")
    parser.add_argument("--whole", action="store_true", help="replay, program and files as well")
    parser.add_argument("--write", action="store_true", help=f"the table into {TABLE.name}")
    arguments = parser.parse_args()
    folder, seed = arguments.folder, arguments.seed
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{seed}" if arguments.objective == "range" else f"{seed}_{arguments.objective}"
    log = folder / f"{name}.jsonl"

    def done(outcome: Outcome) -> None:
        print(row(outcome), flush=True)
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(asdict(outcome)) + "\n")

    print(HEAD)
    indices = range(arguments.first, arguments.first + arguments.count)
    draws: list[list[Draw]] = [[(k, attempt) for attempt in range(MOST_DRAWS)] for k in indices]
    if arguments.cases:
        pairs = [case.split(".") for case in arguments.cases]
        draws = [[(int(index), int(attempt))] for index, attempt in pairs]
    objective, families = arguments.objective, arguments.families
    given = seed, draws, folder, arguments.workers, arguments.whole, done
    drawn = {"families": families, "uncommon": arguments.uncommon}
    run_strangers(*given, objective=objective, **drawn)
    # what earlier runs of the same seed found counts too, the last of each draw
    lines = log.read_text(encoding="utf-8").splitlines()
    known = {(one.index, one.attempt): one for one in (Outcome(**json.loads(x)) for x in lines)}
    text = page(seed, [known[key] for key in sorted(known)], objective, **drawn)
    for path in [folder / f"{name}.md", *([TABLE] if arguments.write else [])]:
        path.write_text(text, encoding="utf-8")
    print(text.split("\n")[4])


if __name__ == "__main__":
    main()
