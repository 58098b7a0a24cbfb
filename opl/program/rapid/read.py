"""Reading RAPID modules: MoveAbsJ to joint targets and MoveL to poses, each with its time.

RAPID ignores case. Zones are read as how far the tool point is from a written point at the most
where the controller leaves its move: 0.3 mm with z0.
"""

from __future__ import annotations

import re

import numpy as np

from opl.geometry.frames import pose
from opl.geometry.rotations import from_quaternion
from opl.program.played import Corner, Corners, ReadMove, SpeedUnit, WrittenSpeed
from opl.program.rapid.tool_data import DECLARATION, GRIP
from opl.program.statements import NUMBER, Listing, Notes, Words, code_lines

DECIMALS = 4
V_DECIMALS = 3  # of speeds in [mm/s]
# Of the move to the first configuration, which has no time.
START = WrittenSpeed(SpeedUnit.TOOL_POINT, 0.05, "v50")
_FINEST_ZONE = 0.3  # z0 in [mm] of the tool point; the others are named after theirs


def _corner(zone: str) -> Corner:
    """Return the corner of a zone by its name."""
    size = 0.0 if zone == "fine" else float(zone[1:]) or _FINEST_ZONE
    return Corner(size, zone, 1e-3 * size)


_ZONE = _corner("z0")
CORNERS = Corners(Corner(0.0, "fine"), _ZONE, _ZONE, _ZONE)

_WORDS = Words(
    passing=re.compile(rf'(?:SetDO do[0-9]+, ?[01]|TPWrite "[^"]*"|TPErase|{GRIP[:-1]}) ?;', re.I),
    waits=re.compile(
        rf"(?:WaitTime {NUMBER}|Stop"
        rf"|WaitDI di[0-9]+, ?[01](?: ?\\MaxTime ?:= ?{NUMBER} ?\\TimeFlag ?:= ?late)?) ?;",
        re.I,
    ),
    opens=re.compile(r"WHILE late DO", re.I),
    closes=re.compile(r"ENDWHILE", re.I),
    call=re.compile(r"([A-Za-z]\w*) ?;"),
)
_ROW = rf"\[((?:{NUMBER},)*{NUMBER})\]"
_NO_AXES = r"\[9E9(?:,9E9){5}\]"
_REST = (
    rf",(?:v([0-9]+)|\[({NUMBER}),500,5000,1000\])(?:\\T:=({NUMBER}))?"
    r",(fine|z[0-9]+),(\w+(?:\\WObj:=\w+)?);"
)
_ABSOLUTE = re.compile(rf"MoveAbsJ\[{_ROW},{_NO_AXES}\](?:\\NoEOffs)?{_REST}", re.I)
_LINE = re.compile(rf"MoveL\[{_ROW},{_ROW},{_ROW},{_NO_AXES}\]{_REST}", re.I)
_HALF_DIGIT = np.full(6, 0.5 * np.deg2rad(10.0**-DECIMALS))
# What the digits of a pose may do to a joint in [rad], in no singularity.
_POSE_DIGITS = np.full(6, 1e-4)


# The lines that enclose the procedure, and how many of them stand before its statements.
_FRAME = (
    re.compile(r"MODULE \w+", re.I),
    re.compile(r"PROC (?P<name>\w+) ?\( ?\)", re.I),
    re.compile(r"ENDPROC", re.I),
    re.compile(r"ENDMODULE", re.I),
)
_INSIDE = 2
_VARIABLE = re.compile(r"VAR bool late ?:= ?FALSE ?;", re.I)
_LATE = re.compile(r"\blate\b", re.I)
_CONF = re.compile(r"ConfL ?\\(On|Off) ?;", re.I)


def parse(text: str, source: str) -> Listing:
    """Return the program of a module; see `listing_reader`."""
    notes = Notes(source, _WORDS)
    passed = 0  # of the lines that enclose the procedure
    free = False  # whether ConfL is off
    declared = False  # whether there is the variable of waits that take too long
    line = 0
    for line, code in code_lines(text, "!"):
        if passed < len(_FRAME) and (found := _FRAME[passed].fullmatch(code)):
            passed += 1
            if passed == _INSIDE:
                notes.name = found["name"]
        elif passed == _INSIDE - 1 and _VARIABLE.fullmatch(code):
            declared = True
        elif passed == _INSIDE - 1 and DECLARATION.fullmatch(code):
            notes.declaration(line, code)
        elif passed != _INSIDE:
            notes.doubt(line, f"{code} stands outside of the procedure")
        elif switch := _CONF.fullmatch(code):
            free = switch[1].lower() == "off"
            notes.event(line, code)
        else:
            if _LATE.search(code) and not declared:
                notes.doubt(line, "uses late, which the module does not declare")
            _statement(notes, line, code, free)
    if passed < len(_FRAME):
        notes.doubt(line, "the module does not end")
    return notes.listing(line)


def _statement(notes: Notes, line: int, code: str, free: bool) -> None:
    tight = code.replace(" ", "")
    found = _ABSOLUTE.fullmatch(tight) or _LINE.fullmatch(tight)
    groups = found.groups() if found else ()
    *rows, v, tcp, time, zone, tool = groups or ("", "", "", "", "")
    numbers = [np.array([float(number) for number in row.split(",")]) for row in rows]
    sizes = [len(row) for row in numbers]
    quarters: tuple[int, ...] = ()
    if sizes == [6]:
        (target,) = np.deg2rad(numbers)
    elif sizes == [3, 4, 4]:
        p, (w, *xyz), turns = numbers
        if not free:
            notes.doubt(line, "MoveL stands where ConfL is not off")
        if abs(np.linalg.norm([w, *xyz]) - 1.0) > 1e-4:
            notes.doubt(line, "the quaternion is not of length 1")
            return
        target = pose(from_quaternion(np.array([*xyz, w])), p * 1e-3)
        quarters = tuple(int(turn) for turn in turns[:3])
    else:
        notes.other(line, code)
        return
    if tcp is not None:
        if time is not None or len(rows) == 1:
            notes.doubt(line, "a speed in mm/s goes with straight moves that have no time")
        speed = WrittenSpeed.of_number(
            SpeedUnit.TOOL_POINT, 1e-3, tcp, V_DECIMALS, f"[{tcp},500,5000,1000]"
        )
    elif time is None:
        if notes.begun:
            notes.doubt(line, "a move after the first one needs a time (argument T) or mm/s")
        speed = WrittenSpeed.of_number(SpeedUnit.TOOL_POINT, 1e-3, v, 0, f"v{v}")
    else:
        speed = WrittenSpeed.of_number(SpeedUnit.SECONDS, 1.0, time, 4, f"\\T:={time}")
    zone = zone.lower()
    move = ReadMove(
        target=target,
        straight=len(rows) > 1,
        speed=speed,
        corner=_corner(zone),
        tool=tool.lower().replace("\\wobj", "\\WObj"),
        frame="the frame of the part" if "\\" in tool else "the base frame",
        place=notes.place(line),
        resolution=_POSE_DIGITS if len(rows) > 1 else _HALF_DIGIT,
        quarters=quarters,
    )
    notes.move(line, code, move, tight)
