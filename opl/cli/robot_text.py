"""What the command line shows of robots: the list, and the data of one with their sources."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

import opl

WIDTH = 80  # columns


def show_robots(robots: Sequence[opl.Robot]) -> None:
    """Print the robots that are known."""
    table = Table(box=None, pad_edge=False)
    for heading in ("name", "robot", "reach\nmm", "payload\nkg", "axes", "pulse ratios"):
        right = heading in ("reach\nmm", "payload\nkg")
        table.add_column(Text(heading), justify="right" if right else "left")
    for robot in robots:
        payload = "" if robot.payload is None else f"{robot.payload:g}"
        cells = (
            robot.name,
            robot.title,
            f"{robot.reach * 1e3:.0f}",
            payload,
            _axes(robot.joint_names),
            _pulses(robot),
        )
        table.add_row(*(Text(cell) for cell in cells))
    _print(table)


def show_robot(robot: opl.Robot, file: Any) -> None:
    """Print what is known of a robot, every number with source and certainty."""
    notes = _Notes()
    arm, base = file.arm, file.base
    made = "" if file.title.startswith(file.maker) else f", made by {file.maker}"
    _print(f"{file.name}: {file.title}{made}")
    controller = base.controller_height_mm
    own = "" if controller is None else f", that of its controller {controller:g} mm"
    if base.controller_turn_deg:
        own += f", turned {base.controller_turn_deg:g} deg"
    lengths = ", ".join(f"{key[:-3]} {length:g}" for key, length in arm.lengths_mm().items())
    wrist = "where axes 5 and 6 meet" if arm.parallel_axes else "the wrist centre"
    payload = "payload not known"
    if file.payload is not None:
        payload = f"payload {file.payload.max_kg:g} kg {notes.mark(file.payload)}"
    lines = [
        f"reach {robot.reach * 1e3:.0f} mm from axis 1 to {wrist}, {payload}",
        f"base frame on axis 1, {base.height_mm:g} mm above the mounting face{own} "
        f"{notes.mark(base)}",
        f"arm with {arm.family}: {lengths} mm; zeros "
        f"{' '.join(f'{offset:g}' for offset in arm.offsets_deg)} deg; signs "
        f"{' '.join('+' if sign > 0 else '-' for sign in arm.signs)} {notes.mark(arm)}",
    ]
    if file.acceleration is None:
        ramp = robot.max_speed[0] / robot.max_acceleration[0]
        lines.append(f"acceleration not known: top speed is taken to need {ramp:g} s")
    else:
        most = " ".join(f"{value:g}" for value in file.acceleration.max_deg_s2)
        lines.append(f"acceleration {most} deg/s2 {notes.mark(file.acceleration)}")
    if file.shapes is not None:
        lines.append(f"shapes for collision checks {notes.mark(file.shapes)}")
    for line in lines:
        _print(textwrap.fill(line, WIDTH, subsequent_indent="  "))
    _print("")
    _print(_joints(file, notes))
    _print("")
    for line in notes.lines():
        _print(line)


def _joints(file: Any, notes: _Notes) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("joint")
    for heading in ("lower deg", "upper deg", "", "deg/s", "", "pulses/deg", ""):
        table.add_column(Text(heading), justify="right" if heading else "left")
    for joint in file.joints:
        limits, pulses = joint.limits, joint.pulses
        of_limits, of_speed = notes.mark(limits), notes.mark(joint.speed)
        counted, note = "not known", ""
        if pulses is not None:
            counted = f"{pulses.per_degree:.3f}"
            note = notes.mark(pulses) + ("" if pulses.verified else " not verified")
        cells = (
            joint.name,
            f"{limits.lower_deg:g}",
            f"{limits.upper_deg:g}",
            of_limits,
            f"{joint.speed.max_deg_s:g}",
            of_speed,
            counted,
            note,
        )
        table.add_row(*(Text(cell) for cell in cells))
    return table


class _Notes:
    """Numbers the sources as they come up."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, str], int] = {}

    def mark(self, sourced: Any) -> str:
        key = (sourced.source, sourced.certainty)
        return f"[{self._seen.setdefault(key, len(self._seen) + 1)}]"

    def lines(self) -> Iterator[str]:
        for (source, certainty), number in self._seen.items():
            certain = certainty if certainty.startswith("from") else f"certainty {certainty}"
            yield textwrap.fill(f"[{number}] {source} ({certain})", WIDTH, subsequent_indent="    ")


def _axes(names: Sequence[str]) -> str:
    """Return the names of the joints, the first and last where they are long or only numbered."""
    numbered = all(name[1:] == str(number) for number, name in enumerate(names, start=1))
    listed = " ".join(names)
    return f"{names[0]} to {names[-1]}" if numbered or len(listed) > 20 else listed


def _pulses(robot: opl.Robot) -> str:
    missing, unsure, every = robot.missing_pulses, robot.unverified_pulses, robot.joint_names
    if missing:
        counts = robot.maker in ("Yaskawa", "unknown")
        return _all_or(missing, every, "not known") if counts else "not needed"
    return _all_or(unsure, every, "not verified") if unsure else "verified"


def _all_or(names: Sequence[str], every: Sequence[str], what: str) -> str:
    return what if len(names) == len(every) else f"{what}: {' '.join(names)}"


def _print(what: str | Table) -> None:
    # on a wide terminal and in a file as on a narrow one
    console = Console(highlight=False, width=WIDTH, markup=False)
    console.print(Text(what) if isinstance(what, str) else what)
