"""Whether files are to the byte those that a run proved: their digests stand in its result.json.

A pulse is some hundredths of a millimetre at the part: changed by one, a program grinds as well as
before, and a proof of what it says holds. That somebody changed it is seen from its bytes alone.
"""

from __future__ import annotations

import hashlib
import json

from opl.findings import Finding, Level


def digest(content: bytes) -> str:
    """Return the SHA-256 of bytes in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def digests_in(result: bytes) -> dict[str, str]:
    """Return the digests in a result.json, by file name; none if it is not one."""
    try:
        digests = json.loads(result)["program"]["sha256"]
    except (ValueError, KeyError, TypeError, RecursionError):
        return {}
    return dict(digests) if isinstance(digests, dict) else {}


def changed_since(name: str, content: bytes, proven: str) -> list[Finding]:
    """Return a finding if the digest of bytes is not that of the proven ones."""
    if digest(content) == proven:
        return []
    message = (
        "not the bytes that opl run proved, says the result.json beside it; whoever changed it on "
        "purpose verifies it in a folder of its own"
    )
    return [Finding(Level.ERROR, "file", name, message)]
