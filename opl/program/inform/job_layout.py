"""What a template of an INFORM job gets, and what the job that comes out is compared with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import zip_longest

from opl.program.inform.job import POSITION_KINDS, InformJob, Instruction

# Name and meaning of everything a template gets, as `opl templates vars` prints it.
VARIABLES = {
    "name": "job name",
    "npos": "the six counts of positions",
    "tool": "tool number",
    "user": "number of the user frame of the positions, none where they are in no user frame",
    "postype": "PULSE, BASE, ROBOT or USER",
    "coordinates": "PULSE or RECTAN",
    "attributes": "SC,RW, and RJ for Cartesian positions",
    "frame": "frame of a job with Cartesian positions, e.g. BASE or USER 3, else none",
    "date": "of the job, to the minute",
    "title": "line about the job, or none",
    "comments": "lines at the top",
    "steps": "each position and the move to it, in order; no steps in a master job",
    "step.label": "of the position, e.g. C00000",
    "step.values": "pulses, or lengths in mm and angles in degrees",
    "step.rconf": "numbers of RCONF where they change, else none",
    "step.word": "MOVJ or MOVL",
    "step.speed": "of the move, e.g. VJ=5.00, V=20.0 or VR=3.0",
    "step.corner": "PL or CR with a space before, empty where the job wants neither",
    "step.ramps": "ACC and DEC with a space before each, empty where the job sets none",
    "step.comment": "line before the move, or none",
    "step.actions": "instructions after the move: outputs, waits, calls, comments",
    "calls": "names of the jobs a master job runs, in order",
}


@dataclass(frozen=True)
class JobStep:
    """A position and the move to it, as texts; see `VARIABLES`."""

    label: str
    values: str
    rconf: str | None
    word: str
    speed: str
    corner: str
    ramps: str
    comment: str | None
    actions: tuple[str, ...]

    @property
    def move(self) -> str:
        """The move, as one line."""
        return f"{self.word} {self.label} {self.speed}{self.corner}{self.ramps}"


@dataclass(frozen=True)
class JobLayout:
    """A job as texts; see `VARIABLES`."""

    name: str
    tool: str
    user: str | None
    postype: str
    coordinates: str
    attributes: str
    frame: str | None
    date: str
    title: str | None
    comments: tuple[str, ...]
    steps: tuple[JobStep, ...]
    calls: tuple[str, ...]

    def values(self) -> dict[str, object]:
        """Return what a template gets."""
        counts = [len(self.steps)] + [0] * (len(POSITION_KINDS) - 1)
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        return {**own, "npos": ",".join(map(str, counts))}

    @property
    def all_comments(self) -> tuple[str, ...]:
        """The lines that only people read."""
        return (*self.comments, *(step.comment for step in self.steps if step.comment))


def differences(job: InformJob, layout: JobLayout) -> Iterator[str]:
    """Say where a job is not what it shall be; a template may add, but not to the motion."""
    if job.name != layout.name:
        yield f"the name is {job.name}, must be {layout.name}"
    yield from _first_difference("position", _positions_read(job), _positions_wanted(layout))
    with_ramps = any(step.ramps for step in layout.steps)
    yield from _first_difference(
        "move",
        [_motion_of(move, with_ramps) for move in job.moves],
        [step.move for step in layout.steps],
    )
    yield from _first_difference(
        "call", [name for name in job.calls if name in layout.calls], layout.calls
    )
    yield from _missing_action(job, layout)
    written = Counter(step.comment for step in job.instructions)
    for comment, times in Counter(layout.all_comments).items():
        if written[comment] < times:
            yield f"comment {comment!r} is missing"
    if layout.title is not None and layout.title not in job.values("///COMM"):
        yield f"title {layout.title!r} is missing"
    if any(step.word == "SFTON" for step in job.instructions):
        yield "SFTON shifts the positions that follow"
    attributes = ",".join(job.values("///ATTR")).split(",")
    if job.positions and ("RJ" in attributes) != (layout.frame is not None):
        yield f"///ATTR is {','.join(attributes)}, must be {layout.attributes}"
    frame = next(job.values("////FRAME"), None)
    if job.positions and frame != layout.frame:
        yield f"////FRAME is {frame or 'missing'}, must be {layout.frame or 'left out'}"


def _positions_read(job: InformJob) -> list[str]:
    rows = []
    for position in job.positions:
        pulses = position.coordinates == "PULSE"
        frame = "PULSE" if pulses else position.frame
        user = position.user if position.frame == "USER" else None
        rconf = None if pulses else ",".join(map(str, position.rconf))
        text = job.lines[position.line - 1]
        rows.append(_position(text, frame, position.tool, user, rconf))
    return rows


def _positions_wanted(layout: JobLayout) -> list[str]:
    rows, rconf = [], None
    for step in layout.steps:
        rconf = step.rconf or rconf
        text = f"{step.label}={step.values}"
        rows.append(_position(text, layout.postype, layout.tool, layout.user, rconf))
    return rows


def _position(text: str, frame: str, tool: object, user: object | None, rconf: str | None) -> str:
    of = [frame, f"tool {tool}"]
    of += [f"user frame {user}"] if user is not None else []
    of += [f"RCONF {rconf}"] if rconf is not None else []
    return f"{text} ({', '.join(of)})"


def _motion_of(move: Instruction, with_ramps: bool) -> str:
    """Return what decides where a move leads and how fast."""
    tags = [
        f"{name}={value}" for name, value in move.tags if with_ramps or name not in ("ACC", "DEC")
    ]
    return " ".join([move.word, *move.operands, *tags, *(f"+{c.word}" for c in move.coupled)])


def _first_difference(what: str, found: Sequence[str], wanted: Sequence[str]) -> Iterator[str]:
    for number, (is_there, should_be) in enumerate(zip_longest(found, wanted), start=1):
        if is_there != should_be:
            yield f"{what} {number}: must be {should_be or 'none'}, is {is_there or 'missing'}"
            return


def _missing_action(job: InformJob, layout: JobLayout) -> Iterator[str]:
    """Say which action is not there, or not after the move it belongs to."""
    wanted = [(step.label, action) for step in layout.steps for action in step.actions]
    found = []
    label = ""
    for step in job.instructions:
        if step.moves and step.operands:
            label = step.operands[0]
        found.append((label, job.lines[step.line - 1].strip(" \t")))
    rest = iter(found)
    for after, action in wanted:
        if (after, action) not in rest:  # goes on where the last one was found
            yield f"{action} is missing after the move to {after}"
            return
