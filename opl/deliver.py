"""What a run leaves in its folder: files that appear whole or not at all."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from opl.errors import InputError
from opl.outcome import Outcome
from opl.result import render

RESULT = "result.json"


def check_folder(folder: Path) -> None:
    """See before the work whether its files can be written; makes nothing.

    Raises:
        InputError: If the folder is something else, or cannot be made or written to.
    """
    existing = folder.absolute()
    while not os.path.lexists(existing):
        existing = existing.parent
    if not existing.is_dir():
        raise InputError(str(existing), "must be a folder for the files, is something else")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise InputError(str(existing), "is a folder that cannot be written to")


def deliver(outcome: Outcome, folder: Path) -> list[Path]:
    """Write the files of a run and its ``result.json`` into a folder, which is made if needed.

    Program files that an earlier run left there are taken away: a folder never holds a program that
    its ``result.json`` does not vouch for.

    Raises:
        InputError: If the folder cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in _files_of_earlier_run(folder) - outcome.files.keys():
            (folder / name).unlink(missing_ok=True)
        # only now: if this run is cut short, the next one still knows what the earlier one left
        (folder / RESULT).unlink(missing_ok=True)
        # the result last: it vouches for the others
        return _write(folder, {**outcome.files, RESULT: render(outcome)})
    except OSError as error:
        raise InputError(str(folder), f"cannot be written to: {error.strerror}") from error


def write_texts(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write files by name into a folder, which is made if needed; all of them or none.

    Raises:
        InputError: If the folder cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _write(folder, texts)
    except OSError as error:
        raise InputError(str(folder), f"cannot be written to: {error.strerror}") from error


def _files_of_earlier_run(folder: Path) -> set[str]:
    try:
        program = json.loads((folder / RESULT).read_text(encoding="utf-8"))["program"]
        names = set(program["files"]) if program else set()
    except (OSError, ValueError, KeyError, TypeError):
        return set()
    return {name for name in names if Path(name).name == name}


def _write(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write all texts beside their places first, then move them there one after the other."""
    with tempfile.TemporaryDirectory(dir=folder, prefix=".writing-") as waiting:
        for name, text in texts.items():
            # as bytes: line ends stay as they are
            (Path(waiting) / name).write_bytes(text.encode("utf-8"))
        for name in texts:
            os.replace(Path(waiting) / name, folder / name)
    return [folder / name for name in texts]
