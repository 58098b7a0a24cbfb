"""Writing INFORM jobs: pulse positions and joint moves, which every controller plays as it is.

Pulse jobs need no option, no user frame and no arm configuration, and leave the controller no
choice between postures. Every job is read back before it is returned.
"""

from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from itertools import zip_longest
from pathlib import Path

import numpy as np

from opl import resources
from opl.errors import InputError
from opl.program.controller import DX200, ControllerProfile
from opl.program.inform.check import find_faults
from opl.program.inform.job import POSITION_KINDS, InformJob, Instruction
from opl.program.inform.parse import parse
from opl.program.layout import fill
from opl.program.moves import Program
from opl.program.pulses import PulseScale
from opl.program.split import split

FILE_SUFFIX = ".JBI"
TEMPLATE = resources.folder("templates") / "inform" / "job.jbi.j2"

STOP_LEVEL = 0
# The finest level that does not stop: a pass must not, or the belt digs in. How far a corner is
# rounded at this level is set in each controller's parameters and not known here; within a pass
# postures lie close and turn little, so there is little corner to round.
BLEND_LEVEL = 1

# Of a template that goes wrong on every line, a few faults tell as much as all.
_FAULTS_SHOWN = 10


def render_jobs(
    program: Program,
    scale: PulseScale,
    date: datetime,
    *,
    tool: int = 0,
    profile: ControllerProfile = DX200,
    template: Path | None = None,
) -> dict[str, str]:
    """Return the job files of a program: one, or a master and the parts it calls.

    Args:
        program: What the robot shall do.
        scale: Pulses and soft limits of the robot.
        date: Date of the job; the same arguments give the same bytes.
        tool: Number of the tool in whose name the positions are kept.
        profile: The controller.
        template: Layout of a job; None for the one that comes with opl.

    Returns:
        Text by file name, line ends CR LF, all ASCII; the first is the job to start.

    Raises:
        InputError: If the name, the tool or a comment is not legal on the controller, or the
            template does not give a job that says what the program says.
        UnsafeError: If a posture is beyond the soft limits.
        OplError: If a pass has more moves than a job can hold.
    """
    return {
        part.name + FILE_SUFFIX: render(
            part, scale, date, tool=tool, profile=profile, template=template
        )
        for part in split(program, profile.step_limit)
    }


def render(
    program: Program,
    scale: PulseScale,
    date: datetime,
    *,
    tool: int = 0,
    profile: ControllerProfile = DX200,
    template: Path | None = None,
) -> str:
    """Return one job; see `render_jobs`, which also splits what is too long for one."""
    template = TEMPLATE if template is None else template
    layout = _Layout(
        name=program.name,
        tool=str(tool),
        date=f"{date:%Y/%m/%d %H:%M}",
        comments=(*program.comments, *_ratio_notes(scale, profile.comment_length)),
        steps=_steps(program, scale, profile),
        calls=program.calls,
    )
    _require_legal(layout, profile)
    text = fill(template, layout.values()).replace("\n", "\r\n")
    faults = find_faults(text, profile) or tuple(_differences(parse(text), layout))
    if faults:
        shown = [*faults[:_FAULTS_SHOWN], *(["..."] if len(faults) > _FAULTS_SHOWN else [])]
        raise InputError(str(template), "\n".join(["does not give the job asked for:", *shown]))
    return text


@dataclass(frozen=True)
class _Step:
    """A position and the move to it, as texts."""

    label: str
    pulses: str
    speed: str
    level: str
    comment: str | None


@dataclass(frozen=True)
class _Layout:
    """What a template gets, and what the job that comes out is compared with."""

    name: str
    tool: str
    date: str
    comments: tuple[str, ...]
    steps: tuple[_Step, ...]
    calls: tuple[str, ...]

    def values(self) -> dict[str, object]:
        counts = [len(self.steps)] + [0] * (len(POSITION_KINDS) - 1)
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        return {**own, "npos": ",".join(map(str, counts))}

    @property
    def all_comments(self) -> tuple[str, ...]:
        return (*self.comments, *(step.comment for step in self.steps if step.comment))


def _steps(program: Program, scale: PulseScale, profile: ControllerProfile) -> tuple[_Step, ...]:
    if not program.moves:
        return ()
    pulses = scale.to_pulses(np.array([move.q for move in program.moves]))
    return tuple(
        _Step(
            label=f"C{number:0{profile.label_digits}d}",
            pulses=",".join(map(str, row)),
            speed=profile.joint_speed_text(move.speed),
            level=str(STOP_LEVEL if move.exact_stop else BLEND_LEVEL),
            comment=move.comment,
        )
        for number, (row, move) in enumerate(zip(pulses.tolist(), program.moves, strict=True))
    )


def _ratio_notes(scale: PulseScale, width: int) -> list[str]:
    """Return the comment lines that warn of ratios nobody has confirmed."""
    if not scale.unverified:
        return []
    return textwrap.wrap(f"PULSE RATIO NOT VERIFIED: {' '.join(scale.unverified)}", width)


def _require_legal(layout: _Layout, profile: ControllerProfile) -> None:
    """Refuse what no template can make legal, before one gets the blame."""
    if not 0 <= int(layout.tool) <= profile.highest_tool:
        raise InputError("tool", f"must be 0 to {profile.highest_tool}, got {layout.tool}")
    for name in (layout.name, *layout.calls):
        if fault := profile.name_fault(name):
            raise InputError("program name", fault)
    for comment in layout.all_comments:
        if fault := profile.comment_fault(comment):
            raise InputError("program comment", fault)


def _differences(job: InformJob, layout: _Layout) -> Iterator[str]:
    """Say where a job does not do what was asked; a template may add, but not to the motion."""
    if job.name != layout.name:
        yield f"the name is {job.name}, must be {layout.name}"
    yield from _first_difference(
        "position",
        [f"{job.lines[p.line - 1]} ({p.coordinates}, tool {p.tool})" for p in job.positions],
        [f"{s.label}={s.pulses} (PULSE, tool {layout.tool})" for s in layout.steps],
    )
    yield from _first_difference(
        "move",
        [_motion_of(move) for move in job.moves],
        [f"MOVJ {s.label} VJ={s.speed} PL={s.level}" for s in layout.steps],
    )
    yield from _first_difference(
        "call", [name for name in job.calls if name in layout.calls], layout.calls
    )
    written = Counter(step.comment for step in job.instructions)
    for comment, times in Counter(layout.all_comments).items():
        if written[comment] < times:
            yield f"comment {comment!r} is missing"
    if any(step.word == "SFTON" for step in job.instructions):
        yield "SFTON shifts the positions that follow"


def _motion_of(move: Instruction) -> str:
    """Return what decides where a move leads and how fast."""
    words = [move.word, *move.operands]
    words += [f"{name}={move.tag(name)}" for name in ("VJ", "PL")]
    return " ".join(words + [f"+{coupled.word}" for coupled in move.coupled])


def _first_difference(what: str, found: Sequence[str], wanted: Sequence[str]) -> Iterator[str]:
    for number, (is_there, should_be) in enumerate(zip_longest(found, wanted), start=1):
        if is_there != should_be:
            yield f"{what} {number}: must be {should_be or 'none'}, is {is_there or 'missing'}"
            return
