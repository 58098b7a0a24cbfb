"""Do two jobs do the same? Compared by meaning: labels, dates, comments and layout do not count."""

from __future__ import annotations

import re
from collections.abc import Iterator

from opl.program.events import same_number
from opl.program.inform.job import InformJob, Instruction
from opl.program.listing import changed_lines

_TAUGHT = ("C", "BC", "EC")  # their numbers only tie a move to its position


def differences_in_meaning(first: InformJob, second: InformJob) -> list[str]:
    """Return what differs, one line each: ``-`` stands in the first only, ``+`` in the second."""
    return changed_lines(list(_meaning(first)), list(_meaning(second)))


def _meaning(job: InformJob) -> Iterator[tuple[str, str]]:
    """Give place and meaning of everything that decides what the robot does."""
    yield "name", job.name
    for header in job.headers:
        if header.key.startswith(("///GROUP", "////FRAME", "///FRAME", "///ATTR")):
            yield f"line {header.line}", f"{header.key} {header.value}"
    positions = {(p.kind, p.number): _position(job, k) for k, p in enumerate(job.positions)}
    for step in job.instructions:
        if step.word and step.word != "'" and not step.disabled:
            yield f"line {step.line}", _instruction(step, positions)
    for position in job.positions:
        if position.kind not in _TAUGHT:
            value = positions[position.kind, position.number]
            yield f"line {position.line}", f"{position.kind}{position.number} = {value}"


def _instruction(step: Instruction, positions: dict[tuple[str, int], str]) -> str:
    operands = []
    for operand in step.operands:
        label = re.fullmatch(r"(BC|EC|C)([0-9]+)", operand)
        key = (label[1], int(label[2])) if label else ("", 0)
        operands.append(f"to {positions[key]}" if key in positions else same_number(operand))
    tags = sorted(f"{name}={same_number(value)}" for name, value in step.tags)
    coupled = [f"+{_instruction(move, positions)}" for move in step.coupled]
    return " ".join([step.word, *operands, *tags, *coupled])


def _position(job: InformJob, index: int) -> str:
    position = job.positions[index]
    values = ",".join(f"{value:g}" if value % 1 else f"{value:.0f}" for value in position.values)
    of = [position.frame or position.coordinates, f"tool {position.tool}"]
    if position.frame == "USER":
        of.append(f"user frame {position.user}")
    if position.coordinates == "RECTAN":
        # numbers of RCONF after the sixth have no meaning
        of.append(f"RCONF {','.join(map(str, position.rconf[:6]))}")
    return f"{values} ({', '.join(of)})"
