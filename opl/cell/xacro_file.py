"""Xacro files expanded to URDFs. Needs the optional extra ``opl[xacro]``."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from xml.parsers.expat import ExpatError

from opl.errors import InputError
from opl.files.apart import apart
from opl.files.reading import MB, read_bytes

SUFFIX = ".xacro"
_BY_HAND = "or expand it by hand: xacro {name} ARGUMENT:=VALUE > arm.urdf"


def expand(path: Path) -> str:
    """Return the URDF that a xacro file makes with the defaults of its arguments.

    Raises:
        InputError: If the extra is missing, or xacro refuses the file; names the file to blame,
            which may be an included one, and the line where that can be found.
    """
    by_hand = _BY_HAND.format(name=path.name)
    if find_spec("xacro") is None:
        message = f"needs the optional extra for xacro: pip install 'opl[xacro]', {by_hand}"
        raise InputError(str(path), message)
    # the expressions in a xacro are programs
    return apart(_expanded, path, by_hand, about=str(path))


def _expanded(path: Path, by_hand: str) -> str:
    import xacro

    try:
        return str(xacro.process_file(str(path)).toxml())
    except ExpatError as error:
        raise InputError(_blamed(xacro.filestack, path), f"is not XML: {error}") from error
    except Exception as error:  # whatever the expressions in the file raise
        reason = " ".join(str(error).split())
        blamed = _blamed(xacro.filestack, path)
        line = _line_of(Path(blamed), reason)
        place = "" if line is None else f"line {line}: "
        if "ament_index" in reason:
            reason = f"$(find ...) needs a ROS package, and there is no ROS here; {by_hand}"
        elif reason.startswith("Undefined substitution argument"):
            reason = f"{reason}: give it a default, {by_hand}"
        raise InputError(blamed, f"xacro refuses it: {place}{reason}") from error


def _blamed(files: list[str] | None, path: Path) -> str:
    """Return the file that was being read, the innermost of those that include each other."""
    return str(path) if not files or files[-1] is None else str(files[-1])


def _line_of(path: Path, reason: str) -> int | None:
    """Return the line that an error is about: xacro names what failed, but not where."""
    clues = [
        (r"evaluating expression '(.*)'$", r"\$\{{\s*{}\s*\}}"),
        (r"unknown macro name: (\S+)", r"<{}[\s/>]"),
        (r"Undefined substitution argument (\w+)", r"\$\(arg\s+{}\s*\)"),
        (r"ament_index", r"\$\(find\s"),
        (r"No such file or directory: .*?([^/ ]+) \[", r"<xacro:include[^>]*{}"),
    ]
    lines = read_bytes(path, MB).decode("utf-8", "replace").splitlines()
    for clue, pattern in clues:
        found = re.search(clue, reason)
        if found is None:
            continue
        wanted = pattern.format(*map(re.escape, found.groups())) if found.groups() else pattern
        for number, line in enumerate(lines, start=1):
            if re.search(wanted, line):
                return number
    return None
