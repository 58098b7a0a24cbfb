"""Names of programs that a controller takes: legal in length, unique, the same in every run."""

from __future__ import annotations

import hashlib

_LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_MARK_LENGTH = 3


def short_name(name: str, length: int) -> str:
    """Return a name of at most ``length`` characters.

    A name that is too long is cut, and ends in a mark computed from the whole of it: two long names
    with the same beginning would else be one, and the later program overwrite the earlier.
    """
    if len(name) <= length:
        return name
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    mark = ""
    for _ in range(_MARK_LENGTH):
        number, digit = divmod(number, len(_LETTERS))
        mark += _LETTERS[digit]
    return name[: length - _MARK_LENGTH] + mark


def numbered_names(name: str, count: int, length: int) -> list[str]:
    """Return the names of the parts of a program: its own, shortened if need be, and a number."""
    digits = max(2, len(str(count)))
    stem = short_name(name, length - digits)
    return [f"{stem}{number:0{digits}d}" for number in range(1, count + 1)]
