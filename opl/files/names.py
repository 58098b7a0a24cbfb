"""Names of files that strangers hand in: relative, plain, and below the folder they are put in."""

from __future__ import annotations

import re

from opl.errors import InputError

MOST_PARTS, LONGEST_PART, LONGEST = 8, 100, 240
_PLAIN = re.compile(r"[^\x00-\x1f\x7f/\\:*?\"<>|]+")


def checked_name(name: str) -> str:
    """Return a relative name as it is.

    Raises:
        InputError: If it could mean anything but a file below the folder it starts in.
    """
    shown = name if len(name) <= 60 else name[:57] + "..."
    parts = name.split("/")
    if name.startswith("/") or re.match(r"[A-Za-z]:", name) or "\\" in name:
        fault = "must be relative, with / between folders"
    elif ".." in parts or "." in parts:
        fault = "must not lead out of its folder: no . or .. in it"
    elif len(parts) > MOST_PARTS or len(name) > LONGEST:
        fault = f"must have at most {MOST_PARTS - 1} folders and {LONGEST} characters"
    elif not all(_PLAIN.fullmatch(part) and len(part) <= LONGEST_PART for part in parts):
        fault = "must be made of printable characters, each part of 1 to 100"
    elif any(part.startswith(".") or part != part.strip() for part in parts):
        fault = "must have no part that begins with a point, or begins or ends with a space"
    elif not _encodes(name):
        fault = "must be text in UTF-8"
    else:
        return name
    raise InputError(f"file {shown!r}", fault)


def _encodes(name: str) -> bool:
    try:
        name.encode("utf-8")
        return True
    except UnicodeEncodeError:
        return False
