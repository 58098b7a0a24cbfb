"""A worker: one process that does one task after the other, within limits, and may die.

It is a new process, no copy: that of one with threads would inherit their locks. What computes is
loaded in it only, so that whoever hands out tasks stays small.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from opl.files.apart import end_with_parent
from opl.files.claiming import release_folders
from opl.store.values import Outcome, Progress, Task

BEAT = 0.1  # [s] between two looks at a task
# what the process does first: the same modules as here, nothing of the folder that it stands in
_CHILD = """
import sys
from multiprocessing.connection import Connection
pipe = Connection(int(sys.argv[1]))
sys.path[:] = pipe.recv()
from opl.work.worker import work
work(pipe, int(sys.argv[2]))
"""
GRACE = 0.7  # [s] to leave folders in order
LISTENS = 5.0  # [s] for a task to hear that it is cancelled
BUG = 1  # exit status of what ended with an error that is not opl's own

# told how far a task is; returns whether to go on
Beat = Callable[[Progress], bool]


class WorkerDied(Exception):
    """The process of a worker ended in the middle of a task."""


@dataclass(frozen=True)
class Limits:
    """What a task may take; None is no limit.

    Attributes:
        seconds: Time from its beginning.
        memory: Bytes of data of its process.
    """

    seconds: float | None = None
    memory: int | None = None


class Worker:
    """A process for tasks, started when the first comes, and anew after one that it died of.

    Args:
        limits: What each task may take.
        warm: Whether it computes something once before its first task, so that all is loaded.
    """

    def __init__(self, limits: Limits, warm: bool = False) -> None:
        self._limits = limits
        self._warm = warm
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None

    @property
    def pid(self) -> int | None:
        """The number of its process, None while there is none."""
        process = self._process
        return None if process is None or process.poll() is not None else process.pid

    def start(self) -> None:
        """Start the process and wait until it is ready.

        Raises:
            WorkerDied: If it does not come up.
        """
        if self.pid is not None:
            return
        self._drop()
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-I", "-c", _CHILD, str(theirs.fileno()), str(os.getpid())]
        # blocked in the child until it leaves Ctrl-C to the process that began it
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, pass_fds=[theirs.fileno()]
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            theirs.close()
        self._pipe = Connection(ours.detach())
        # whole names: the process goes to the folders of jobs, where strangers put what they like
        self._pipe.send([os.path.abspath(place) for place in sys.path])
        self._pipe.send((self._limits.memory, self._warm))
        self._receive(self._pipe)

    def do(self, task: Task, beat: Beat) -> Outcome | None:
        """Do a task; return what became of it, None if it was cancelled.

        Args:
            task: The task.
            beat: Called again and again meanwhile.

        Raises:
            WorkerDied: If the process died of it.
        """
        self.start()
        pipe = self._pipe
        assert pipe is not None
        began, progress = time.monotonic(), Progress()
        cancelled_at: float | None = None
        try:
            pipe.send(task)
            while True:
                if pipe.poll(BEAT):
                    found = self._receive(pipe)
                    if not isinstance(found, Progress):
                        return found
                    progress = found
                now = time.monotonic()
                most = self._limits.seconds
                if most is not None and now - began > most:
                    self.end()
                    message = f"{task.job}: takes more than the {most:g} s that it may take"
                    return Outcome("error", BUG, message, final=False)
                if cancelled_at is None:
                    if not beat(progress):
                        cancelled_at = now
                        pipe.send(None)
                elif now - cancelled_at > LISTENS:
                    self.end()
                    return None
        except OSError as error:
            raise WorkerDied from error

    def end(self) -> None:
        """End the process, with time to leave its folders in order."""
        if self._process is not None:
            self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
        self._drop()

    def _receive(self, pipe: Connection) -> Outcome | Progress | None:
        try:
            found: Outcome | Progress | None = pipe.recv()
            return found
        except (EOFError, OSError) as error:
            self._drop()
            raise WorkerDied from error

    def _drop(self) -> None:
        if self._pipe is not None:
            self._pipe.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._pipe = self._process = None


def work(pipe: Connection, parent: int) -> None:
    """Do what comes through a pipe until it closes: the process of a worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _stop)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    end_with_parent(parent)
    from opl.work import doing

    doing.prepare(*pipe.recv())
    pipe.send(None)
    home = Path.cwd()
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            os._exit(0)
        if task is None:  # the task that was cancelled had ended before
            continue
        os.chdir(home / task.home)
        found = doing.do(task, lambda progress: _goes_on(pipe, progress))
        os.chdir(home)
        pipe.send(found)
        doing.tidy_up()


def _goes_on(pipe: Connection, progress: Progress) -> bool:
    """Pass on how far a task is; return whether to go on."""
    pipe.send(progress)
    if pipe.poll():
        pipe.recv()
        return False
    return True


def _stop(number: int, frame: object) -> None:
    release_folders()
    os._exit(1)  # nothing is raised: libraries of C++ are on the way
