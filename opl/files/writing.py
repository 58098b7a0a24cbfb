"""Single files written whole or not at all, and folders that can be written to."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

from opl.errors import InputError

HIDDEN = ".opl-"  # how the names begin of what is there only while something is written


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


def write_file(path: Path, text: str) -> None:
    """Write one file into a folder that is there: beside its place first, then moved there.

    Line ends stay as they are. What was there stays until the new text is on the disk.

    Raises:
        InputError: If it cannot be written.
    """
    aside = path.with_name(HIDDEN + "file-" + path.name)
    try:
        try:
            write_through(aside, text.encode("utf-8"))
            os.replace(aside, path)
            sync_folder(path.parent)
        except BaseException:
            aside.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from error


def write_folder(source: Path, folder: Path) -> None:
    """Write a copy of a folder of plain files and folders, beside its place first.

    Into a folder that is there the files are put one by one.

    Raises:
        InputError: If it cannot be written.
    """
    aside = folder.with_name(HIDDEN + "folder-" + folder.name)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        try:
            shutil.rmtree(aside, ignore_errors=True)  # of an attempt that was killed
            shutil.copytree(source, aside, ignore=shutil.ignore_patterns("__pycache__"))
            if folder.is_dir():
                shutil.copytree(aside, folder, dirs_exist_ok=True)
            else:
                os.rename(aside, folder)
        finally:
            shutil.rmtree(aside, ignore_errors=True)
    except (OSError, shutil.Error) as error:
        raise InputError(str(folder), f"cannot be written: {error}") from error


def write_through(path: Path, content: bytes) -> None:
    """Write a file and wait until it is on the disk."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o666)
    try:
        left = memoryview(content)
        while left:
            left = left[os.write(file, left) :]
        os.fsync(file)
    finally:
        os.close(file)


def sync_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk."""
    opened = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(opened)
    except OSError as error:
        if error.errno != errno.EINVAL:  # a file system that has nothing to wait for
            raise
    finally:
        os.close(opened)


def unwritable(folder: Path, error: OSError) -> InputError:
    """Return what a folder that cannot be written to is refused with."""
    return InputError(str(folder), f"cannot be written to: {error.strerror}")
