"""A job that is read and cut in a copy of this process, while this one loads what plans.

The one needs SciPy, the other numba, and each takes as long to load as the other.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from opl.files.beside import Beside, Later
from opl.files.kernels import load_kernels
from opl.job.load import check_job, job_in_si
from opl.job.values import Job
from opl.run.values import Surfaced


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
        checked = check_job(source)
        job = Later(job_in_si, checked, method)
        surfaced = Later(_cut, job)
        if beside.start(checked):
            beside.begin(job)
            beside.begin(surfaced)
            for module in ("stages", "reporting", "delivery"):
                import_module(f"opl.run.{module}")
            load_kernels(early=True)
        yield job.value(), surfaced


def _cut(job: Later[Job]) -> Surfaced:
    from opl.run.surfacing import cut_surface  # not for a job that is refused

    return cut_surface(job.value())
