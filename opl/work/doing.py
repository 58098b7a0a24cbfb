"""What a worker does with a task: this module loads all that computes."""

from __future__ import annotations

import ctypes
import gc
import math
import os
import resource
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from opl.errors import Cancelled, InputError, OplError
from opl.files.claiming import write_files
from opl.files.confining import confine_to
from opl.files.kernels import load_kernels, use_threads
from opl.files.resources import folder
from opl.geometry.faces import list_faces
from opl.job import keys
from opl.job.load import load_job
from opl.job.values import Job
from opl.run.delivery import deliver
from opl.run.descriptions import describe_job, face_figures
from opl.run.job_folder import claim_folder
from opl.run.points import cell_file, points_files, report_points
from opl.run.programs import prove_program
from opl.run.result import RESULT, to_json
from opl.run.stages import run_job
from opl.run.surfacing import cut_surface
from opl.run.values import Refused
from opl.run.watch import Stage, Watch
from opl.store.made import note_files
from opl.store.values import Outcome, Progress, Task

Tell = Callable[[Progress], bool]
SELDOM = 0.05  # [s] between two words about progress
CREASE = math.radians(30.0)  # between triangles of a mesh that ends a face, as of `opl faces`
FIGURES = "figures.json"  # of a task that is no run


def prepare(memory: int | None, warm: bool) -> None:
    """Make this process ready for tasks.

    Args:
        memory: Bytes of data that it may have, None for no limit.
        warm: Compute something once, so that the first task finds all loaded.
    """
    use_threads(1)  # the processes share the cores
    load_kernels()
    if memory is not None:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    if warm:
        run_job(
            load_job(folder("workpieces") / "v_shape" / "job.yaml", changes=keys.COARSE_EXAMPLE)
        )
    tidy_up()
    gc.freeze()  # what stays is not gone through after each task


def tidy_up() -> None:
    """Give back what a task has left, so that a worker is as large after a thousand as after one.

    Cycles of objects are taken apart, and free memory that the C library keeps (glibc) goes back
    to the system.
    """
    gc.collect()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def do(task: Task, tell: Tell) -> Outcome | None:
    """Do a task; return what became of it, None if it was cancelled."""
    last = 0.0

    def report(stage: Stage, fraction: float) -> None:
        nonlocal last
        if fraction in (0.0, 1.0) or time.monotonic() - last > SELDOM:
            last = time.monotonic()
            known = watch.so_far if stage is Stage.SEARCH else None
            figures = (None, None) if known is None else (known.value, known.lower_bound)
            if not tell(Progress(stage.value, fraction, *figures)):
                watch.cancel()

    watch = Watch(report)
    try:
        with confine_to(Path.cwd() if task.confined else None):
            return _KINDS[task.kind](task, watch)
    except Cancelled:
        return None
    except _FolderError as error:
        refusal = error.__cause__
        assert isinstance(refusal, InputError)
        return Outcome("bad input", refusal.exit_status, str(refusal), final=False)
    except OplError as error:
        status = "bad input" if isinstance(error, InputError) else "error"
        return Outcome(status, error.exit_status, str(error))
    except MemoryError:
        most = resource.getrlimit(resource.RLIMIT_DATA)[0]
        message = f"{task.job}: takes more than the {most / 1e6:g} MB of memory that it may take"
        return Outcome("error", 1, message, final=False)
    except Exception as error:  # a bug in one job must not take the night's other jobs with it
        message = f"{type(error).__name__}: {error} (a bug: run it alone to see where)"
        return Outcome("error", 1, message, final=False)


class _FolderError(Exception):
    """What the folder is refused for, which is not the job's fault."""


@contextmanager
def _of_the_folder() -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise _FolderError from error


def _run(task: Task, watch: Watch) -> Outcome:
    job = _job(task)
    folder = Path(task.out) / job.name
    with ExitStack() as stack:
        with _of_the_folder():
            claim = stack.enter_context(claim_folder(folder, job.name))
        run = run_job(job, watch)
        with _of_the_folder():
            files = note_files(deliver(run, claim))
    return Outcome(
        run.status,
        run.error.exit_status if isinstance(run, Refused) else 0,
        "\n".join(run.reasons) if isinstance(run, Refused) else "",
        os.fspath(folder),
        RESULT,
        files,
    )


def _check(task: Task, watch: Watch) -> Outcome:
    job = _job(task)
    surfaced = cut_surface(job, watch)
    figures = {**vars(report_points(surfaced)), "robot": job.cell.robot.name,
               "contact_positions": job.search.n_contact_positions,
               "description": describe_job(surfaced)}  # fmt: skip
    return _delivered(task, figures, {})


def _points(task: Task, watch: Watch) -> Outcome:
    surfaced = cut_surface(_job(task), watch)
    files = {**points_files(surfaced), **cell_file(surfaced)}
    return _delivered(task, vars(report_points(surfaced)), files)


def _verify(task: Task, watch: Watch) -> Outcome:
    proof = prove_program(_job(task), [Path(name) for name in task.programs], watch)
    message = "" if proof.proven else "\n".join(["not proven", *map(str, proof.findings)])
    return _delivered(task, proof.report, {}, message)


def _faces(task: Task, watch: Watch) -> Outcome:
    found = list_faces(Path(task.job), task.unit, CREASE)
    return _delivered(task, {"faces": [face_figures(face) for face in found]}, {})


def _job(task: Task) -> Job:
    return load_job(Path(task.job), method=task.method, changes=task.changes)


def _delivered(
    task: Task, figures: Mapping[str, Any], texts: Mapping[str, str], message: str = ""
) -> Outcome:
    whole = {**texts, FIGURES: to_json(figures) + "\n"}
    files = note_files(write_files(Path(task.out), whole))
    status, exit_status = ("not proven", 4) if message else ("ok", 0)
    return Outcome(status, exit_status, message, task.out, FIGURES, files)


_KINDS: Mapping[str, Callable[[Task, Watch], Outcome]] = {
    "run": _run, "check": _check, "points": _points, "verify": _verify, "faces": _faces,
}  # fmt: skip
