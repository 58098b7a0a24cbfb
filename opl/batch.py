"""Many jobs in worker processes: one that fails leaves the others alone."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from opl.cell.wheel_distance import use_threads
from opl.deliver import deliver
from opl.errors import InputError, NoPathError, OplError, UnsafeError
from opl.files import documents
from opl.job.load import load
from opl.pipeline import run
from opl.result import reasons, result

JOB_KEYS = {"workpiece", "wheel", "passes"}  # a YAML file that speaks of one of these is a job
BUG = 1  # exit status of a job that ended with an error that is not opl's own


@dataclass(frozen=True)
class Row:
    """What became of one job of a batch.

    Attributes:
        job: The job file.
        status: ``ok``, ``no_path``, ``unsafe``, ``bad input`` or ``error``.
        exit_status: What ``opl run`` would have ended with.
        message: Why there is no program; empty if there is one.
        folder: Where the files lie, None if there are none.
        result: As in ``result.json``, None if the job was not run to its end.
    """

    job: Path
    status: str
    exit_status: int
    message: str
    folder: Path | None
    result: dict[str, Any] | None


def find_jobs(paths: Sequence[Path]) -> list[Path]:
    """Return the job files named, and for a folder every job file in and below it, sorted.

    In a folder every YAML file counts that has a key of `JOB_KEYS`, or cannot be read at all;
    hidden files and folders do not. A file that is named twice counts once.

    Raises:
        InputError: If a path does not exist or a folder holds no job.
    """
    jobs: list[Path] = []
    for path in paths:
        if path.is_dir():
            found = [file for file in sorted(path.rglob("*.y*ml")) if _is_job(file, path)]
            if not found:
                raise InputError(str(path), "holds no job file (*.yaml)")
            jobs += found
        elif path.exists():
            jobs.append(path)
        else:
            raise InputError(str(path), "no such file or folder")
    unique: dict[Path, Path] = {}
    for job in jobs:
        unique.setdefault(job.resolve(), job)
    return list(unique.values())


def _is_job(path: Path, folder: Path) -> bool:
    hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
    if hidden or path.suffix not in (".yaml", ".yml") or not path.is_file():
        return False
    try:
        return not JOB_KEYS.isdisjoint(documents.keys(path))
    except InputError:
        return True  # it will be told what is wrong with it


def run_batch(
    jobs: Sequence[Path],
    out: Path,
    workers: int,
    done: Callable[[Row], None] = lambda row: None,
) -> list[Row]:
    """Run jobs in worker processes.

    Args:
        jobs: The job files.
        out: Each job's files go to the folder of its name in here.
        workers: Number of processes.
        done: Told each job as it ends.

    Returns:
        One row per job, in the order of ``jobs``.
    """
    rows = _clashes(jobs)
    for row in rows.values():
        done(row)
    for row in _rows([job for job in jobs if job not in rows], out, workers):
        rows[row.job] = row
        done(row)
    return [rows[job] for job in jobs]


def _rows(jobs: Sequence[Path], out: Path, workers: int) -> Iterator[Row]:
    """Yield the row of each job as it ends."""
    bereft = []
    with _pool(workers) as pool:
        waiting = {pool.submit(_run_one, job, out): job for job in jobs}
        for future in as_completed(waiting):
            try:
                yield future.result()
            except BrokenProcessPool:
                bereft.append(waiting[future])
    # a worker that dies takes the pool with it; whose fault it was shows when each has its own
    for job in bereft:
        with _pool(1) as pool:
            try:
                yield pool.submit(_run_one, job, out).result()
            except BrokenProcessPool:
                yield Row(job, "error", BUG, f"{job}: its worker process died", None, None)


def _pool(workers: int) -> ProcessPoolExecutor:
    # spawned, not forked: the children of a process with threads would inherit their locks
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_one_thread)


def _clashes(jobs: Sequence[Path]) -> dict[Path, Row]:
    """Refuse jobs of one name: each would overwrite the files of the other."""
    by_name: dict[str, list[Path]] = {}
    for job in jobs:
        try:
            by_name.setdefault(str(documents.keys(job)["name"]), []).append(job)
        except (InputError, KeyError):
            continue  # told when it is run
    rows = {}
    for name, sharers in by_name.items():
        for job in sharers if len(sharers) > 1 else ():
            others = ", ".join(str(other) for other in sharers if other is not job)
            message = f"{job}: name: must be another for each job, {name} is also that of {others}"
            rows[job] = Row(job, "bad input", InputError.exit_status, message, None, None)
    return rows


def _one_thread() -> None:
    use_threads(1)  # the processes share the cores


def _run_one(path: Path, out: Path) -> Row:
    try:
        job = load(path)
        outcome = run(job)
        folder = out / job.name
        deliver(outcome, folder)
    except OplError as error:
        status = "bad input" if isinstance(error, InputError) else "error"
        return Row(path, status, error.exit_status, str(error), None, None)
    except Exception as error:  # a bug in one job must not take the night's other jobs with it
        message = f"{type(error).__name__}: {error} (a bug: run it alone to see where)"
        return Row(path, "error", BUG, message, None, None)
    exit_status = {
        "ok": 0,
        "no_path": NoPathError.exit_status,
        "unsafe": UnsafeError.exit_status,
    }[outcome.status]
    message = "\n".join(reasons(outcome))
    return Row(path, outcome.status, exit_status, message, folder, result(outcome))
