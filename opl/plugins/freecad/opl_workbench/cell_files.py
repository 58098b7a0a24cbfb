"""A cell file and the files that it names, to be kept in the document."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from .keeping import keep

MOST_BYTES = 50_000_000
CELL = "cell/"  # folder of the cell among the files of a job


def take_cell(job: Any, path: str) -> None:
    """Take a cell file, with what it names, into the document of a job; no path: give it up.

    Raises:
        ValueError: If the file cannot be read.
    """
    keep(job, "CellKept", read_cell(path) if path else {})
    job.CellFile = path


def read_cell(path: str) -> dict[str, bytes]:
    """Return a cell file, and all files of its folder that it mentions, by their names in a job.

    A folder that it mentions, as that of a robot of one's own, comes whole.

    Raises:
        ValueError: If the file cannot be read.
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
        found = {CELL + file.name: text.encode("utf-8")}
        for other in sorted(file.parent.rglob("*")):
            name = other.relative_to(file.parent)
            mentioned = (str(name.as_posix()), *(str(above) for above in list(name.parents)[:-1]))
            if other.is_file() and other != file and any(_names(text, one) for one in mentioned):
                found[CELL + name.as_posix()] = other.read_bytes()
    except (OSError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from error
    if sum(map(len, found.values())) > MOST_BYTES:
        raise ValueError(f"{path}: with what it names it has more than {MOST_BYTES} bytes")
    return found


def _names(text: str, name: str) -> bool:
    return re.search(rf"(?<![\w./-]){re.escape(name)}(?![\w/-])", text) is not None
