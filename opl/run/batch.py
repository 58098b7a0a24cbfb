"""Many jobs in worker processes: one that fails leaves the others alone."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from types import FrameType
from typing import NoReturn

from opl.cell.wheel_distance import use_threads
from opl.errors import InputError, OplError
from opl.files import documents
from opl.files.apart import end_with_parent
from opl.files.claiming import clear_after_others, release_folders
from opl.job import keys
from opl.job.load import load_job
from opl.run.delivery import claim_folder, deliver
from opl.run.reporting import make_report
from opl.run.result import Report
from opl.run.stages import run_job
from opl.run.values import Refused

GRACE = 0.7  # [s] for workers to leave their folders in order
BUG = 1  # exit status of a job that ended with an error that is not opl's own


@dataclass(frozen=True)
class BatchRow:
    """What became of one job of a batch.

    Attributes:
        job: The job file.
        status: ``ok``, ``no_path``, ``unsafe``, ``bad input`` or ``error``.
        exit_status: What ``opl run`` would have ended with.
        folder: Where the files lie, None if there are none.
        message: Why there is no program; empty if there is one.
        result: The content of ``result.json``, None if the job was not run to its end.
    """

    job: Path
    status: str
    exit_status: int
    folder: Path | None
    message: str
    result: Report | None


def find_jobs(paths: Sequence[Path]) -> list[Path]:
    """Return the job files named, and for a folder every job file in and below it, sorted.

    In a folder every YAML file counts that has a key which only jobs have, or cannot be read at
    all; hidden files and folders do not. A file that is named twice counts once.

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
        return not keys.OF_A_JOB.isdisjoint(documents.keys(path))
    except InputError:
        return True  # loading it says what is wrong


def run_batch(
    jobs: Sequence[Path],
    out: Path,
    workers: int,
    done: Callable[[BatchRow], None] | None = None,
) -> list[BatchRow]:
    """Run jobs in worker processes.

    Args:
        jobs: The job files.
        out: Each job's files go to the folder of its name in here.
        workers: Number of processes.
        done: Called with each job as it ends.

    Returns:
        One row per job, in the order of ``jobs``.
    """
    rows = {}
    clashes = _clashes(jobs)
    others = [job for job in jobs if job not in clashes]
    for row in chain(clashes.values(), _rows(others, out, workers)):
        rows[row.job] = row
        if done is not None:
            done(row)
    return [rows[job] for job in jobs]


def _rows(jobs: Sequence[Path], out: Path, workers: int) -> Iterator[BatchRow]:
    """Yield the row of each job as it ends."""
    bereft = []
    with _pool(workers) as pool:
        waiting = _submitted(pool, jobs, out)
        with _ended_with(pool, out):
            for future in as_completed(waiting):
                try:
                    yield future.result()
                except BrokenProcessPool:
                    bereft.append(waiting[future])
    # a worker that dies takes the pool with it; whose fault it was shows when each has its own
    for job in bereft:
        with _pool(1) as pool:
            (alone,) = _submitted(pool, [job], out)
            try:
                with _ended_with(pool, out):
                    yield alone.result()
            except BrokenProcessPool:
                clear_after_others(out)
                yield _failed(job, "error", BUG, f"{job}: its worker process died")


def _pool(workers: int) -> ProcessPoolExecutor:
    # spawned, not forked: the children of a process with threads would inherit their locks
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker)


def _submitted(
    pool: ProcessPoolExecutor, jobs: Sequence[Path], out: Path
) -> dict[Future[BatchRow], Path]:
    """Hand jobs to a pool, whose processes start with the first and leave Ctrl-C to this one."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        return {pool.submit(_run_one, job, out): job for job in jobs}
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


@contextmanager
def _ended_with(pool: ProcessPoolExecutor, out: Path) -> Iterator[None]:
    """End the processes of a pool with whatever ends the work on it, and clear up after them."""
    try:
        yield
    except BaseException:
        workers = list(pool._processes.values())  # they have no public name before Python 3.14
        for worker in workers:
            worker.terminate()
        deadline = time.monotonic() + GRACE
        for worker in workers:
            worker.join(max(0.0, deadline - time.monotonic()))
            worker.kill()  # it may be busy in a library that does not know of signals
            worker.join()
        clear_after_others(out)
        raise


def _clashes(jobs: Sequence[Path]) -> dict[Path, BatchRow]:
    """Refuse jobs of one name: each would overwrite the files of the other."""
    by_name: dict[str, list[Path]] = {}
    for job in jobs:
        try:
            by_name.setdefault(str(documents.keys(job)[keys.NAME]), []).append(job)
        except (InputError, KeyError):
            continue  # refused when it is run
    rows = {}
    for name, sharers in by_name.items():
        for job in sharers if len(sharers) > 1 else ():
            others = ", ".join(str(other) for other in sharers if other is not job)
            message = f"must be another for each job, {name} is also that of {others}"
            rows[job] = _refused(job, InputError(f"{job}: {keys.NAME}", message))
    return rows


def _start_worker() -> None:
    signal.signal(signal.SIGTERM, _stop)
    parent = multiprocessing.parent_process()
    assert parent is not None and parent.pid is not None, "a worker is started by another process"
    end_with_parent(parent.pid)
    use_threads(1)  # the processes share the cores


def _stop(number: int, frame: FrameType | None) -> NoReturn:
    release_folders()
    os._exit(1)  # nothing is raised: libraries of C++ are on the way


def _run_one(path: Path, out: Path) -> BatchRow:
    try:
        job = load_job(path)
        folder = out / job.name
        with claim_folder(folder, job.name) as claim:
            run = run_job(job)
            deliver(run, claim)
    except OplError as error:
        return _refused(path, error)
    except Exception as error:  # a bug in one job must not take the night's other jobs with it
        message = f"{type(error).__name__}: {error} (a bug: run it alone to see where)"
        return _failed(path, "error", BUG, message)
    report = make_report(run)
    exit_status = run.error.exit_status if isinstance(run, Refused) else 0
    return BatchRow(path, run.status, exit_status, folder, "\n".join(report.reasons), report)


def _refused(job: Path, error: OplError) -> BatchRow:
    status = "bad input" if isinstance(error, InputError) else "error"
    return _failed(job, status, error.exit_status, str(error))


def _failed(job: Path, status: str, exit_status: int, message: str) -> BatchRow:
    return BatchRow(job, status, exit_status, None, message, None)
