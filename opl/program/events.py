"""What a program does besides moving, as its files say it: outputs, waits, timers, calls, jumps.

Two texts mean the same if they differ in spaces, in capitals, in zeros behind a decimal point or in
the numbers of labels alone. Everything else counts: between two moves of a proven program stands
what the job asks for there, in its order, and nothing else.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

_DECIMAL = re.compile(r"(?<![\w.])([-+]?[0-9]+)\.([0-9]+)(?![\w.])")
# The labels of INFORM and of FANUC TP; the other languages have none that opl writes or reads.
_LABEL = re.compile(r"(?<!\w)\*\w+|LBL\[[0-9]+\]")


@dataclass(frozen=True)
class Event:
    """An instruction that neither moves the robot nor sets how it moves.

    Attributes:
        after: Index of the move after which it stands, -1 before the first one.
        text: As written.
        place: File and line, for people.
        waits: Whether the robot stands still for it.
    """

    after: int
    text: str
    place: str
    waits: bool


def meanings(texts: Iterable[str]) -> list[str]:
    """Return texts that stand between two moves in a form that only differs where meaning does."""
    numbers: dict[str, int] = {}

    def renamed(found: re.Match[str]) -> str:
        return f"*{numbers.setdefault(found[0], len(numbers) + 1)}"

    plain = (same_number(_LABEL.sub(renamed, text)) for text in texts)
    return ["".join(text.split()).casefold() for text in plain]


def same_number(text: str) -> str:
    """Return a text with its decimal numbers as short as they can be."""
    return _DECIMAL.sub(lambda m: f"{m[1]}.{m[2]}".rstrip("0").rstrip("."), text)
