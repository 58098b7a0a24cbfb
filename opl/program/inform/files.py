"""Job files on disk: bytes in whatever encoding they were saved, and back the same."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from opl.errors import InputError
from opl.findings import Finding, Level
from opl.program.controller import ControllerProfile
from opl.program.inform.check import find_faults
from opl.program.inform.job import InformJob
from opl.program.inform.parse import read_jobs, unparse

# Controllers save ASCII and Shift-JIS; copies in repositories are UTF-8. The last takes any byte.
_ENCODINGS = ("ascii", "utf-8", "cp932", "latin-1")


def decode(data: bytes) -> tuple[str, str]:
    """Return the text of a job file and its encoding, which gives the same bytes again."""
    for encoding in _ENCODINGS:
        try:
            text = data.decode(encoding)
            if text.encode(encoding) == data:
                return text, encoding
        except UnicodeError:
            continue
    raise AssertionError("latin-1 takes any byte")


def load_jobs(path: Path) -> tuple[InformJob, ...]:
    """Read the jobs of a file.

    Raises:
        InputError: If it cannot be read, or holds what is no job.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error
    text, _ = decode(data)
    return read_jobs(text, str(path))


def program_jobs(
    files: Mapping[str, bytes], profile: ControllerProfile
) -> tuple[dict[str, InformJob], list[Finding]]:
    """Return the jobs of a program by name, and what a controller would refuse of its files.

    Args:
        files: Content by what messages call the file.
        profile: The controller.

    Raises:
        InputError: If a file holds what is no job, or two jobs have one name.
    """
    jobs: dict[str, InformJob] = {}
    found: list[Finding] = []
    for source, data in files.items():
        text, _ = decode(data)
        several = read_jobs(text, source)
        for job in several:
            if job.name in jobs:
                raise InputError(source, f"a job {job.name} was given before")
            jobs[job.name] = job
            faults = find_faults(text if len(several) == 1 else unparse(job), profile)
            found += [Finding(Level.ERROR, "file", source, fault) for fault in faults]
    return jobs, found
