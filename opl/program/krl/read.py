"""Reading KRL programs: PTP to axis angles and LIN to frames, speeds set before each move.

KRL ignores case. A speed, a base, a tool and an approximation hold until they are set again; none
of them may be missing at the first move, so that nothing of an earlier program counts. C_PTP and
C_DIS are read, not played: the corners they cut off are not replayed. A speed of PTP is a whole
percent, so a single move may be one percent faster than it should; passes keep their time.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from opl.cell.robot import Robot
from opl.geometry.frames import pose
from opl.program.krl.rounding import DECIMALS
from opl.program.moves import START_SPEED
from opl.program.played import Corner, Corners, ReadMove, Speed, SpeedUnit
from opl.program.settings import ProgramSettings
from opl.program.statements import NUMBER, Listing, Notes, Words, code_lines

# Approximation as opl sets it: percent of C_PTP, and distance of C_DIS in [mm].
PTP_CORNER, LIN_CORNER = 1.0, 0.5

_BOOL = "(?:TRUE|FALSE)"
_INPUT = rf"\$IN\[[0-9]+\] ?(?:==|<>) ?{_BOOL}"
_WORDS = Words(
    passing=re.compile(
        rf"\$OUT\[[0-9]+\] ?= ?{_BOOL}|\$TIMER\[[0-9]+\] ?= ?-?[0-9]+"
        rf"|\$TIMER_STOP\[[0-9]+\] ?= ?{_BOOL}",
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
_BEGIN = re.compile(r"DEF (\w+) ?\( ?\)", re.I)
_PTP = re.compile(
    "PTP{" + ",".join(rf"A{axis}({NUMBER})" for axis in range(1, 7)) + "}(C_PTP)?", re.I
)
_LIN = re.compile("LIN{" + ",".join(rf"{axis}({NUMBER})" for axis in "XYZABC") + "}(C_DIS)?", re.I)
_HALF_DIGIT = np.full(6, 0.5 * np.deg2rad(10.0**-DECIMALS))
# What the digits of a frame may do to a joint in [rad], in no singularity.
_POSE_DIGITS = np.full(6, 1e-4)


@dataclass
class _State:
    """What holds until it is set again; None where it was not set."""

    begun: str | None = None
    base: str | None = None
    tool: str | None = None
    percent: str | None = None
    metres: str | None = None
    ptp_corner: str | None = None
    lin_corner: str | None = None


# Statements that set something: the value is the first group.
_SETTINGS: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("begun", re.compile(r"BAS ?\( ?#(INITMOV) ?, ?0 ?\)", re.I)),
    ("percent", re.compile(r"BAS ?\( ?#VEL_PTP ?, ?([0-9]+) ?\)", re.I)),
    ("base", re.compile(r"\$BASE ?= ?(\$NULLFRAME)", re.I)),
    ("tool", re.compile(r"\$TOOL ?= ?(\$NULLFRAME|TOOL_DATA\[[0-9]+\])", re.I)),
    ("metres", re.compile(rf"\$VEL\.CP ?= ?({NUMBER})", re.I)),
    ("ptp_corner", re.compile(rf"\$APO\.CPTP ?= ?({NUMBER})", re.I)),
    ("lin_corner", re.compile(rf"\$APO\.CDIS ?= ?({NUMBER})", re.I)),
)


def parse(text: str, source: str) -> Listing:
    """Return the program of a file.

    Args:
        text: Of the file.
        source: The file, for messages.

    Raises:
        InputError: If it holds no program.
    """
    notes, state = Notes(source, _WORDS), _State()
    ended, line = False, 0
    for line, code in code_lines(text, ";"):
        if code.startswith("&"):
            continue  # about the file, not the program
        if (begin := _BEGIN.fullmatch(code)) and not notes.name:
            notes.name = begin[1]
        elif ended or not notes.name:
            notes.doubt(line, f"{code} stands outside of the program")
        elif code.upper() == "END":
            ended = True
        else:
            _statement(notes, state, line, code)
    if not ended:
        notes.doubt(line, "the program does not end")
    return notes.listing(line)


def _statement(notes: Notes, state: _State, line: int, code: str) -> None:
    for key, pattern in _SETTINGS:
        if found := pattern.fullmatch(code):
            setattr(state, key, found[1].upper())
            notes.setting(line, code)
            return
    tight = code.replace(" ", "")
    build: Callable[[_State, list[str], bool], ReadMove]
    if found := _PTP.fullmatch(tight):
        needed, build = (*_ALWAYS, "percent", "ptp_corner"), _ptp
    elif found := _LIN.fullmatch(tight):
        needed, build = (*_ALWAYS, "metres", "lin_corner"), _lin
    else:
        notes.other(line, code)
        return
    missing = [key for key in needed if getattr(state, key) is None]
    if missing:
        names = ", ".join(_SETTING_NAMES[key] for key in missing)
        notes.doubt(line, f"moves before this is set: {names}")
        return
    *values, corner = found.groups()
    notes.move(line, code, build(state, [notes.place(line), *values], corner is not None), tight)


_ALWAYS = ("begun", "base", "tool")
_SETTING_NAMES = {
    "begun": "BAS(#INITMOV, 0)",
    "base": "$BASE",
    "tool": "$TOOL",
    "percent": "BAS(#VEL_PTP, n)",
    "metres": "$VEL.CP",
    "ptp_corner": "$APO.CPTP",
    "lin_corner": "$APO.CDIS",
}


def _ptp(state: _State, found: list[str], rounds: bool) -> ReadMove:
    place, *angles = found
    assert state.percent is not None and state.ptp_corner is not None and state.tool is not None
    percent = int(state.percent)
    approximates = f"C_PTP with $APO.CPTP = {state.ptp_corner}"
    return ReadMove(
        target=np.deg2rad([float(angle) for angle in angles]),
        straight=False,
        speed=Speed(SpeedUnit.TOP_SPEED, percent / 100.0, f"BAS(#VEL_PTP, {percent})"),
        corner=_corner(float(state.ptp_corner) / PTP_CORNER if rounds else 0.0, approximates),
        tool=state.tool,
        place=place,
        resolution=_HALF_DIGIT,
        last_digit=1.0 / max(percent, 1),
    )


def _lin(state: _State, found: list[str], rounds: bool) -> ReadMove:
    place, *values = found
    assert state.metres is not None and state.lin_corner is not None and state.tool is not None
    x, y, z, a, b, c = (float(value) for value in values)
    turned = Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()
    approximates = f"C_DIS with $APO.CDIS = {state.lin_corner}"
    return ReadMove(
        target=pose(turned, np.array([x, y, z]) * 1e-3),
        straight=True,
        speed=Speed(SpeedUnit.TOOL_POINT, float(state.metres), f"$VEL.CP = {state.metres}"),
        corner=_corner(float(state.lin_corner) / LIN_CORNER if rounds else 0.0, approximates),
        tool=state.tool,
        place=place,
        resolution=_POSE_DIGITS,
    )


def _corner(size: float, approximates: str) -> Corner:
    """Return a corner; its size counts in those that opl writes."""
    return Corner(size, approximates if size else "exact stop")


def start_speed(robot: Robot) -> Speed:
    """Return the fastest first move."""
    percent = round(100.0 * START_SPEED)
    return Speed(SpeedUnit.TOP_SPEED, START_SPEED, f"BAS(#VEL_PTP, {percent})")


def corners(settings: ProgramSettings) -> Corners:
    """Return the largest corners: those that opl writes wherever the robot need not stop."""
    text = f"C_PTP with $APO.CPTP = {PTP_CORNER:g} or C_DIS with $APO.CDIS = {LIN_CORNER:g}"
    corner = Corner(1.0, text)
    return Corners(Corner(0.0, "exact stop"), corner, corner, corner)
