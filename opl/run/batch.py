"""Jobs of a batch: which files are meant, and what became of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from opl.errors import InputError
from opl.files import documents
from opl.job import keys
from opl.run.result import Report


@dataclass(frozen=True)
class BatchRow:
    """What became of one job of a batch.

    Attributes:
        job: The job file.
        status: ``ok``, ``no_path``, ``unsafe``, ``bad input`` or ``error``.
        exit_status: What ``opl run`` would have ended with.
        folder: Where the files lie, None if there are none.
        message: Why there is no program; empty if there is one.
        result: The content of ``result.json``, None if the job was not run to its end.
        id: Of the job in the store; empty if it did not come into it.
        unchanged: Whether it was done before and is answered from the store.
        variant: Of a job of a sweep, the values that make it, by key path.
    """

    job: Path
    status: str
    exit_status: int
    folder: Path | None
    message: str
    result: Report | None
    id: str = ""
    unchanged: bool = False
    variant: Mapping[str, Any] = field(default_factory=dict)


def find_jobs(paths: Sequence[Path]) -> list[Path]:
    """Return the job files named, and for a folder every job file in and below it, sorted.

    In a folder every YAML file counts that has a key which only jobs have, or cannot be read at
    all; hidden files and folders do not. A file that is named twice counts once.

    Raises:
        InputError: If a path does not exist or a folder holds no job.
    """
    jobs: list[Path] = []
    for path in paths:
        if path.is_dir():
            found = [file for file in sorted(path.rglob("*.y*ml")) if _is_job(file, path)]
            if not found:
                raise InputError(str(path), "holds no job file (*.yaml)")
            jobs += found
        elif path.exists():
            jobs.append(path)
        else:
            raise InputError(str(path), "no such file or folder")
    unique: dict[Path, Path] = {}
    for job in jobs:
        unique.setdefault(job.resolve(), job)
    return list(unique.values())


def _is_job(path: Path, folder: Path) -> bool:
    hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
    if hidden or path.suffix not in (".yaml", ".yml") or not path.is_file():
        return False
    try:
        return not keys.OF_A_JOB.isdisjoint(documents.keys(path))
    except InputError:
        return True  # loading it says what is wrong
