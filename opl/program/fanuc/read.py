"""Reading FANUC TP programs as text: J and L moves to positions given as joint angles.

CNT is read, not played: the corners it cuts off are not replayed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from opl.geometry.frames import Array
from opl.program.fanuc.rounding import DECIMALS, from_fanuc
from opl.program.moves import START_SPEED
from opl.program.played import Corner, Corners, ReadMove, Speed, SpeedUnit
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
_FRAME = re.compile(r"UFRAME_NUM ?= ?([0-9]+)")
_TOOL = re.compile(r"UTOOL_NUM ?= ?([0-9]+)")
_MOVE = re.compile(r"([JL]) ?P\[([0-9]+)\] ([0-9]+)(%|msec) (FINE|CNT[0-9]+)")
_NUMBERED = re.compile(r"[0-9]+:(.*);")
_POSITION = re.compile(
    r"P\[([0-9]+)\]\{GP1:UF:([0-9]+),UT:([0-9]+),"
    + ",".join(rf"J{axis}=({NUMBER})deg" for axis in range(1, 7))
    + r"\};"
)
_GROUP = re.compile(r"DEFAULT_GROUP ?= ?(.*);")
_HALF_DIGIT = 0.5 * np.deg2rad(10.0**-DECIMALS) * np.array([1.0, 1.0, 2.0, 1.0, 1.0, 1.0])
START = Speed(SpeedUnit.TOP_SPEED, START_SPEED, f"{100.0 * START_SPEED:.0f}%")
_CNT = Corner(100.0, "CNT100")
CORNERS = Corners(Corner(0.0, "FINE"), _CNT, _CNT, _CNT)


@dataclass(frozen=True, eq=False)
class _Position:
    """A position as the list of them gives it: user frame, tool, and the texts of six axes."""

    frame: str
    tool: str
    axes: tuple[str, ...]


@dataclass
class _State:
    """What holds until it is set again, and where labels, jumps and moves stand."""

    frame: str | None = None
    tool: str | None = None
    labels: dict[str, list[int]] = field(default_factory=dict)
    jumps: list[tuple[int, str, int]] = field(default_factory=list)
    moves: list[int] = field(default_factory=list)


def parse(text: str, source: str) -> Listing:
    """Return the program of a file; see `listing_reader`."""
    notes, state = Notes(source, _WORDS), _State()
    sections = _sections(notes, text)
    for line, code in sections["/ATTR"]:
        group = _GROUP.fullmatch(code)
        if group and group[1].replace(" ", "") != "1,*,*,*,*":
            notes.doubt(line, f"moves the groups {group[1]}; opl knows programs of group 1 alone")
    positions = _positions(notes, sections["/POS"])
    for index, (line, code) in enumerate(sections["/MN"]):
        numbered = _NUMBERED.fullmatch(code)
        inner = numbered[1].strip() if numbered else None
        if inner is None:
            notes.doubt(line, f"{code} is no numbered line that ends with ;")
        elif inner and not inner.startswith("!"):
            _statement(notes, state, positions, index, line, inner)
    _check_jumps(notes, state)
    last = max((line for lines in sections.values() for line, _ in lines), default=0)
    if not sections["/END"]:
        notes.doubt(last, "the program does not end")
    return notes.listing(last)


_SECTIONS = ("/PROG", "/ATTR", "/MN", "/POS", "/END")
Lines = list[tuple[int, str]]


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
        elif word != _next(here):
            notes.doubt(line, f"{code} is not the section that follows {here or 'nothing'}")
        else:
            here = word
            if word == "/PROG":
                notes.name = code.removeprefix(word).strip()
            elif word == "/END":
                found[here].append((line, code))
    return found


def _next(section: str) -> str | None:
    """Return the section that follows one, the first after none."""
    following = dict(pairwise(("", *_SECTIONS)))
    return following.get(section)


def _positions(notes: Notes, lines: Lines) -> dict[str, _Position]:
    """Return the positions by number."""
    positions: dict[str, _Position] = {}
    for line, code in _entries(lines):
        found = _POSITION.fullmatch(code.replace(" ", ""))
        if found is None:
            notes.doubt(line, f"{code} is no position of group 1 in joint angles")
            continue
        number, frame, tool, *axes = found.groups()
        if number in positions:
            notes.doubt(line, f"P[{number}] was given before")
        positions[number] = _Position(frame, tool, tuple(axes))
    return positions


def _entries(lines: Lines) -> Iterator[tuple[int, str]]:
    """Give the texts of positions, each with the line it begins on: they end with ``};``."""
    start, text = 0, ""
    for line, code in lines:
        start = start if text else line
        text += code
        if text.endswith("};"):
            yield start, text
            text = ""
    if text:
        yield start, text


def _statement(
    notes: Notes,
    state: _State,
    positions: Mapping[str, _Position],
    index: int,
    line: int,
    code: str,
) -> None:
    if found := _FRAME.fullmatch(code):
        state.frame = found[1]
        notes.setting(line, code)
    elif found := _TOOL.fullmatch(code):
        state.tool = found[1]
        notes.setting(line, code)
    elif found := _MOVE.fullmatch(code):
        state.moves.append(index)
        word, number, *rest = found.groups()
        position = positions.get(number)
        if position is None:
            notes.doubt(line, f"P[{number}] is not there")
        elif state.frame != "0" or position.frame != "0":
            notes.doubt(line, "moves in a user frame, or before UFRAME_NUM=0")
        elif position.tool != state.tool:
            notes.doubt(line, f"P[{number}] is of tool {position.tool}, UTOOL_NUM {state.tool}")
        else:
            axes = np.array([float(axis) for axis in position.axes])
            move = _move(notes.place(line), word, axes, rest, position.tool)
            if notes.begun == (move.speed.unit is SpeedUnit.TOP_SPEED):
                notes.doubt(line, "the first move needs a speed in %, every other one in msec")
            meaning = code.replace(f"P[{number}]", f"P[{','.join(position.axes)}]")
            notes.move(line, code, move, meaning)
    else:
        if label := _LABEL.fullmatch(code):
            state.labels.setdefault(label[1], []).append(index)
            notes.setting(line, code)
            return
        if jump := _JUMP.fullmatch(code):
            state.jumps.append((index, jump[1], line))
        if code.startswith("JMP ") and jump:
            notes.setting(line, code)
            return
        if code.startswith("CALL "):
            state.moves.append(index)  # no jump may pass it either
        notes.other(line, code)


def _move(place: str, word: str, axes: Array, rest: list[str], tool: str) -> ReadMove:
    number, unit, end = rest
    speed = (
        Speed(SpeedUnit.TOP_SPEED, float(number) / 100.0, f"{number}%")
        if unit == "%"
        else Speed(SpeedUnit.SECONDS, float(number) / 1e3, f"{number}msec")
    )
    return ReadMove(
        target=from_fanuc(np.deg2rad(axes)),
        straight=word == "L",
        speed=speed,
        corner=Corner(0.0 if end == "FINE" else float(end[3:]) or 1.0, end),
        tool=tool,
        place=place,
        resolution=_HALF_DIGIT,
    )


def _check_jumps(notes: Notes, state: _State) -> None:
    """A jump may wait, but neither skip nor repeat a move."""
    for index, label, line in state.jumps:
        places = state.labels.get(label, [])
        if len(places) != 1:
            notes.doubt(line, f"LBL[{label}] is not there once")
            continue
        low, high = sorted((places[0], index))
        if any(low <= move <= high for move in state.moves):
            notes.doubt(line, "jumps past moves")
