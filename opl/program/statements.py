"""Programs of RAPID, KRL, FANUC and UR as statements, one a line, and what is doubtful about them.

A reader knows the statements that opl writes and no others. Whatever else stands in a file could
change where the robot goes, so it is a doubt, never passed over: a program with doubts is not
proven.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from opl.errors import InputError
from opl.findings import Finding, Level
from opl.program.events import Event, same_number
from opl.program.played import ReadMove

NUMBER = r"[-+]?(?:[0-9]{1,9}(?:\.[0-9]{0,15})?|\.[0-9]{1,15})(?:[eE][-+]?[0-9]{1,2})?"


@dataclass(frozen=True)
class Statement:
    """A line that says something.

    Attributes:
        line: Line number, counted from 1.
        text: Without comments and outer spaces.
        move: The move it is, None for another statement.
        meaning: What it says in a form that does not change with spaces and numbers of points.
    """

    line: int
    text: str
    move: ReadMove | None
    meaning: str


@dataclass(frozen=True)
class Listing:
    """A program as its text gives it.

    Attributes:
        name: Its name on the controller.
        statements: In order, comments left out.
        events: What it does besides moving, in order.
        calls: Names of the programs it calls, with the place of the call.
        doubts: What cannot be followed.
        data: What it declares of tools and loads, with the place of each.
    """

    name: str
    statements: tuple[Statement, ...]
    events: tuple[Event, ...]
    calls: tuple[tuple[str, str], ...]
    doubts: tuple[Finding, ...]
    data: tuple[tuple[str, str], ...] = ()

    @property
    def moves(self) -> tuple[ReadMove, ...]:
        """The moves in order."""
        return tuple(one.move for one in self.statements if one.move is not None)


@dataclass(frozen=True)
class Words:
    """The statements of a language that neither move the robot nor set how it moves.

    Attributes:
        passing: Those that the robot does not stand still for.
        waits: Those at which it stands still.
        opens: What opens a block that may be left out or repeated.
        closes: What closes it.
        call: A call of another program, its name the first group.
    """

    passing: re.Pattern[str]
    waits: re.Pattern[str]
    opens: re.Pattern[str]
    closes: re.Pattern[str]
    call: re.Pattern[str]


@dataclass
class Notes:
    """A listing being made.

    Attributes:
        source: File, for people.
        words: Of the language.
        name: The program's name, "" until it is known.
    """

    source: str
    words: Words
    name: str = ""
    _statements: list[Statement] = field(default_factory=list)
    _events: list[Event] = field(default_factory=list)
    _calls: list[tuple[str, str]] = field(default_factory=list)
    _doubts: list[Finding] = field(default_factory=list)
    _data: list[tuple[str, str]] = field(default_factory=list)
    _depth: int = 0
    _last_move: int = -1  # counted from 0

    def place(self, line: int) -> str:
        """Return file and line, for people."""
        return f"{self.source} line {line}"

    def doubt(self, line: int, message: str) -> None:
        """Note what cannot be followed."""
        self._doubts.append(Finding(Level.ERROR, "program", self.place(line), message))

    def declaration(self, line: int, code: str) -> None:
        """Note what is declared of a tool or a load."""
        self._data.append((self.place(line), code))
        self._note(line, code, None, code)

    def setting(self, line: int, code: str) -> None:
        """Note a statement that sets how the robot moves."""
        if self._depth:
            self.doubt(line, f"{code} stands in a block that may be left out or repeated")
        self._note(line, code, None, code)

    def move(self, line: int, code: str, move: ReadMove, meaning: str | None = None) -> None:
        """Note a move."""
        if self._depth:
            self.doubt(line, "moves in a block that may be left out or repeated")
        move = replace(move, starts=not self.begun)
        self._last_move += 1
        self._note(line, code, move, meaning or code)

    def event(self, line: int, code: str, waits: bool = False) -> None:
        """Note what the program does besides moving, and whether the robot stands still for it."""
        self._events.append(Event(self._last_move, code, self.place(line), waits))
        self._note(line, code, None, code)

    def other(self, line: int, code: str) -> None:
        """Note a statement that is none of a language's moves and settings."""
        words, waits = self.words, False
        if words.opens.fullmatch(code):
            self._depth += 1
        elif words.closes.fullmatch(code):
            self._depth -= 1
            if self._depth < 0:
                self.doubt(line, f"{code} closes nothing")
        elif words.waits.fullmatch(code):
            waits = True
        elif words.passing.fullmatch(code):
            pass
        elif called := words.call.fullmatch(code):
            if self._depth:
                self.doubt(line, "calls in a block that may be left out or repeated")
            waits = True
            self._calls.append((called[1], self.place(line)))
        else:
            self.doubt(line, f"nobody can tell from the file what {code} leads to")
        self.event(line, code, waits)

    @property
    def inside_block(self) -> bool:
        """Whether a block is open."""
        return self._depth > 0

    @property
    def begun(self) -> bool:
        """Whether there was a move."""
        return self._last_move >= 0

    def listing(self, line: int) -> Listing:
        """Return the listing, the last line given for what is missing at the end."""
        if self._depth > 0:
            self.doubt(line, "a block is not closed")
        if not self.name:
            raise InputError(self.source, "is no program: it has no name")
        return Listing(
            self.name,
            tuple(self._statements),
            tuple(self._events),
            tuple(self._calls),
            tuple(self._doubts),
            tuple(self._data),
        )

    def _note(self, line: int, code: str, move: ReadMove | None, meaning: str) -> None:
        self._statements.append(Statement(line, code, move, same_number(meaning)))


def code_lines(text: str, comment: str) -> Iterator[tuple[int, str]]:
    """Give number and code of each line that holds some, comments and outer spaces left out.

    Args:
        text: Of a file.
        comment: The sign that opens a comment; between quotes it opens none.
    """
    code = re.compile(rf'((?:[^"{re.escape(comment)}]|"[^"]*"?)*)')
    for number, line in enumerate(text.split("\n"), start=1):
        found = code.match(line)
        assert found is not None
        if found[1].strip():
            yield number, " ".join(found[1].split())


def read_enclosed(
    notes: Notes,
    text: str,
    comment: str,
    begin: re.Pattern[str],
    end: re.Pattern[str],
    statement: Callable[[int, str], None],
) -> Listing:
    """Return a program whose statements stand between a line that names it and one that ends it.

    Args:
        notes: Of the file.
        text: Of the file.
        comment: The sign that opens a comment.
        begin: The first line, the name its first group.
        end: The last line.
        statement: Notes a statement, given its line number and code.

    Raises:
        InputError: If the file holds no program.
    """
    ended, line = False, 0
    for line, code in code_lines(text, comment):
        if (found := begin.fullmatch(code)) and not notes.name:
            notes.name = found[1]
        elif ended or not notes.name:
            notes.doubt(line, f"{code} stands outside of the program")
        elif end.fullmatch(code) and not notes.inside_block:
            ended = True
        else:
            statement(line, code)
    if not ended:
        notes.doubt(line, "the program does not end")
    return notes.listing(line)
