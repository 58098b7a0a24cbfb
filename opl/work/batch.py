"""Batches: many jobs in worker processes, those that have not changed answered from the store."""

from __future__ import annotations

import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from opl.errors import InputError
from opl.files.claiming import clear_after_others
from opl.files.reading import read_bytes
from opl.files.writing import write_file
from opl.job.files import Digests
from opl.run.batch import BatchRow
from opl.run.batch_page import batch_page
from opl.run.job_folder import MOST_RESULT
from opl.run.result import PAGE, read_report
from opl.store.jobs import Store
from opl.store.made import changed_files
from opl.store.values import State, StoredJob
from opl.work.cluster import Cluster
from opl.work.crew import Crew, Doer
from opl.work.wanted import Wanted, ask, wanted_jobs
from opl.work.worker import BUG, Limits, Worker

STORE = "opl-jobs.sqlite"
LOOK = 0.3  # [s] between two looks at jobs that others work on


@dataclass(frozen=True)
class BatchSettings:
    """How a batch is run.

    Attributes:
        workers: Number of processes.
        force: Run all jobs, unchanged ones too.
        seconds: Longest time of a job, None for no limit.
        memory: Most bytes of data of a worker, None for no limit.
        scheduler: Address of a scheduler of Dask whose workers run the jobs; None for processes
            here.
    """

    workers: int = 1
    force: bool = False
    seconds: float | None = None
    memory: int | None = None
    scheduler: str | None = None


def run_batch(
    jobs: Sequence[Path],
    out: Path,
    settings: BatchSettings,
    done: Callable[[BatchRow], None] | None = None,
) -> list[BatchRow]:
    """Run jobs in worker processes; those that have not changed since they were run are left.

    A job is run again when one of its files has changed, opl or a library it computes with, or a
    file that it made. Killed at any moment, the batch leaves old or new files of each job, and the
    next one goes on where it was. Several at once share the work.

    Args:
        jobs: The job files; a list where a value belongs makes a job for each value.
        out: Each job's files go to the folder of its name in here, with the store beside them.
        settings: How.
        done: Called with each job as it ends.

    Returns:
        One row per job, in the order of ``jobs``.

    Raises:
        InputError: If the store cannot be used.
    """
    batch = _Batch(out, settings)
    request = ask(jobs, out, batch.digests)
    rows: dict[str, BatchRow] = {}
    tell = done or (lambda _: None)
    for one in request.order:
        if isinstance(one, BatchRow):
            tell(one)
        elif not settings.force and (known := batch.known(request.jobs[one])) is not None:
            rows[one] = known
            tell(known)
    for row in batch.run({id_: one for id_, one in request.jobs.items() if id_ not in rows}, tell):
        rows[row[0]] = row[1]
    return [one if isinstance(one, BatchRow) else rows[one] for one in request.order]


def write_batch_page(rows: Sequence[BatchRow], out: Path) -> None:
    """Write the page of a batch into its folder, one batch after the other."""
    with Store(out / STORE).alone():
        write_file(out / PAGE, batch_page(rows, out))


class _Batch:
    """A batch at work."""

    def __init__(self, out: Path, settings: BatchSettings) -> None:
        self.digests = Digests()
        self._out, self._settings = out, settings
        self._store = Store(out / STORE)

    def known(self, wanted: Wanted) -> BatchRow | None:
        """Return the row of a job that was done before and whose files are as they were."""
        job = self._store.of_target(wanted.target)
        if job is None or job.id != wanted.id or not job.state.ended or job.outcome is None:
            return None
        if not job.outcome.final or changed_files(self._out / wanted.name, job.outcome.files):
            return None
        return replace(self._row(wanted, job), unchanged=True)

    def _is_done(self, wanted: Wanted) -> bool:
        """Return whether a job is done as it is, though not all of its files are as they were."""
        job = self._store.of_target(wanted.target)
        return job is not None and job.id == wanted.id and job.state.ended

    def run(
        self, jobs: dict[str, Wanted], tell: Callable[[BatchRow], None]
    ) -> list[tuple[str, BatchRow]]:
        """Run jobs; return the row of each with the id it was asked for by."""
        if not jobs:
            return []
        left = dict(jobs)  # by the id that each has now
        request = {id_: id_ for id_ in jobs}
        for one in jobs.values():
            self._submit(one, again=self._settings.force or self._is_done(one))
        ended: queue.Queue[str] = queue.Queue()

        def pick() -> StoredJob | None:
            for id_, wanted in list(left.items()):
                claimed = self._store.claim(id_)
                if claimed is not None:
                    return replace(claimed, task=wanted.task)
            return None

        limits = Limits(self._settings.seconds, self._settings.memory)
        scheduler = self._settings.scheduler
        cluster = None if scheduler is None else Cluster(scheduler)
        doers: Sequence[Doer]
        if cluster is not None:
            doers = cluster.doers(limits, len(jobs))
        else:
            doers = [Worker(limits) for _ in range(min(self._settings.workers, len(jobs)))]
        crew = Crew(self._store, doers, pick, ended.put)
        rows = []
        crew.start()
        try:
            while left:
                for id_ in self._next(ended, left):
                    if crew.fault is not None:
                        raise crew.fault
                    wanted, job = left[id_], self._store.get(id_)
                    if job is None or job.state is State.CANCELLED:
                        self._submit(wanted)
                        continue
                    if not job.state.ended:
                        continue
                    del left[id_]
                    if (newer := self._newer(wanted)) is not None:
                        left[newer.id], request[newer.id] = newer, request[id_]
                        self._submit(newer)
                        continue
                    row = self._row(wanted, job)
                    rows.append((request[id_], row))
                    tell(row)
        finally:
            crew.end()
            if cluster is not None:
                cluster.close()
            clear_after_others(self._out)
        return rows

    def _next(self, ended: queue.Queue[str], left: dict[str, Wanted]) -> list[str]:
        """Wait for a job that ended here; else return all, as others may have ended them."""
        try:
            id_ = ended.get(timeout=LOOK)
            return [id_] if id_ in left else []
        except queue.Empty:
            return list(left)

    def _submit(self, wanted: Wanted, again: bool = False) -> None:
        self._store.submit(wanted.id, wanted.target, wanted.name, wanted.task, again)

    def _newer(self, wanted: Wanted) -> Wanted | None:
        """Return what a job is now, if its files were changed while it was run."""
        try:
            now = wanted_jobs(wanted.path, self._out, self.digests)
        except InputError:
            return None
        same_name = [one for one in now if one.name == wanted.name]
        return same_name[0] if len(same_name) == 1 and same_name[0].id != wanted.id else None

    def _row(self, wanted: Wanted, job: StoredJob) -> BatchRow:
        outcome = job.outcome
        assert outcome is not None
        if outcome.folder is None:
            message = outcome.message.replace(job.task.job, str(wanted.path))
            if not outcome.final and outcome.exit_status == BUG and "a bug" not in message:
                message = message if str(wanted.path) in message else f"{wanted.path}: {message}"
            return wanted.row(outcome.status, outcome.exit_status, message)
        folder = self._out / wanted.name
        row = wanted.row(outcome.status, outcome.exit_status, outcome.message)
        if outcome.result is None:
            return replace(row, folder=folder)
        try:
            report = read_report(read_bytes(folder / outcome.result, MOST_RESULT))
        except (InputError, ValueError):  # somebody has just changed it
            report = None
        return replace(row, folder=folder, result=report)
