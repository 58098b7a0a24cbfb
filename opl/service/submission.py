"""What is sent to the service: a task and its files; checked, and put into the store."""

from __future__ import annotations

import json
import shutil
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from opl.errors import InputError
from opl.files.digests import digest
from opl.files.names import checked_name
from opl.files.writing import sync_folder, write_through
from opl.store.identity import job_id
from opl.store.jobs import Store
from opl.store.values import StoredJob, Task

MOST_FILES = 200
KINDS = ("run", "check", "points", "verify", "faces")
JOBS = "jobs"  # folder of the jobs in that of the store
INPUTS, OUTPUTS = "in", "out"
ASIDE = ".new-"  # how the names begin of folders that are being written


@dataclass(frozen=True)
class Submission:
    """What is asked for.

    Attributes:
        task: What is to be done, all names relative.
        files: The files by name.
    """

    task: Task
    files: Mapping[str, bytes]


def checked(task: Task, files: Mapping[str, bytes]) -> Submission:
    """Return a submission whose names are those of its files.

    Raises:
        InputError: If a name leads elsewhere, is given twice over, or names no file.
    """
    if task.kind not in KINDS:
        raise InputError("task", f"must be one of {', '.join(KINDS)}, got {task.kind!r}")
    if not files or len(files) > MOST_FILES:
        raise InputError("files", f"must be 1 to {MOST_FILES} files, got {len(files)}")
    names = {checked_name(name) for name in files}
    for name in names:
        above = {str(parent) for parent in Path(name).parents}
        if clash := sorted(above & names):
            raise InputError(f"file {name!r}", f"lies in {clash[0]!r}, which is a file")
    for key, named in (("job", task.job), *(("programs", one) for one in task.programs)):
        if named not in names:
            known = ", ".join(sorted(names)[:10])
            raise InputError(key, f"must be one of the files sent ({known}), got {named!r}")
    if (task.kind == "verify") != bool(task.programs):
        raise InputError("programs", "are the program files that task verify proves, no others")
    return Submission(task, files)


def put(store: Store, submission: Submission, again: bool = False) -> StoredJob:
    """Put a submission into the store: its files first, whole or not at all, then the job.

    The same submission is the same job.
    """
    task, files = submission.task, submission.files
    asked = {"service": [task.kind, task.job, task.method, list(task.programs), task.unit]}
    id_ = job_id({name: digest(content) for name, content in files.items()}, asked)
    home = store.path.parent / JOBS / id_
    if not (home / INPUTS).is_dir():
        home.mkdir(parents=True, exist_ok=True)
        aside = home / f"{ASIDE}{uuid.uuid4().hex}"
        try:
            for name, content in files.items():
                (aside / name).parent.mkdir(parents=True, exist_ok=True)
                write_through(aside / name, content)
            try:
                aside.rename(home / INPUTS)
            except OSError:
                if not (home / INPUTS).is_dir():  # somebody else was quicker
                    raise
            sync_folder(home)
            sync_folder(home.parent)
        except OSError as error:
            raise InputError("files", f"cannot be kept: {error.strerror}") from error
        finally:
            shutil.rmtree(aside, ignore_errors=True)
    placed = Task(
        task.kind,
        task.job,
        str(Path("..") / OUTPUTS),
        str(home.resolve() / INPUTS),
        task.method,
        task.programs,
        unit=task.unit,
        confined=True,
    )
    return store.submit(id_, id_, f"{task.kind} {task.job}", placed, again)


def made_by(store: Store, job: StoredJob, name: str) -> Path | None:
    """Return a file that a job made, None if it made none of this name."""
    outcome = job.outcome
    if outcome is None or outcome.folder is None or name not in outcome.files:
        return None
    return Path(job.task.home) / outcome.folder / name


def figures_of(store: Store, job: StoredJob) -> object:
    """Return the figures that a job made, None if there are none."""
    outcome = job.outcome
    if outcome is None or outcome.result is None:
        return None
    path = made_by(store, job, outcome.result)
    try:
        return None if path is None else json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None


def tidy(store: Store) -> None:
    """Remove what a service that was killed left beside its jobs: folders that no job has."""
    known = {job.id for job in store.jobs()}
    folder = store.path.parent / JOBS
    for place in folder.iterdir() if folder.is_dir() else ():
        if place.name not in known:
            shutil.rmtree(place, ignore_errors=True)
        else:
            for aside in place.glob(f"{ASIDE}*"):
                shutil.rmtree(aside, ignore_errors=True)
