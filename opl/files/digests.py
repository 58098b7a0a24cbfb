"""SHA-256 digests of bytes, and texts that hold their own.

A text cannot hold the digest of all its bytes, but that of itself with zeros in its place.
"""

from __future__ import annotations

import hashlib
import re

STAMP = "FILE " + 16 * "0"  # where a text shall hold its own digest
_STAMP = re.compile(r"FILE ([0-9A-F]{16})\b")


def digest(content: bytes) -> str:
    """Return the SHA-256 of bytes in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def short(whole: str) -> str:
    """Return the first 16 of the digits of a digest, in capitals."""
    return whole[:16].upper()


def stamped(text: str) -> str:
    """Return a text with its own digest instead of each `STAMP`; as it is without one."""
    return text.replace(STAMP, "FILE " + short(digest(text.encode("utf-8"))))


def keeps_stamp(content: bytes) -> bool | None:
    """Return whether a text is to the byte what was stamped; None if it holds no stamp."""
    text = content.decode("utf-8", errors="replace")
    found = _STAMP.search(text)
    if found is None:
        return None
    bare = text.replace(found[0], STAMP)
    return short(digest(bare.encode("utf-8"))) == found[1]
