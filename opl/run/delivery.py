"""What a run leaves in its folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from opl.errors import InputError
from opl.files.claiming import Claim, claimed
from opl.files.reading import MB, read_text
from opl.run.page import run_page
from opl.run.reporting import make_report
from opl.run.result import PAGE, RESULT, to_json
from opl.run.values import Refused, Written

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


def deliver(run: Written | Refused, folder: Path | Claim) -> list[Path]:
    """Put the files of a run, its page and its ``result.json`` into a folder, in one step.

    Program files that an earlier run of the job left there go in the same step: a folder never
    holds a program that its ``result.json`` does not describe. A refused run leaves its page and
    ``result.json`` only. All other files stay. What one step is, and where it can only be one file
    after the other with ``result.json`` last, `opl.files.switching` says.

    Args:
        run: The run.
        folder: The folder, which is made if needed, or one that `claim_folder` holds.

    Returns:
        The files, ``result.json`` last.

    Raises:
        InputError: If another run holds the folder, it cannot be written to, or it belongs to
            another job.
    """
    if isinstance(folder, Path):
        with claim_folder(folder, run.surfaced.job.name) as claim:
            return deliver(run, claim)
    files = run.contents if isinstance(run, Written) else {}
    leaving = _files_of(_earlier_result(folder.folder)) - files.keys()
    report = make_report(run)
    # the result last: it describes the others
    whole: dict[str, str | bytes] = {
        **files,
        PAGE: run_page(run, report),
        RESULT: to_json(report) + "\n",
    }
    return folder.switch(whole, leaving)


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
