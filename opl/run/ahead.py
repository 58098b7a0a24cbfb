"""A job that is read and cut in a copy of this process, while this one loads what plans.

What both need is loaded before the copy is made. What reads and checks files, and SciPy, which
cuts, are loaded in the copy alone: this process needs neither for a job that can be used. A refusal
is a value, so that nothing is read once more for it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from opl.errors import InputError
from opl.files.beside import Beside, Later
from opl.files.kernels import load_kernels

if TYPE_CHECKING:
    from opl.job.values import Job
    from opl.run.values import Surfaced

_BOTH_NEED = ("job.values", "program.export", "run.surfacing")
_WHILE_CHECKED = ("run.searches", "run.exporting")  # takes about as long as the check in the copy
_THEN = ("run.stages", "run.reporting", "run.delivery")


@contextmanager
def job_ahead(
    source: Path, method: str | None = None, workers: int = 1
) -> Iterator[tuple[Job, Later[Surfaced]]]:
    """Read a job; yields it and its cutter points, which may be worked out beside meanwhile.

    Args:
        source: The job file.
        method: Search to use instead of the job's own.
        workers: How many processes may work at a time; with one all is done here.

    Raises:
        InputError: If anything in the job is unusable.
    """
    with Beside(workers > 1) as beside:
        refusal = Later(_refusal, source)
        job = Later(_read, source, method)
        surfaced = Later(_cut, job)
        if workers > 1:
            _load(_BOTH_NEED)
        if beside.start():
            for later in (refusal, job, surfaced):
                beside.begin(later)
            _load(_WHILE_CHECKED)
            refused = refusal.value()
            if refused is not None:
                raise refused
            _load(_THEN)
            load_kernels(early=True)
        yield _usable(job), surfaced


def _load(modules: tuple[str, ...]) -> None:
    for module in modules:
        import_module(f"opl.{module}")


def _refusal(source: Path) -> InputError | None:
    """Return why a job is refused for what it says itself; None if that is in order."""
    from opl.job.load import check_job

    try:
        check_job(source)
    except InputError as error:
        return error
    return None


def _read(source: Path, method: str | None) -> Job | InputError:
    """Return a job, or why it is refused."""
    from opl.job.load import load_job

    try:
        return load_job(source, method=method)
    except InputError as error:
        return error


def _usable(job: Later[Job | InputError]) -> Job:
    """Return a job that was read.

    Raises:
        InputError: If it is refused.
    """
    read = job.value()
    if isinstance(read, InputError):
        raise read
    return read


def _cut(job: Later[Job | InputError]) -> Surfaced:
    from opl.run.surfacing import cut_surface  # not for a job that is refused

    return cut_surface(_usable(job))
