"""Threads that take jobs of the store, and have each done by a worker."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from opl.errors import OplError
from opl.store.events import tell
from opl.store.jobs import Store
from opl.store.values import Outcome, Progress, State, StoredJob, Task
from opl.work.worker import BUG, Beat, WorkerDied

IDLE = 0.5  # [s] between two looks for work, unless somebody says that there is some
SELDOM = 0.4  # [s] between two words about progress


class Doer(Protocol):
    """Who does tasks, one at a time: a process here or on another machine."""

    def start(self) -> None:
        """Get ready; may take seconds.

        Raises:
            WorkerDied: If it does not come up.
        """

    def do(self, task: Task, beat: Beat) -> Outcome | None:
        """Do a task; return what became of it, None if it was cancelled.

        Raises:
            WorkerDied: If the process died of it.
        """

    def end(self) -> None:
        """End at once."""


class Crew:
    """Works on the jobs of a store until it is ended.

    Args:
        store: The store.
        doers: Who does the work; each has a thread.
        pick: Claims a job; the oldest by default.
        ended: Called in the thread with the id of each job that ended.
    """

    def __init__(
        self,
        store: Store,
        doers: Sequence[Doer],
        pick: Callable[[], StoredJob | None] | None = None,
        ended: Callable[[str], None] | None = None,
    ) -> None:
        self._store = store
        self._doers = doers
        self._pick = pick or store.claim
        self._ended = ended or (lambda _: None)
        self._stop, self._work = threading.Event(), threading.Event()
        self._threads = [
            threading.Thread(target=self._serve, args=(doer,), daemon=True) for doer in doers
        ]
        self.size, self.ready = len(doers), 0
        self.fault: OplError | None = None

    def start(self) -> None:
        """Begin to work."""
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """Say that there is something to do."""
        self._work.set()

    def end(self) -> None:
        """End all that is going on; jobs that are not done go back into the queue."""
        self._stop.set()
        self._work.set()
        enders = [threading.Thread(target=doer.end) for doer in self._doers]
        for thread in enders:
            thread.start()
        for thread in [*enders, *self._threads]:
            thread.join(5.0)

    def _serve(self, doer: Doer) -> None:
        began = False
        while not self._stop.is_set():
            try:
                if not began:
                    doer.start()
                    began, self.ready = True, self.ready + 1
                job = self._pick()
                if job is None:
                    self._work.wait(IDLE)
                    self._work.clear()
                else:
                    self._do(doer, job)
            except (OplError, WorkerDied) as error:
                # of the store, e.g. on a full disk, or of a machine without room for a process
                if isinstance(error, OplError):
                    self.fault = error
                tell("trouble", message=str(error) or "a worker did not come up")
                self._stop.wait(2.0 * IDLE)

    def _do(self, doer: Doer, job: StoredJob) -> None:
        tell("begun", job=job.id, name=job.name, kind=job.task.kind, attempt=job.attempts)
        last = ("", 0.0)

        def beat(progress: Progress) -> bool:
            nonlocal last
            now = time.monotonic()
            if progress.stage == last[0] and now - last[1] < SELDOM:
                return True
            last = progress.stage, now
            return self._store.renew(job.id, progress)

        try:
            outcome = doer.do(job.task, beat)
        except WorkerDied:
            self._store.give_back(job.id, died=not self._stop.is_set())
            if not self._stop.is_set():
                tell("worker died", job=job.id, name=job.name)
                if (found := self._store.get(job.id)) is None or found.state is State.FAILED:
                    self._ended(job.id)
            return
        except OplError:  # of the store
            raise
        except Exception as error:  # a bug, which must not end the thread for all other jobs
            message = f"{type(error).__name__}: {error} (a bug of opl)"
            outcome = Outcome("error", BUG, message, final=False)
        if self._stop.is_set() and outcome is None:
            self._store.give_back(job.id, died=False)
            return
        self._store.finish(job.id, outcome)
        status = "cancelled" if outcome is None else outcome.status
        tell("ended", job=job.id, name=job.name, status=status)
        self._ended(job.id)
