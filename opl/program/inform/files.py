"""Job files on disk: bytes in whatever encoding they were saved, and back the same."""

from __future__ import annotations

from pathlib import Path

from opl.errors import InputError
from opl.program.inform.job import InformJob
from opl.program.inform.parse import read_jobs

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
