"""Tasks done on other machines, through a scheduler of Dask: the same jobs, the same bytes.

A task travels with the bytes of its files and comes back with the bytes of what it made; the
machines share no disk. There it is done by a worker process like those here, with the same limits.
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections.abc import Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from opl.errors import InputError
from opl.files.claiming import write_files
from opl.files.documents import content_of
from opl.files.reading import read_bytes
from opl.files.writing import write_through
from opl.job.files import MOST_BYTES, files_of_job
from opl.run.job_folder import claim_folder, put_files
from opl.store.identity import made_with
from opl.store.made import note_files
from opl.store.values import Outcome, Progress, Task
from opl.work.worker import BEAT, BUG, Beat, Limits, Worker, WorkerDied

PATIENCE = "20s"  # for a scheduler to answer
ELSEWHERE = "on the cluster"  # the stage of a task: how far it is there is not told


@dataclass(frozen=True)
class Parcel:
    """A task that can be done anywhere.

    Attributes:
        task: The task; its names are those of the files.
        files: Bytes by relative name.
        limits: What it may take.
        made_with: What it has to be done with, to the version.
    """

    task: Task
    files: Mapping[str, bytes]
    limits: Limits
    made_with: Mapping[str, str]


class Cluster:
    """A scheduler of Dask and its workers.

    Args:
        address: Of the scheduler, as ``tcp://10.0.0.1:8786``.

    Raises:
        InputError: If the extra is not installed, the scheduler does not answer, or has no workers.
    """

    def __init__(self, address: str) -> None:
        try:
            distributed: Any = import_module("distributed")
        except ImportError as error:
            raise InputError(
                "--scheduler", "needs the extra: pip install 'opl[cluster]'"
            ) from error
        try:
            self._client = distributed.Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, RuntimeError) as error:
            raise InputError(f"--scheduler {address}", f"does not answer: {error}") from error
        self.threads = sum(self._client.nthreads().values())
        if not self.threads:
            self._client.close()
            raise InputError(f"--scheduler {address}", "has no workers: dask worker ADDRESS")

    def doers(self, limits: Limits, most: int) -> list[ClusterDoer]:
        """Return one who does tasks for each thread of the workers, at most as many as tasks."""
        return [ClusterDoer(self._client, limits) for _ in range(min(self.threads, most))]

    def close(self) -> None:
        """Let go of the scheduler."""
        self._client.close()


class ClusterDoer:
    """Does tasks on a cluster, one at a time.

    Args:
        client: Of the scheduler.
        limits: What a task may take.
    """

    def __init__(self, client: Any, limits: Limits) -> None:
        self._client, self._limits = client, limits
        self._stopped = False

    def start(self) -> None:
        """There is nothing to get ready."""

    def end(self) -> None:
        """Let go of the task that is being done; what it does elsewhere is of no use any more."""
        self._stopped = True

    def do(self, task: Task, beat: Beat) -> Outcome | None:
        """Do a task; return what became of it, None if it was cancelled.

        Raises:
            WorkerDied: If the scheduler gave it up, because workers died of it, or was lost.
        """
        distributed: Any = import_module("distributed")
        try:
            parcel = packed(task, self._limits)
        except InputError as error:
            return Outcome("bad input", error.exit_status, str(error))
        if self._client.status == "closed":  # it found no scheduler any more for `PATIENCE`
            message = f"{task.job}: the scheduler of the cluster does not answer any more"
            return Outcome("error", BUG, message, final=False)
        future = self._client.submit(perform, parcel, pure=False)
        # looked at, not asked for with a timeout: one that runs out while the outcome is fetched
        # leaves the client without the outcome of any other task (distributed 2026.8)
        while not future.done():
            time.sleep(BEAT)
            if self._client.status == "closed":
                raise WorkerDied
            if self._stopped:
                future.cancel(force=True)
                raise WorkerDied
            if not beat(Progress(ELSEWHERE)):
                future.cancel(force=True)
                return None
        try:
            outcome, files = future.result()
        except (distributed.scheduler.KilledWorker, CancelledError, OSError) as error:
            raise WorkerDied from error  # or the scheduler was lost, which cancels what it had
        except Exception as error:  # what Python could not do there, e.g. import opl
            message = f"{task.job}: {type(error).__name__} on the cluster: {error}"
            return Outcome("error", BUG, message, final=False)
        message = outcome.message.replace(parcel.task.job, task.job)
        return _delivered(task, replace(outcome, message=message), files)


def packed(task: Task, limits: Limits) -> Parcel:
    """Return a task with the bytes of its files.

    Raises:
        InputError: If a file cannot be read, or is named by an absolute path.
    """
    home = (Path.cwd() / task.home).resolve()
    job = home / task.job
    if task.confined:
        found = [path for path in home.rglob("*") if path.is_file()]
    else:
        named = files_of_job(job, content_of(job))
        for name in named:
            if os.path.isabs(name):
                raise InputError(task.job, f"names {name}, which other machines do not have")
        found = [path for path in named.values() if path.is_file()]
    places = {path: Path(os.path.abspath(path)) for path in [*found, job]}
    top = home
    if not all(place.is_relative_to(home) for place in places.values()):
        top = Path(os.path.commonpath([str(place.parent) for place in places.values()]))
    files = {
        place.relative_to(top).as_posix(): read_bytes(path, MOST_BYTES)
        for path, place in places.items()
    }
    sent = replace(task, job=places[job].relative_to(top).as_posix(), home="", out="../out")
    return Parcel(sent, files, limits, made_with())


_THREAD = threading.local()


def _worker(limits: Limits) -> Worker:
    """Return the worker of this thread, which stays for the next parcel with the same limits."""
    known: tuple[Limits, Worker] | None = getattr(_THREAD, "known", None)
    if known is not None and known[0] == limits:
        return known[1]
    if known is not None:
        known[1].end()
    worker = Worker(limits)
    _THREAD.known = (limits, worker)
    return worker


def perform(parcel: Parcel) -> tuple[Outcome, dict[str, bytes]]:
    """Do the task of a parcel on the machine that this runs on; return what it made."""
    other = {
        name: f"{name} {made_with().get(name)} there, {version} here"
        for name, version in parcel.made_with.items()
        if made_with().get(name) != version
    }
    if other:
        message = (
            f"{parcel.task.job}: a worker of the cluster has other versions, which would make "
        )
        message += f"other programs: {'; '.join(other.values())}"
        return Outcome("error", BUG, message, final=False), {}
    worker = _worker(parcel.limits)
    with tempfile.TemporaryDirectory(prefix="opl-") as folder:
        home = Path(folder).resolve() / "in"
        for name, content in parcel.files.items():
            (home / name).parent.mkdir(parents=True, exist_ok=True)
            write_through(home / name, content)
        task = replace(parcel.task, home=str(home))
        outcome = worker.do(task, lambda *_: True)
        assert outcome is not None, "nobody cancels it there"
        made = home / (outcome.folder or "")
        return outcome, {name: (made / name).read_bytes() for name in outcome.files}


def _delivered(task: Task, outcome: Outcome, files: Mapping[str, bytes]) -> Outcome:
    """Put what came back where it belongs, as a run on this machine would."""
    if outcome.folder is None:
        return outcome
    home = Path.cwd() / task.home
    try:
        if task.kind != "run":
            written = write_files(home / task.out, files)
            return replace(outcome, folder=task.out, files=note_files(written))
        name = Path(outcome.folder).name
        with claim_folder(home / task.out / name, name) as claim:
            written = put_files(claim, files)
            return replace(outcome, folder=os.path.join(task.out, name), files=note_files(written))
    except InputError as error:
        return Outcome("bad input", error.exit_status, str(error), final=False)
