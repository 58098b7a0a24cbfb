"""Whether files are to the byte those that a run proved: their digests stand in its result.json.

A pulse is some hundredths of a millimetre at the part: changed by one, a program grinds as well as
before, and a proof of what it says holds. That somebody changed it is seen from its bytes alone.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping

from opl.files.digests import digest, short
from opl.findings import Finding, Level
from opl.version import VERSION

_MARK = re.compile(rb"INPUTS ([0-9A-F]{16})\b")


def inputs_mark(inputs: Mapping[str, str]) -> str:
    """Return the line that tells in a program what it was made of and with, given the digests."""
    return f"INPUTS {short(digest(json.dumps([VERSION, dict(inputs)]).encode()))}"


def other_inputs(
    content: bytes, inputs: Mapping[str, str], result: Mapping[str, object] | None
) -> list[str] | None:
    """Return which inputs are not those of a program, by name; None if nothing tells.

    Args:
        content: Of the program.
        inputs: The digests of the inputs.
        result: The result.json beside it, None without one that vouches for it.
    """
    recorded = None if result is None else result.get("inputs")
    if isinstance(recorded, dict) and result is not None:
        changed = [
            name for name in {**recorded, **inputs} if recorded.get(name) != inputs.get(name)
        ]
        return sorted(changed) + (["opl"] if result.get("opl") != VERSION else [])
    marks = {found.decode() for found in _MARK.findall(content)}
    if not marks:
        return None
    return [] if marks == {inputs_mark(inputs).split()[1]} else ["unknown which"]


def read_result(content: bytes) -> dict[str, object]:
    """Return what a result.json says, nothing if it is none."""
    try:
        result = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    return result if isinstance(result, dict) else {}


def digests_in(result: Mapping[str, object]) -> dict[str, str]:
    """Return the digests of files in a result.json, by their names; none if it has none."""
    program = result.get("program")
    digests = program.get("sha256") if isinstance(program, dict) else None
    return dict(digests) if isinstance(digests, dict) else {}


def changed_since(name: str, content: bytes, proven: Collection[str]) -> list[Finding]:
    """Return a finding if the digest of a file is none of the proven ones, whatever its name is."""
    if digest(content) in proven:
        return []
    message = (
        "not the bytes that opl run proved, says the result.json beside it; whoever changed it on "
        "purpose verifies it in a folder of its own"
    )
    return [Finding(Level.ERROR, "file", name, message)]
