"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from opl.errors import InputError


def check_folder(folder: Path) -> None:
    """Check, before long work, that its files can be written to a folder; makes nothing.

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


def write_files(folder: Path, texts: Mapping[str, str]) -> list[Path]:
    """Write texts by file name into a folder, which is made if needed; all of them or none.

    Line ends stay as they are.

    Raises:
        InputError: If the folder cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # all beside their places first, then moved there one after the other
        with tempfile.TemporaryDirectory(dir=folder, prefix=".writing-") as waiting:
            for name, text in texts.items():
                (Path(waiting) / name).write_bytes(text.encode("utf-8"))
            for name in texts:
                os.replace(Path(waiting) / name, folder / name)
    except OSError as error:
        raise InputError(str(folder), f"cannot be written to: {error.strerror}") from error
    return [folder / name for name in texts]


def write_file(path: Path, text: str) -> None:
    """Write one file into a folder that is there.

    Raises:
        InputError: If it cannot be written.
    """
    try:
        path.write_bytes(text.encode("utf-8"))
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from error
