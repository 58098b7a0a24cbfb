"""Pulses per turn and soft limits from a Yaskawa controller's own parameter file.

``RC.PRM`` and ``ALL.PRM`` hold the section ///RC1G: whole numbers, ten a row. Where the numbers of
interest stand differs between the DX generation and YRC1000, whose section is longer.

    pulses per turn of an axis = 4096 |numerator / denominator|

4096 is what jobs count per turn of a motor; the sign is the sense in which the motor turns, which
jobs do not show.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from opl.errors import InputError

N_JOINTS = 6
PULSES_PER_MOTOR_TURN = 4096
_PER_ROW = 10
_SECTION = "///RC1G"
_LINK_PLACES = (1, 3, 5, 8, 12)  # a1, upper arm, a2, forearm, wrist to flange, in micrometres
_NUMBER = re.compile(r"[+-]?[0-9]{1,12}")


@dataclass(frozen=True)
class ParameterLayout:
    """Where the numbers stand in ///RC1G, each the first of six.

    Attributes:
        name: The controllers that have it.
        rows: Fewest rows of the section.
        numerator: Of the ratio of motor and axis turns.
        denominator: Of the same.
        upper: Soft limits in positive direction, in pulses.
        lower: Soft limits in negative direction, in pulses.
    """

    name: str
    rows: int
    numerator: int
    denominator: int
    upper: int
    lower: int


# Longest first: a section belongs to the first whose rows it has. Both were found by recomputing
# the limits in degrees of published backups (GP88 with YRC1000, MA2010 with DX200).
LAYOUTS = (
    ParameterLayout("YRC1000", 200, numerator=1100, denominator=1090, upper=1030, lower=1040),
    ParameterLayout("DX100/DX200", 100, numerator=980, denominator=972, upper=924, lower=932),
)


@dataclass(frozen=True)
class AxisParameters:
    """What a parameter file says of the axes of robot 1.

    Attributes:
        layout: Name of the layout it was read by.
        pulses_per_degree: Of each axis, six.
        lower: Soft limits in pulses, six.
        upper: Soft limits in pulses, six.
        link_lengths: Of the arm in [m], five; zeros where the file does not say.
    """

    layout: str
    pulses_per_degree: tuple[float, ...]
    lower: tuple[int, ...]
    upper: tuple[int, ...]
    link_lengths: tuple[float, ...]


def read_parameters(text: str, source: str) -> AxisParameters:
    """Read the text of ``RC.PRM`` or ``ALL.PRM``, line ends of any kind.

    Raises:
        InputError: If the section is missing, too short, or its numbers cannot be ratios.
    """
    rows = _rows(text, source)
    layout = next((layout for layout in LAYOUTS if len(rows) >= layout.rows), None)
    if layout is None:
        least = min(layout.rows for layout in LAYOUTS)
        raise InputError(
            source,
            f"{_SECTION} has {len(rows)} rows; DX controllers have {least} or more, and of older "
            "ones the places of the ratios are not known: give calibration readings instead",
        )
    numbers = [number for row in rows for number in row]

    def six(place: int) -> tuple[int, ...]:
        return tuple(numbers[place : place + N_JOINTS])

    ratios = []
    for axis, (over, under) in enumerate(
        zip(six(layout.numerator), six(layout.denominator), strict=True), start=1
    ):
        if over == 0 or under == 0:
            raise InputError(source, f"{_SECTION}: axis {axis} has the ratio {over}/{under}")
        ratios.append(PULSES_PER_MOTOR_TURN * abs(over / under) / 360.0)
    upper, lower = six(layout.upper), six(layout.lower)
    for axis, (low, high) in enumerate(zip(lower, upper, strict=True), start=1):
        if low >= high:
            raise InputError(source, f"{_SECTION}: axis {axis} has the soft limits {low}, {high}")
    links = tuple(numbers[place] * 1e-6 for place in _LINK_PLACES)
    return AxisParameters(layout.name, tuple(ratios), lower, upper, links)


def _rows(text: str, source: str) -> list[list[int]]:
    rows: list[list[int]] = []
    inside = False
    for number, line in enumerate(re.split(r"\r\n?|\n", text), start=1):
        line = line.strip(" \t\x1a")
        if line.startswith("//"):
            if inside:
                break
            inside = line.split()[0] == _SECTION
        elif inside and line:
            items = [item.strip() for item in line.rstrip(",").split(",")]
            if len(items) != _PER_ROW or not all(map(_NUMBER.fullmatch, items)):
                raise InputError(
                    f"{source}: line {number}", f"must hold {_PER_ROW} whole numbers, got {line!r}"
                )
            rows.append([int(item) for item in items])
    if not rows:
        raise InputError(source, f"holds no section {_SECTION}; give RC.PRM or ALL.PRM")
    return rows
