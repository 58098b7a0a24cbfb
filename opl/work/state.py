"""How a batch stands, without running it; and whether its files are what was written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from opl.errors import InputError
from opl.files.writing import HIDDEN
from opl.job.files import Digests
from opl.run.batch import BatchRow
from opl.store.jobs import Store
from opl.store.made import changed_files
from opl.store.values import State
from opl.work.batch import STORE
from opl.work.wanted import ask


@dataclass(frozen=True)
class JobStanding:
    """How a job of a batch stands.

    Attributes:
        job: The job file.
        name: Of the job; empty if its file does not say it.
        standing: ``unchanged``, ``changed``, ``files changed``, ``to be tried again``, ``new``,
            ``queued``, ``running``, ``cancelled`` or ``bad input``.
        status: What became of it when it was last run, None if it was not.
        id: Of the job as it is now; empty if its file cannot be read.
    """

    job: Path
    name: str
    standing: str
    status: str | None
    id: str


def batch_standing(jobs: Sequence[Path], out: Path) -> list[JobStanding]:
    """Return how each job stands; changes nothing."""
    store = Store(out / STORE) if (out / STORE).is_file() else None
    request = ask(jobs, out, Digests())
    found = []
    for one in request.order:
        if isinstance(one, BatchRow):
            found.append(JobStanding(one.job, "", one.status, None, ""))
            continue
        wanted = request.jobs[one]
        job = None if store is None else store.of_target(wanted.target)
        status = None if job is None or job.outcome is None else job.outcome.status
        if job is None:
            standing = "new"
        elif job.state in (State.QUEUED, State.RUNNING, State.CANCELLED):
            standing = job.state.value
        elif job.id != wanted.id:
            standing = "changed"
        elif job.outcome is None or not job.outcome.final:
            standing = "to be tried again"
        elif changed_files(out / wanted.name, job.outcome.files):
            standing = "files changed"
        else:
            standing = "unchanged"
        found.append(JobStanding(wanted.path, wanted.name, standing, status, wanted.id))
    return found


def audit(out: Path) -> tuple[int, list[str]]:
    """Read every file that the jobs in a folder made, and hold it against its digest.

    Returns:
        How many files there are, and what is wrong, one line each.

    Raises:
        InputError: If the folder has no store, or the store cannot be used.
    """
    if not (out / STORE).is_file():
        raise InputError(str(out / STORE), "no such file: no batch has run in this folder")
    store = Store(out / STORE)
    wrong = [f"{store.path}: {fault}" for fault in store.check()]
    count = 0
    running = {job.target for job in store.jobs(State.RUNNING)}
    for job in reversed(store.jobs()):
        if job.outcome is None or job.outcome.folder is None:
            continue
        folder = out / job.target
        count += len(job.outcome.files)
        for name in changed_files(folder, job.outcome.files, every_byte=True):
            fault = "is not what was written" if (folder / name).exists() else "is gone"
            wrong.append(f"{folder / name}: {fault} (job {job.id})")
    for path in sorted(out.rglob(f"{HIDDEN}*")):
        if path.relative_to(out).parts[0] not in running:
            wrong.append(f"{path}: was left by a run that was killed; the next batch clears it")
    return count, wrong


def open_store(folder: Path) -> Store:
    """Return the store of a folder of a batch, of an outbox, or of a service.

    Raises:
        InputError: If it has none.
    """
    if not (folder / STORE).is_file():
        raise InputError(str(folder / STORE), "no such file: no batch or service has worked here")
    return Store(folder / STORE)
