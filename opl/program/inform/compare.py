"""Do two jobs do the same? Compared by meaning: labels, dates, comments and layout do not count."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from opl.cell.robot import Robot
from opl.program.changes import Coordinate, Line, changed_lines
from opl.program.events import same_number
from opl.program.inform.job import ROBOT_KINDS, InformJob, Instruction, Position, read_label
from opl.program.listing import pose_coordinates
from opl.program.pulses import PulseScale

_TAUGHT = ("C", "BC", "EC")  # their numbers only tie a move to its position
_GROUPS = {"B": "base", "E": "station"}  # the others, by their first letter


def differences_in_meaning(first: InformJob, second: InformJob, robot: Robot) -> list[str]:
    """Return how two jobs differ, for people; empty if they do the same."""
    return changed_lines(list(_meaning(first, robot)), list(_meaning(second, robot)))


def _meaning(job: InformJob, robot: Robot) -> Iterator[Line]:
    """Give everything that decides what the robot does, in order."""
    yield Line("", f"job {job.name}")
    for header in job.headers:
        key = header.key.lstrip("/")
        if key.startswith(("GROUP", "ATTR")) or header.key in ("////FRAME", "///FRAME"):
            yield Line(str(header.line), f"{key} {header.value}")
    for alias in job.aliases:
        yield Line("", f"alias {alias}")
    positions = {(p.kind, p.number): p for p in job.positions}
    for step in job.instructions:
        if step.word and step.word != "'" and not step.disabled:
            yield _instruction(step, positions, robot)
    for position in job.positions:
        if position.kind not in _TAUGHT:
            name = f"{position.kind}{position.number:03d}"
            settings = (("position", name), *_frame(position))
            text = f"{name} = {_exact(position)}"
            yield Line(str(position.line), text, _target(position, robot, ""), settings)


def _instruction(
    step: Instruction, positions: dict[tuple[str, int], Position], robot: Robot
) -> Line:
    text = _text(step, positions)
    if not step.moves:
        return Line(str(step.line), text)
    target: list[Coordinate] = []
    settings: list[tuple[str, str]] = []
    for number, move in enumerate((step, *step.coupled)):
        plus = "+" * number  # of the coupled moves
        settings.append((f"{plus}move", " ".join([move.word, *_variables(move)])))
        settings += [(plus + name, same_number(value)) for name, value in sorted(move.tags)]
        for label in _labels(move):
            if label in positions:
                target += _target(positions[label], robot, plus)
                settings += [(plus + name, value) for name, value in _frame(positions[label])]
    return Line(str(step.line), text, tuple(target), tuple(settings))


def _text(step: Instruction, positions: dict[tuple[str, int], Position]) -> str:
    if not step.moves and "MOV" not in step.word:
        # a condition is what its words say in their order
        return " ".join([step.word, *map(same_number, step.rest)])
    operands = []
    for operand in step.operands:
        label = read_label(operand)
        taught = label in positions and label is not None and label[0] in _TAUGHT
        operands.append(f"to {_exact(positions[label])}" if taught and label else operand)
    tags = sorted(f"{name}={same_number(value)}" for name, value in step.tags)
    coupled = [f"+{_text(move, positions)}" for move in step.coupled]
    return " ".join([step.word, *map(same_number, operands), *tags, *coupled])


def _labels(move: Instruction) -> list[tuple[str, int]]:
    """Return the taught positions of a move itself."""
    found = [read_label(operand) for operand in move.operands]
    return [label for label in found if label is not None and label[0] in _TAUGHT]


def _variables(move: Instruction) -> list[str]:
    """Return the operands that are no taught positions."""
    return [operand for operand in move.operands if not re.fullmatch(r"(BC|EC|C)[0-9]+", operand)]


def _target(position: Position, robot: Robot, plus: str) -> tuple[Coordinate, ...]:
    """Return where a position is, joints in [deg] as far as their ratios are known."""
    values = position.values
    if position.kind not in ROBOT_KINDS:
        group = plus + _GROUPS[position.kind[0]]
        unit = "pulses" if position.coordinates == "PULSE" else "deg"
        return tuple(
            Coordinate(f"{group} {axis}", value, unit) for axis, value in enumerate(values, start=1)
        )
    if position.coordinates == "RECTAN" and len(values) >= 6:
        return pose_coordinates(values[:6])
    names = [*robot.joint_names, "axis 7", "axis 8"]
    scale = PulseScale.of(robot)
    if position.coordinates == "PULSE" and scale.complete and len(values) == len(scale.joint_names):
        per_degree = np.deg2rad(scale.pulses_per_radian)
        return tuple(
            Coordinate(name, value / ratio, "deg")
            for name, value, ratio in zip(names, values, per_degree.tolist(), strict=False)
        )
    unit = "pulses" if position.coordinates == "PULSE" else "deg"
    return tuple(Coordinate(name, value, unit) for name, value in zip(names, values, strict=False))


def _frame(position: Position) -> list[tuple[str, str]]:
    """Return in whose name a position is kept."""
    frame = position.frame or position.coordinates
    found = [("tool", str(position.tool))]
    if position.frame == "USER":
        frame = f"USER {position.user}"
    found.append(("frame", frame))
    if position.coordinates == "RECTAN":
        # numbers of RCONF after the sixth have no meaning
        found.append(("RCONF", ",".join(map(str, position.rconf[:6]))))
    return found


def _exact(position: Position) -> str:
    values = ",".join(f"{value:g}" if value % 1 else f"{value:.0f}" for value in position.values)
    return f"{values} ({', '.join(f'{name} {value}' for name, value in _frame(position))})"
