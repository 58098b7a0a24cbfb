"""Reading KRL programs: PTP to axis angles and LIN to frames, speeds set before each move.

KRL ignores case. A speed, a base, a tool and an approximation hold until they are set again; none
of them may be missing at the first move, so that nothing of an earlier program counts. How far
C_PTP and C_VEL cut off corners is not known in millimetres. A speed of PTP is a whole
percent, so a single move may be one percent faster than it should; passes keep their time. LIN
leads the tool in the hand ($IPO_MODE) and turns it evenly ($ORI_TYPE).
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from opl.geometry.frames import from_roll_pitch_yaw
from opl.program.moves import START_SPEED
from opl.program.played import Corner, Corners, ReadMove, SpeedUnit, WrittenSpeed
from opl.program.statements import NUMBER, Listing, Notes, Words, read_enclosed

DECIMALS = 4
START = WrittenSpeed(SpeedUnit.TOP_SPEED, START_SPEED, f"BAS(#VEL_PTP, {100.0 * START_SPEED:.0f})")
# Approximation as opl sets it, in percent: of C_PTP, and of the speed at C_VEL, below which a move
# does not slow down for a corner.
_PTP_CORNER, _LIN_CORNER = 1.0, 100.0
_STOP = Corner(0.0, "exact stop")
_ROUNDED = Corner(
    1.0, f"C_PTP with $APO.CPTP = {_PTP_CORNER:g} or C_VEL with $APO.CVEL = {_LIN_CORNER:g}"
)
CORNERS = Corners(_STOP, _ROUNDED, _ROUNDED, _ROUNDED)

_BOOL = "(?:TRUE|FALSE)"
_INPUT = rf"\$IN\[[0-9]+\] ?(?:==|<>) ?{_BOOL}"
_XYZ = rf"X {NUMBER} ?, ?Y {NUMBER} ?, ?Z {NUMBER}"
_LOAD_NUMBERS = rf"{NUMBER} ?, ?CM \{{{_XYZ}(?: ?, ?[ABC] 0\.0){{3}}\}} ?, ?J \{{{_XYZ}\}}"
_WORDS = Words(
    passing=re.compile(
        rf"\$OUT\[[0-9]+\] ?= ?{_BOOL}|\$TIMER\[[0-9]+\] ?= ?-?[0-9]+"
        rf"|\$TIMER_STOP\[[0-9]+\] ?= ?{_BOOL}|\$LOAD ?= ?\{{M {_LOAD_NUMBERS}\}}",
        re.I,
    ),
    waits=re.compile(
        rf"WAIT SEC {NUMBER}|WAIT FOR {_INPUT}|WAIT FOR \({_INPUT}\) OR \$TIMER_FLAG\[[0-9]+\]"
        "|HALT",
        re.I,
    ),
    opens=re.compile(rf"REPEAT|IF {_INPUT} THEN", re.I),
    closes=re.compile(rf"ENDIF|UNTIL {_INPUT}", re.I),
    call=re.compile(r"(?!BAS\b)([A-Za-z]\w*) ?\( ?\)", re.I),
)
_BEGIN, _END = re.compile(r"DEF (\w+) ?\( ?\)", re.I), re.compile("END", re.I)
_ABOUT_FILE = re.compile(r"^[ \t]*&.*$", re.M)
_PTP = re.compile(
    "PTP{" + ",".join(rf"A{axis}({NUMBER})" for axis in range(1, 7)) + "}(C_PTP)?", re.I
)
_LIN = re.compile("LIN{" + ",".join(rf"{axis}({NUMBER})" for axis in "XYZABC") + "}(C_VEL)?", re.I)
_HALF_DIGIT = np.full(6, 0.5 * np.deg2rad(10.0**-DECIMALS))
# What the digits of a frame may do to a joint in [rad], in no singularity.
_POSE_DIGITS = np.full(6, 1e-4)


# Statements that set something: what messages call it, and its value as the first group.
_BEGUN, _BASE, _TOOL = "BAS(#INITMOV, 0)", "$BASE", "$TOOL"
_PERCENT, _METRES, _CPTP, _CVEL = "BAS(#VEL_PTP, n)", "$VEL.CP", "$APO.CPTP", "$APO.CVEL"
_IPO, _ORI = "$IPO_MODE", "$ORI_TYPE"
_ALWAYS = (_BEGUN, _BASE, _TOOL)
_OF_PTP: tuple[str, ...] = (*_ALWAYS, _PERCENT, _CPTP)
_OF_LIN: tuple[str, ...] = (*_ALWAYS, _METRES, _CVEL, _IPO, _ORI)
_SETTINGS = {
    _BEGUN: re.compile(r"BAS ?\( ?#(INITMOV) ?, ?0 ?\)", re.I),
    _PERCENT: re.compile(r"BAS ?\( ?#VEL_PTP ?, ?([0-9]+) ?\)", re.I),
    _BASE: re.compile(r"\$BASE ?= ?(\$NULLFRAME)", re.I),
    _TOOL: re.compile(r"\$TOOL ?= ?(\$NULLFRAME|TOOL_DATA\[[0-9]+\])", re.I),
    _METRES: re.compile(rf"\$VEL\.CP ?= ?({NUMBER})", re.I),
    _CPTP: re.compile(rf"\$APO\.CPTP ?= ?({NUMBER})", re.I),
    _CVEL: re.compile(rf"\$APO\.CVEL ?= ?({NUMBER})", re.I),
    _IPO: re.compile(r"\$IPO_MODE ?= ?(#BASE)", re.I),
    _ORI: re.compile(r"\$ORI_TYPE ?= ?(#VAR)", re.I),
}


def parse(text: str, source: str) -> Listing:
    """Return the program of a file; see `listing_reader`."""
    notes = Notes(source, _WORDS)
    state: dict[str, str] = {}  # what holds until it is set again

    def statement(line: int, code: str) -> None:
        for name, pattern in _SETTINGS.items():
            if found := pattern.fullmatch(code):
                state[name] = found[1].upper()
                notes.setting(line, code)
                return
        tight = code.replace(" ", "")
        if found := _PTP.fullmatch(tight):
            needed, build = _OF_PTP, _ptp
        elif found := _LIN.fullmatch(tight):
            needed, build = _OF_LIN, _lin
        else:
            notes.other(line, code)
            return
        if missing := [name for name in needed if name not in state]:
            notes.doubt(line, f"moves before this is set: {', '.join(missing)}")
            return
        *texts, rounds = found.groups()
        values = [float(text) for text in texts]
        notes.move(line, code, build(state, values, rounds is not None, notes.place(line)), tight)

    return read_enclosed(notes, _ABOUT_FILE.sub("", text), ";", _BEGIN, _END, statement)


def _ptp(state: Mapping[str, str], values: list[float], rounds: bool, place: str) -> ReadMove:
    percent = state[_PERCENT]
    return ReadMove(
        target=np.deg2rad(values),
        straight=False,
        speed=WrittenSpeed.of_number(
            SpeedUnit.TOP_SPEED, 0.01, percent, 0, f"BAS(#VEL_PTP, {percent})"
        ),
        corner=_corner(rounds, f"C_PTP with {_CPTP} = {state[_CPTP]}", state[_CPTP], _PTP_CORNER),
        tool=state[_TOOL],
        place=place,
        resolution=_HALF_DIGIT,
    )


def _lin(state: Mapping[str, str], values: list[float], rounds: bool, place: str) -> ReadMove:
    return ReadMove(
        target=from_roll_pitch_yaw(np.deg2rad(values[:2:-1]), np.array(values[:3]) * 1e-3),
        straight=True,
        speed=WrittenSpeed.of_number(
            SpeedUnit.TOOL_POINT, 1.0, state[_METRES], 6, f"{_METRES} = {state[_METRES]}"
        ),
        corner=_corner(rounds, f"C_VEL with {_CVEL} = {state[_CVEL]}", state[_CVEL], _LIN_CORNER),
        tool=state[_TOOL],
        place=place,
        resolution=_POSE_DIGITS,
    )


def _corner(rounds: bool, text: str, written: str, usual: float) -> Corner:
    """Return a corner; its size counts in those that opl writes."""
    size = float(written) / usual
    return Corner(size, text) if rounds and size else _STOP
