"""What an INFORM job holds, as read from a file. Lines are counted from 1."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

# Kinds of positions, in the order ///NPOS counts them: taught robot, base and station positions,
# then robot, base and station position variables.
POSITION_KINDS = ("C", "BC", "EC", "P", "BP", "EX")
# Those of the arm itself.
ROBOT_KINDS = ("C", "P")

_MOVE = re.compile(r"(?:S|I|X|EI)?MOV[A-Z]*")
_LABEL = re.compile(r"(BC|EC|BP|EX|C|P)([0-9]{1,9})")


def read_label(label: str) -> tuple[str, int] | None:
    """Return kind and number of a position label, None if the text is no label.

    Numbers, not texts, identify positions: the list of positions may say ``P00091`` where the
    instructions say ``P091``.
    """
    match = _LABEL.fullmatch(label)
    return (match[1], int(match[2])) if match else None


@dataclass(frozen=True)
class Header:
    """A line that opens a section or sets something, e.g. ``///TOOL 0``.

    Attributes:
        line: Line number.
        key: First word with its slashes, e.g. ``///TOOL``.
        value: The rest of the line.
    """

    line: int
    key: str
    value: str


@dataclass(frozen=True)
class Position:
    """A position, with the headers in force where it stands.

    Attributes:
        line: Line number.
        label: As in the file, e.g. ``C00000``.
        kind: One of `POSITION_KINDS`.
        number: The number in the label.
        values: Pulses, or lengths in [mm] and angles in [deg], by `coordinates`.
        coordinates: ``PULSE``, ``RECTAN``, ``ANGLE``, or "" where the file does not say and the
            values are not whole numbers, which are pulses.
        frame: ``PULSE``, ``ANGLE``, ``BASE``, ``ROBOT``, ``USER``, ``TOOL``, ``MTOOL``, or "".
        tool: Tool number, None where the file does not say.
        user: User frame number, None where the file does not say.
        rconf: The numbers of ///RCONF, empty where the file does not say.
    """

    line: int
    label: str
    kind: str
    number: int
    values: tuple[float, ...]
    coordinates: str
    frame: str
    tool: int | None
    user: int | None
    rconf: tuple[int, ...]


@dataclass(frozen=True)
class Instruction:
    """A line between NOP and END.

    Attributes:
        line: Line number.
        word: First word, e.g. ``MOVJ`` or ``*LABEL``; ``'`` for a comment line.
        operands: The other words that have no ``=``, e.g. ``C00000``.
        tags: The words that have one, split there, e.g. ``("VJ", "50.00")``.
        comment: Text of a comment line or after ``//``, None without one.
        disabled: Whether the instruction is commented out by COMM.
        coupled: Moves of other groups on the same line, each opened by ``+``.
        rest: All words after the first as they stand, those of coupled moves left out.
    """

    line: int
    word: str
    operands: tuple[str, ...] = ()
    tags: tuple[tuple[str, str], ...] = ()
    comment: str | None = None
    disabled: bool = False
    coupled: tuple[Instruction, ...] = ()
    rest: tuple[str, ...] = ()

    @property
    def moves(self) -> bool:
        """Whether the robot moves: MOVJ, MOVL, MOVC, MOVS and their S, I and EI forms."""
        return _MOVE.fullmatch(self.word) is not None and not self.disabled

    @property
    def positions(self) -> tuple[tuple[str, int], ...]:
        """Kind and number of each position the line names, coupled moves included."""
        own = [label for label in map(read_label, self.operands) if label]
        return (*own, *(label for move in self.coupled for label in move.positions))

    def tag(self, name: str) -> str | None:
        """Return the text behind ``name=``, None without one."""
        return dict(self.tags).get(name)


@dataclass(frozen=True)
class InformJob:
    """A job, every line of it.

    Attributes:
        lines: The file, one text a line, without line ends.
        name: Job name.
        npos: The counts of ///NPOS, empty without one.
        headers: Header lines, known or not, in order.
        positions: Positions in order.
        instructions: Lines between NOP and END in order.
        aliases: Lines of the section //ALIAS, names that instructions may use for variables.
    """

    lines: tuple[str, ...]
    name: str
    npos: tuple[int, ...]
    headers: tuple[Header, ...]
    positions: tuple[Position, ...]
    instructions: tuple[Instruction, ...]
    aliases: tuple[str, ...] = ()

    @property
    def moves(self) -> tuple[Instruction, ...]:
        """Instructions that move the robot, in order."""
        return tuple(step for step in self.instructions if step.moves)

    @property
    def calls(self) -> tuple[str, ...]:
        """Names of the jobs called, in order."""
        return tuple(
            step.operands[0].removeprefix("JOB:")
            for step in self.instructions
            if step.word == "CALL" and step.operands and not step.disabled
        )

    def values(self, key: str) -> Iterator[str]:
        """Give the value of each header with this key, in order."""
        return (header.value for header in self.headers if header.key == key)
