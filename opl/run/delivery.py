"""What a run leaves in its folder."""

from __future__ import annotations

import json
from pathlib import Path

from opl.errors import InputError
from opl.files.writing import write_files
from opl.run.reporting import make_report
from opl.run.result import to_json
from opl.run.values import Refused, Written

RESULT = "result.json"


def deliver(run: Written | Refused, folder: Path) -> list[Path]:
    """Write the files of a run and its ``result.json`` into a folder, which is made if needed.

    Files appear whole or not at all. Program files that an earlier run left there are removed: a
    folder never holds a program that its ``result.json`` does not describe. A refused run leaves
    its ``result.json`` only.

    Returns:
        The files, ``result.json`` last.

    Raises:
        InputError: If the folder cannot be written to.
    """
    files = run.files if isinstance(run, Written) else {}
    try:
        for name in _files_of_earlier_run(folder) - files.keys():
            (folder / name).unlink(missing_ok=True)
        # only now: if this run is cut short, the next one still knows what the earlier one left
        (folder / RESULT).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(str(folder), f"cannot be written to: {error.strerror}") from error
    # the result last: it describes the others
    return write_files(folder, {**files, RESULT: to_json(make_report(run)) + "\n"})


def _files_of_earlier_run(folder: Path) -> set[str]:
    try:
        program = json.loads((folder / RESULT).read_text(encoding="utf-8"))["program"]
        names = set(program["files"]) if program else set()
    except (OSError, ValueError, KeyError, TypeError):
        return set()
    return {name for name in names if Path(name).name == name}
