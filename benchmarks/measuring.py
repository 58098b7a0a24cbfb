"""Times of functions and of whole processes: median and spread of several runs."""

from __future__ import annotations

import os
import statistics
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Timing:
    """What several runs took.

    Attributes:
        median: In [s]; of a whole process by the clock on the wall.
        least: The shortest in [s].
        most: The longest in [s].
        cpu: Median of the seconds of computing, of a whole process with its children.
        memory: Peak of the largest process in [bytes], 0 where it was not looked at.
    """

    median: float
    least: float
    most: float
    cpu: float
    memory: int = 0


UNCOMPILED = "PYTHONDONTWRITEBYTECODE"  # with it every start compiles all modules of opl anew
MICRO, SECOND = ("us", 1e6), ("s", 1.0)  # units: a name, and how many of it are in a second


@dataclass(frozen=True)
class Row:
    """A measure of opl, and of what it is held against.

    Attributes:
        name: What was done.
        unit: What the times are given in: a name and how many of it are in a second.
        ours: Times of opl, for one of whatever is counted.
        reference: What it is held against, empty for nothing.
        theirs: Its time.
        bar: What issue 14 wants in [s], None for nothing.
    """

    name: str
    unit: tuple[str, float]
    ours: Timing
    reference: str = ""
    theirs: Timing | None = None
    bar: float | None = None


def timed(work: Callable[[], object], runs: int, count: int = 1) -> Timing:
    """Return what a function takes for each of ``count`` things; a first run is not counted."""
    work()
    walls, cpus = [], []
    for _ in range(runs):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        walls.append((time.perf_counter() - wall) / count)
        cpus.append((time.process_time() - cpu) / count)
    return Timing(statistics.median(walls), min(walls), max(walls), statistics.median(cpus))


def timed_process(command: Sequence[str], runs: int, most_seconds: float) -> Timing | None:
    """Return what a command takes as a whole process; None if it fails or takes too long.

    Python keeps what it compiles, as where opl is installed; the first run may have to compile it.
    """
    environment = {name: os.environ[name] for name in os.environ if name != UNCOMPILED}
    walls, cpus, peaks = [], [], []
    for _ in range(runs):
        start = time.perf_counter()
        process = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        while True:
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
            if ended:
                process.returncode = os.waitstatus_to_exitcode(status)
                break
            if time.perf_counter() - start > most_seconds:
                process.kill()
                process.wait()
                return None
            time.sleep(0.002)
        if process.returncode != 0:
            return None
        walls.append(time.perf_counter() - start)
        cpus.append(usage.ru_utime + usage.ru_stime)
        peaks.append(1024 * usage.ru_maxrss)
    return Timing(
        statistics.median(walls), min(walls), max(walls), statistics.median(cpus), max(peaks)
    )
