"""A command in a forked process with limits: how it ended, and what it cost."""

from __future__ import annotations

import os
import resource
import signal
import sys
import traceback
from dataclasses import dataclass

MOST_SECONDS = 30  # of computing
MOST_MEMORY = 2_000_000_000  # bytes
MOST_WALL = 150  # [s]; the machine may have other work


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Attributes:
        status: Exit status, negative for a signal.
        printed: All that it printed.
        seconds: Computing time of it and its children.
        memory: Most memory in bytes.
    """

    status: int
    printed: str
    seconds: float
    memory: int

    @property
    def faults(self) -> list[str]:
        """What must not happen, whatever the input."""
        found = []
        if self.status < 0:
            found.append(f"ended by {signal.Signals(-self.status).name}")
        if "Traceback" in self.printed or self.status not in (0, 1, 2, 3, 4):
            found.append(f"status {self.status}: {self.printed[-600:]}")
        if self.seconds > MOST_SECONDS:
            found.append(f"took {self.seconds:.0f} s")
        if self.memory > MOST_MEMORY:
            found.append(f"took {self.memory / 1e9:.1f} GB")
        return found


def attacked(command, folder) -> Ended:
    """Call a command without arguments in a process of its own that stands in a folder."""
    log = folder.parent / f"{folder.name}.log"
    child = os.fork()
    if child == 0:
        status = 99
        try:
            opened = os.open(log, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
            os.dup2(opened, 1)
            os.dup2(opened, 2)
            sys.stdout = open(1, "w", closefd=False, errors="replace")  # noqa: SIM115
            sys.stderr = open(2, "w", closefd=False, errors="replace")  # noqa: SIM115
            os.chdir(folder)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_CPU, (MOST_SECONDS, MOST_SECONDS + 1))
            resource.setrlimit(resource.RLIMIT_DATA, (2 * MOST_MEMORY, 2 * MOST_MEMORY))
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.alarm(MOST_WALL)
            try:
                command()
                status = 0
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else 1
            except BaseException:
                traceback.print_exc()
            sys.stdout.flush()
            sys.stderr.flush()
        finally:
            os._exit(status)
    _, waited, used = os.wait4(child, 0)
    return Ended(
        os.waitstatus_to_exitcode(waited),
        log.read_text(errors="replace"),
        used.ru_utime + used.ru_stime,
        used.ru_maxrss * 1024,
    )
