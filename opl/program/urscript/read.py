"""Reading UR scripts: movej and movel to joint positions, each with its time and blend.

The blend radius r is read as how far the tool point is from a written point at the most where the
controller leaves its move.
"""

from __future__ import annotations

import re

import numpy as np

from opl.cell.robot import Robot
from opl.program.moves import START_SPEED
from opl.program.played import Corner, Corners, ReadMove, SpeedUnit, WrittenSpeed
from opl.program.statements import NUMBER, Listing, Notes, Words, read_enclosed

DECIMALS = 6
# No corner needs a larger blend than this in [m].
LARGEST_BLEND = 0.001
_BLEND = Corner(LARGEST_BLEND, f"r={LARGEST_BLEND:.5f}", LARGEST_BLEND)
CORNERS = Corners(Corner(0.0, "r=0.00000"), _BLEND, _BLEND, _BLEND)

_BOOL = "(?:True|False)"
_WORDS = Words(
    passing=re.compile(
        rf"set_standard_digital_out\([0-9]+, ?{_BOOL}\)"
        rf"|set_target_payload\({NUMBER}(?: ?, ?\[?{NUMBER}){{3}} ?\]\)"
        rf"|waited ?= ?{NUMBER}|waited ?= ?waited ?\+ ?{NUMBER}"
    ),
    waits=re.compile(rf'sleep\({NUMBER}\)|sync\(\)|popup\("[^"]*", ?blocking ?= ?True\)'),
    opens=re.compile(
        rf"while get_standard_digital_in\([0-9]+\) ?!= ?{_BOOL}:|if waited ?>= ?{NUMBER}:"
    ),
    closes=re.compile("end"),
    call=re.compile(r"([A-Za-z_]\w*)\(\)"),
)
_BEGIN, _END = re.compile(r"def ([A-Za-z_]\w*)\(\):"), re.compile("end")
_TOOL = re.compile(rf"set_tcp\(p\[({NUMBER}(?:,{NUMBER}){{5}})\]\)")
_MOVE = re.compile(
    rf"(move[jl])\(\[({NUMBER}(?:,{NUMBER}){{5}})\],"
    rf"(?:t=({NUMBER})|a={NUMBER},v=({NUMBER})),r=({NUMBER})\)"
)
_HALF_DIGIT = np.full(6, 0.5 * 10.0**-DECIMALS)


def parse(text: str, source: str) -> Listing:
    """Return the program of a script; see `listing_reader`."""
    notes = Notes(source, _WORDS)
    tool: str | None = None

    def statement(line: int, code: str) -> None:
        nonlocal tool
        tight = code.replace(" ", "")
        if found := _TOOL.fullmatch(tight):
            tool = tool_text([float(number) for number in found[1].split(",")])
            notes.setting(line, code)
        elif found := _MOVE.fullmatch(tight):
            move = _move(notes, line, found, tool)
            if move is not None:
                notes.move(line, code, move, tight)
        else:
            notes.other(line, code)

    return read_enclosed(notes, text, "#", _BEGIN, _END, statement)


def tool_text(values: list[float]) -> str:
    """Return the pose of a tool as messages name it, every digit of it."""
    return "p[" + ", ".join(f"{value + 0.0!r}" for value in values) + "]"


def _move(notes: Notes, line: int, found: re.Match[str], tool: str | None) -> ReadMove | None:
    word, joints, time, velocity, radius = found.groups()
    if tool is None:
        notes.doubt(line, "moves before set_tcp")
        return None
    if time is None and notes.begun:
        notes.doubt(line, "a move after the first one needs its time (t)")
    speed = (
        WrittenSpeed.of_number(SpeedUnit.LEADING_JOINT, 1.0, velocity, 4, f"v={velocity}")
        if time is None
        else WrittenSpeed.of_number(SpeedUnit.SECONDS, 1.0, time, 4, f"t={time}")
    )
    return ReadMove(
        target=np.array([float(joint) for joint in joints.split(",")]),
        straight=word == "movel",
        speed=speed,
        corner=Corner(float(radius), f"r={radius}", float(radius)),
        tool=tool,
        place=notes.place(line),
        resolution=_HALF_DIGIT,
    )


def start_speed(robot: Robot) -> WrittenSpeed:
    """Return the fastest first move."""
    text = f"{START_SPEED * robot.max_speed.min():.4f}"
    return WrittenSpeed(SpeedUnit.LEADING_JOINT, float(text), f"v={text}")
