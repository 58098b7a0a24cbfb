"""Files that strangers hand in, read up to a size; nothing but files is opened to its end."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from opl.errors import InputError
from opl.files.confining import require_inside

MB = 1_000_000


def read_bytes(path: Path, most: int) -> bytes:
    """Return what is in a file.

    Args:
        path: The file; a pipe or a device would never end, and is refused.
        most: Size in bytes above which it is refused.

    Raises:
        InputError: If it cannot be read, is no file or too large, or lies outside of what may be
            read.
    """
    require_inside(path)
    try:
        opened = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(opened, "rb") as file:
            status = os.fstat(opened)
            if not stat.S_ISREG(status.st_mode):
                reason = "Is a directory" if stat.S_ISDIR(status.st_mode) else "Is not a file"
                raise InputError(str(path), f"cannot be read: {reason}")
            content = file.read(most + 1)
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error
    except ValueError as error:  # a name with a zero in it
        raise InputError(str(path), f"cannot be read: {error}") from error
    if len(content) > most:
        raise InputError(str(path), f"is larger than {most / MB:g} MB, which no such file is")
    return content


def read_text(path: Path, most: int) -> str:
    """Return the text of a file in UTF-8, without the mark that some editors put before it.

    Raises:
        InputError: If it cannot be read, is too large or no such text.
    """
    try:
        return read_bytes(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(str(path), "is not text in UTF-8") from error
