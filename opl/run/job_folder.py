"""The folder of one job: claimed before the work, and changed in one step."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from opl.errors import InputError
from opl.files.claiming import Claim, claimed
from opl.files.reading import MB, read_text
from opl.run.result import RESULT

MOST_RESULT = 20 * MB


@contextmanager
def claim_folder(folder: Path, job_name: str) -> Iterator[Claim]:
    """Claim a folder for the run of a job, before long work; it is made if needed.

    No other run writes to it meanwhile. What a run that was killed left half way is put in order.

    Raises:
        InputError: If another run holds the folder, it cannot be written to, or its
            ``result.json`` says that it belongs to another job.
    """
    with claimed(folder) as claim:
        owner = _earlier_result(folder).get("job")
        if isinstance(owner, str) and owner != job_name:
            message = (
                f"belongs to job {owner}, says its {RESULT}: name another folder for job "
                f"{job_name}, or remove the files of {owner} first"
            )
            raise InputError(str(folder), message)
        yield claim


def put_files(claim: Claim, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Put all that a run made into its folder in one step; what an earlier run left goes with it.

    Program files of an earlier run leave: a folder never holds a program that its ``result.json``
    does not describe. All other files stay. What one step is, and where it can only be one file
    after the other with ``result.json`` last, `opl.files.switching` says.

    Args:
        claim: The folder.
        contents: Texts or bytes by name, ``result.json`` last: it describes the others.

    Returns:
        The files, in this order.

    Raises:
        InputError: If the folder cannot be written to.
    """
    return claim.switch(contents, _files_of(_earlier_result(claim.folder)) - contents.keys())


def _earlier_result(folder: Path) -> dict[str, Any]:
    try:
        found = json.loads(read_text(folder / RESULT, MOST_RESULT))
    except (InputError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _files_of(result: dict[str, Any]) -> set[str]:
    """Return the names of the files that a run wrote; none that is outside of its folder."""
    program = result.get("program")
    names = program.get("files") if isinstance(program, dict) else None
    if not isinstance(names, list):
        return set()
    return {
        name
        for name in names
        if isinstance(name, str) and Path(name).name == name and not name.startswith(".")
    }
