"""Reading FANUC TP programs as text: J and L moves to positions given as joint angles.

In a user frame the program has a tool that stands at its origin, and every L move has to say so
(RTCP); user frame 0 has none. How far CNT cuts off corners is not
known in millimetres.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from opl.program.fanuc.rounding import DECIMALS, from_fanuc
from opl.program.moves import START_SPEED
from opl.program.played import Corner, Corners, ReadMove, SpeedUnit, WrittenSpeed
from opl.program.statements import NUMBER, Listing, Notes, Words, code_lines

_STATE = "(?:ON|OFF)"
_WORDS = Words(
    passing=re.compile(rf"DO\[[0-9]+\] ?= ?{_STATE}|\$WAITTMOUT ?= ?[0-9]+"),
    waits=re.compile(
        rf"WAIT {NUMBER} ?\(sec\)|WAIT DI\[[0-9]+\] ?= ?{_STATE}(?: TIMEOUT, ?LBL\[[0-9]+\])?|PAUSE"
    ),
    # no blocks: what may be left out or repeated lies between labels and jumps
    opens=re.compile(r"(?!)"),
    closes=re.compile(r"(?!)"),
    call=re.compile(r"CALL (\w+)"),
)
_LABEL = re.compile(r"LBL\[([0-9]+)\]")
_JUMP = re.compile(r"(?:JMP |WAIT .*TIMEOUT, ?)LBL\[([0-9]+)\]")
_SETTING = re.compile(r"(UFRAME_NUM|UTOOL_NUM) ?= ?([0-9]+)")
_MOVE = re.compile(r"([JL]) ?P\[([0-9]+)\] ([0-9]+)(%|msec|mm/sec) (FINE|CNT[0-9]+)( RTCP)?")
_NUMBERED = re.compile(r"[0-9]+:(.*);")
_POSITION = re.compile(
    r"P\[([0-9]+)\]\{GP1:UF:([0-9]+),UT:([0-9]+),"
    + ",".join(rf"J{axis}=({NUMBER})deg" for axis in range(1, 7))
    + r"\};"
)
_GROUP = re.compile(r"DEFAULT_GROUP ?= ?(.*);")
# What may stand in the head; all but the group say nothing of the motion.
_ATTRIBUTE = re.compile(
    "(?:TCD: ?)?(?:OWNER|COMMENT|PROG_SIZE|CREATE|MODIFIED|FILE_NAME|VERSION|LINE_COUNT|MEMORY_SIZE"
    "|PROTECT|STACK_SIZE|TASK_PRIORITY|TIME_SLICE|BUSY_LAMP_OFF|ABORT_REQUEST|PAUSE_REQUEST"
    "|DEFAULT_GROUP|CONTROL_CODE) ?="
)
_HALF_DIGIT = 0.5 * np.deg2rad(10.0**-DECIMALS) * np.array([1.0, 1.0, 2.0, 1.0, 1.0, 1.0])
START = WrittenSpeed(SpeedUnit.TOP_SPEED, START_SPEED, f"{100.0 * START_SPEED:.0f}%")
_CNT = Corner(100.0, "CNT100")
CORNERS = Corners(Corner(0.0, "FINE"), _CNT, _CNT, _CNT)


_UNITS = {
    "%": (SpeedUnit.TOP_SPEED, 0.01),
    "msec": (SpeedUnit.SECONDS, 1e-3),
    "mm/sec": (SpeedUnit.TOOL_POINT, 1e-3),
}
_SECTIONS = ("/PROG", "/ATTR", "/MN", "/POS", "/END")
_NEXT = dict(pairwise(("", *_SECTIONS)))
Lines = list[tuple[int, str]]


class _Position(NamedTuple):
    """A position as the list of them gives it: user frame, tool, and the texts of six axes."""

    frame: str
    tool: str
    axes: tuple[str, ...]


def tool_in_frame(tool: str, frame: str) -> str:
    """Return the number of a tool as messages call it, with that of its user frame if it is in one.

    What stands at the origin of a user frame is a tool as well, so the two belong together.
    """
    return tool if frame == "0" else f"{tool} in user frame {frame}"


def parse(text: str, source: str) -> Listing:
    """Return the program of a file; see `listing_reader`."""
    notes = Notes(source, _WORDS)
    sections = _sections(notes, text)
    for line, code in sections["/ATTR"]:
        if not _ATTRIBUTE.match(code):
            notes.doubt(line, f"nobody can tell from the file what {code} leads to")
        group = _GROUP.fullmatch(code)
        if group and group[1].replace(" ", "") != "1,*,*,*,*":
            notes.doubt(line, f"moves the groups {group[1]}; opl knows programs of group 1 alone")
    if not any(_GROUP.fullmatch(code) for _, code in sections["/ATTR"]):
        notes.doubt(1, "has no DEFAULT_GROUP, so it moves no robot")
    body = _Body(notes, _positions(notes, sections["/POS"]))
    for index, (line, code) in enumerate(sections["/MN"]):
        numbered = _NUMBERED.fullmatch(code)
        inner = numbered[1].strip() if numbered else None
        if inner is None:
            notes.doubt(line, f"{code} is no numbered line that ends with ;")
        elif inner and not inner.startswith("!"):
            body.statement(index, line, inner)
    body.check_jumps()
    last = max((line for lines in sections.values() for line, _ in lines), default=0)
    if not sections["/END"]:
        notes.doubt(last, "the program does not end")
    return notes.listing(last)


def _sections(notes: Notes, text: str) -> dict[str, Lines]:
    """Return the lines of each section; /END has the line it stands on."""
    found: dict[str, Lines] = {section: [] for section in _SECTIONS}
    here = ""
    # no sign opens a comment between two lines of a program: ! stands behind the line number
    for line, code in code_lines(text, "\0"):
        word = code.split()[0]
        if code[0] != "/":
            if here in ("/ATTR", "/MN", "/POS"):
                found[here].append((line, code))
            else:
                notes.doubt(line, f"{code} stands outside of the program")
        elif word != _NEXT.get(here):
            notes.doubt(line, f"{code} is not the section that follows {here or 'nothing'}")
        else:
            here = word
            if word == "/PROG":
                notes.name = code.removeprefix(word).strip()
            elif word == "/END":
                found[here].append((line, code))
    return found


def _positions(notes: Notes, lines: Lines) -> dict[str, _Position]:
    """Return the positions by number; each ends with ``};``."""
    positions: dict[str, _Position] = {}
    start, text = 0, ""
    for line, code in [*lines, (0, "")]:
        start = start if text else line
        text += code
        if not text or (line and not text.endswith("};")):
            continue
        if found := _POSITION.fullmatch(text.replace(" ", "")):
            number, frame, tool, *axes = found.groups()
            if number in positions:
                notes.doubt(start, f"P[{number}] was given before")
            positions[number] = _Position(frame, tool, tuple(axes))
        else:
            notes.doubt(start, f"{text} is no position of group 1 in joint angles")
        text = ""
    return positions


@dataclass
class _Body:
    """What holds until it is set again, and at which lines labels, jumps and moves stand."""

    notes: Notes
    positions: Mapping[str, _Position]
    holds: dict[str, str] = field(default_factory=dict)
    labels: dict[str, list[int]] = field(default_factory=dict)
    jumps: list[tuple[int, str, int]] = field(default_factory=list)
    moves: list[int] = field(default_factory=list)

    def statement(self, index: int, line: int, code: str) -> None:
        notes, jump = self.notes, _JUMP.fullmatch(code)
        if jump:
            self.jumps.append((index, jump[1], line))
        if found := _MOVE.fullmatch(code):
            self.moves.append(index)
            self._move(line, code, found)
        elif found := _SETTING.fullmatch(code):
            self.holds[found[1]] = found[2]
            notes.setting(line, code)
        elif label := _LABEL.fullmatch(code):
            self.labels.setdefault(label[1], []).append(index)
            notes.event(line, code)
        elif jump and code.startswith("JMP "):
            notes.event(line, code)
        else:
            if code.startswith("CALL "):
                self.moves.append(index)  # no jump may pass it either
            notes.other(line, code)

    def _move(self, line: int, code: str, found: re.Match[str]) -> None:
        notes = self.notes
        word, number, speed, unit, end, remote = found.groups()
        position, tool = self.positions.get(number), self.holds.get("UTOOL_NUM")
        frame = self.holds.get("UFRAME_NUM")
        if position is None:
            notes.doubt(line, f"P[{number}] is not there")
        elif frame != position.frame:
            notes.doubt(line, f"P[{number}] is of user frame {position.frame}, UFRAME_NUM {frame}")
        elif bool(remote) != (word == "L" and frame != "0"):
            notes.doubt(line, "RTCP goes with straight moves in a user frame, these with RTCP")
        elif position.tool != tool:
            notes.doubt(line, f"P[{number}] is of tool {position.tool}, UTOOL_NUM {tool}")
        else:
            if notes.begun == (unit == "%") or (unit == "mm/sec" and not remote):
                notes.doubt(
                    line,
                    "the first move needs a speed in %, every other one in msec, with RTCP also "
                    "in mm/sec",
                )
            counts, factor = _UNITS[unit]
            axes = np.deg2rad([float(axis) for axis in position.axes])
            move = ReadMove(
                target=from_fanuc(axes),
                straight=word == "L",
                speed=WrittenSpeed.of_number(counts, factor, speed, 0, speed + unit),
                corner=Corner(0.0 if end == "FINE" else float(end[3:]) or 1.0, end),
                tool=tool_in_frame(position.tool, frame),
                place=notes.place(line),
                resolution=_HALF_DIGIT,
            )
            meaning = code.replace(f"P[{number}]", f"P[{','.join(position.axes)}]")
            notes.move(line, code, move, meaning)

    def check_jumps(self) -> None:
        """A jump may wait, but neither skip nor repeat a move."""
        for index, label, line in self.jumps:
            places = self.labels.get(label, [])
            if len(places) != 1:
                self.notes.doubt(line, f"LBL[{label}] is not there once")
                continue
            low, high = sorted((places[0], index))
            if any(low <= move <= high for move in self.moves):
                self.notes.doubt(line, "jumps past moves")
