"""What a batch is asked for: job files, and the jobs that each of them makes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from opl.errors import InputError, OplError
from opl.files import documents
from opl.job import keys
from opl.job.files import Digests, files_of_job
from opl.job.sweeps import variants
from opl.run.batch import BatchRow
from opl.store.identity import job_id
from opl.store.values import Task


@dataclass(frozen=True)
class Wanted:
    """A job of a batch.

    Attributes:
        path: The job file.
        name: Of the job and of its folder; empty if the file does not say it.
        changes: Of a job of a sweep, values by key path, its name among them.
        task: What is to be done.
        id: Digest of all that its outcome depends on.
    """

    path: Path
    name: str
    changes: Mapping[str, Any]
    task: Task
    id: str

    @property
    def target(self) -> str:
        """What it makes; a batch has one job for each."""
        return self.name or f"file {self.path}"

    @property
    def variant(self) -> dict[str, Any]:
        """The values that make it a job of a sweep."""
        return {key: value for key, value in self.changes.items() if key != keys.NAME}

    def row(self, status: str, exit_status: int, message: str) -> BatchRow:
        """Return the row of this job without files."""
        return BatchRow(
            self.path, status, exit_status, None, message, None, self.id, variant=self.variant
        )


@dataclass
class Request:
    """The jobs of a batch: those that can be begun, and those that are refused before.

    Attributes:
        order: What stands for each job, in the order of the files.
        jobs: The jobs by id.
    """

    order: list[str | BatchRow] = field(default_factory=list)
    jobs: dict[str, Wanted] = field(default_factory=dict)


def wanted_jobs(path: Path, out: Path, digests: Digests) -> list[Wanted]:
    """Return the jobs that a job file makes: one, or those of a sweep.

    Args:
        path: The job file.
        out: Folder of the jobs' folders.
        digests: Of its files.

    Raises:
        InputError: If the file cannot be read, or its sweep makes no sense.
    """
    content = documents.content_of(path)
    values = content if isinstance(content, Mapping) else {}
    found = []
    files = {name: digests.of(one) for name, one in files_of_job(path, content).items()}
    for changes in variants(str(path), values) or [{}]:
        name = changes.get(keys.NAME, values.get(keys.NAME, ""))
        name = name if isinstance(name, str) else ""
        named = dict(files)
        task = Task("run", str(path), str(out), changes=changes)
        kind = {"batch": [name or str(path), changes]}
        found.append(Wanted(path, name, changes, task, job_id(named, kind)))
    return found


def ask(paths: Iterable[Path], out: Path, digests: Digests) -> Request:
    """Return the jobs of a batch; jobs of one name are refused, each would overwrite the other."""
    request = Request()
    all_: list[Wanted | BatchRow] = []
    for path in paths:
        try:
            all_ += wanted_jobs(path, out, digests)
        except InputError as error:
            all_.append(refused(path, error))
    by_name: dict[str, list[Path]] = {}
    for one in all_:
        if isinstance(one, Wanted) and one.name:
            by_name.setdefault(one.name, []).append(one.path)
    for one in all_:
        if isinstance(one, Wanted) and len(by_name.get(one.name, ())) > 1:
            message = f"must be another for each job, {one.name} is also that of "
            message += _others(by_name[one.name], one.path)
            request.order.append(refused(one.path, InputError(f"{one.path}: {keys.NAME}", message)))
        elif isinstance(one, Wanted):
            request.order.append(one.id)
            request.jobs[one.id] = one
        else:
            request.order.append(one)
    return request


def _others(sharers: Sequence[Path], path: Path) -> str:
    return ", ".join(str(other) for other in sharers if other != path) or "another of its sweep"


def refused(path: Path, error: OplError) -> BatchRow:
    """Return the row of a job file that is refused."""
    status = "bad input" if isinstance(error, InputError) else "error"
    return BatchRow(path, status, error.exit_status, None, str(error), None)
