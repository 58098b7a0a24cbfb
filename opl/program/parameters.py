"""Pulses per turn, soft limits and corner zones from a Yaskawa controller's own parameter file.

``RC.PRM`` and ``ALL.PRM`` hold a section ///RC1G for the first group of axes, ///RC2G for the
second, and so on: whole numbers, ten a row. Where the numbers of interest stand differs between the
DX generation and YRC1000, whose sections are longer.

    pulses per turn of an axis = 4096 |numerator / denominator|

4096 is what jobs count per turn of a motor; the sign is the sense in which the motor turns, which
jobs do not show. ``SC.PRM`` and ``ALL.PRM`` hold ///S1C1G and so on: numbers 33 to 40 of it are the
zones of the position levels PL=1 to PL=8 in 0.001 mm, as saved by a GP25 and a GP88.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from opl.errors import InputError

N_JOINTS = 6
PULSES_PER_MOTOR_TURN = 4096
_PER_ROW = 10
_MOST_AXES = 8  # of a group
_GROUP = re.compile(r"///(RC|S1C)([1-8])G")
_LINK_PLACES = (1, 3, 5, 8, 12)  # a1, upper arm, a2, forearm, wrist to flange, in micrometres
_FIRST_ZONE, _ZONES = 33, 8  # of PL=1, and how many
_NUMBER = re.compile(r"[+-]?[0-9]{1,12}")


@dataclass(frozen=True)
class ParameterLayout:
    """Where the numbers stand in ///RC1G, each the first of up to eight.

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
    """What a parameter file says of the axes of one group.

    Attributes:
        group: Its number.
        layout: Name of the layout it was read by.
        pulses_per_degree: Of each axis, six.
        lower: Soft limits in pulses, six.
        upper: Soft limits in pulses, six.
        link_lengths: Of the arm in [m], five; zeros where the file does not say.
        zones: Of the position levels PL=1 to PL=8 in [m], None where the file does not say.
    """

    group: int
    layout: str
    pulses_per_degree: tuple[float, ...]
    lower: tuple[int, ...]
    upper: tuple[int, ...]
    link_lengths: tuple[float, ...]
    zones: tuple[float, ...] | None


@dataclass(frozen=True)
class ParameterGroup:
    """The numbers of one group of axes as they stand in a file.

    Attributes:
        number: 1 for ///RC1G.
        layout: Where what stands.
        numbers: All numbers of the section.
        zones: Of the position levels in [m], None where the file does not say.
    """

    number: int
    layout: ParameterLayout
    numbers: tuple[int, ...]
    zones: tuple[float, ...] | None

    @property
    def n_axes(self) -> int:
        """How many axes have soft limits; 0 in a group that the controller does not have."""
        return sum(
            (high, low) != (0, 0)
            for high, low in zip(
                self._from(self.layout.upper, _MOST_AXES),
                self._from(self.layout.lower, _MOST_AXES),
                strict=True,
            )
        )

    def axes(self) -> AxisParameters:
        """Return what it says of the axes of an arm.

        Raises:
            InputError: If it is no group of six axes, or its numbers cannot be ratios or limits.
        """
        layout, section = self.layout, f"///RC{self.number}G"
        if self.n_axes != N_JOINTS:
            raise InputError(section, f"has {self.n_axes} axes, must have {N_JOINTS}")
        ratios = []
        overs = self._from(layout.numerator, N_JOINTS)
        unders = self._from(layout.denominator, N_JOINTS)
        for axis, (over, under) in enumerate(zip(overs, unders, strict=True), start=1):
            if over == 0 or under == 0:
                raise InputError(section, f"axis {axis} has the ratio {over}/{under}")
            ratios.append(PULSES_PER_MOTOR_TURN * abs(over / under) / 360.0)
        upper, lower = (self._from(place, N_JOINTS) for place in (layout.upper, layout.lower))
        for axis, (low, high) in enumerate(zip(lower, upper, strict=True), start=1):
            if low >= high:
                raise InputError(section, f"axis {axis} has the soft limits {low}, {high}")
        links = tuple(self.numbers[place] * 1e-6 for place in _LINK_PLACES)
        return AxisParameters(
            self.number, layout.name, tuple(ratios), lower, upper, links, self.zones
        )

    def _from(self, place: int, count: int) -> tuple[int, ...]:
        return self.numbers[place : place + count]


def read_parameters(text: str, source: str) -> tuple[ParameterGroup, ...]:
    """Return the groups with axes of ``RC.PRM`` or ``ALL.PRM``, line ends of any kind.

    Raises:
        InputError: If there is no such group, or a section is too short or holds no numbers.
    """
    sections = _sections(text, source)
    if not any(kind == "RC" for kind, _ in sections):
        raise InputError(source, "holds no section ///RC1G; give RC.PRM or ALL.PRM")
    groups = []
    for (kind, number), numbers in sections.items():
        if kind != "RC":
            continue
        rows = len(numbers) // _PER_ROW
        layout = next((layout for layout in LAYOUTS if rows >= layout.rows), None)
        if layout is None:
            least = min(layout.rows for layout in LAYOUTS)
            raise InputError(
                source,
                f"///RC{number}G has {rows} rows; DX controllers have {least} or more, and of "
                "older ones the places of the ratios are not known: give calibration readings "
                "instead",
            )
        zones = _zones(sections.get(("S1C", number), ()))
        groups.append(ParameterGroup(number, layout, numbers, zones))
    found = tuple(group for group in groups if group.n_axes)
    if not found:
        raise InputError(source, "no axis of it has soft limits")
    return found


def _zones(numbers: tuple[int, ...]) -> tuple[float, ...] | None:
    """Return the zones in [m] if the numbers are some: each level as wide as the last or wider."""
    zones = tuple(number * 1e-6 for number in numbers[_FIRST_ZONE : _FIRST_ZONE + _ZONES])
    usable = len(zones) == _ZONES and zones[0] > 0.0 and list(zones) == sorted(zones)
    return zones if usable else None


def _sections(text: str, source: str) -> dict[tuple[str, int], tuple[int, ...]]:
    """Return the numbers of the sections of interest by kind and group."""
    found: dict[tuple[str, int], list[int]] = {}
    inside: list[int] | None = None
    for number, line in enumerate(re.split(r"\r\n?|\n", text), start=1):
        line = line.strip(" \t\x1a")
        if line.startswith("/"):
            group = _GROUP.fullmatch(line.split()[0])
            inside = found.setdefault((group[1], int(group[2])), []) if group else None
        elif inside is not None and line:
            items = [item.strip() for item in line.rstrip(",").split(",")]
            if len(items) != _PER_ROW or not all(map(_NUMBER.fullmatch, items)):
                raise InputError(
                    f"{source}: line {number}", f"must hold {_PER_ROW} whole numbers, got {line!r}"
                )
            inside += [int(item) for item in items]
    return {key: tuple(numbers) for key, numbers in found.items()}
