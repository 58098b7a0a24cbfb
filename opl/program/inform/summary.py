"""What a job does, for a person who reads it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.program.inform.job import POSITION_KINDS, InformJob, Instruction, Position
from opl.program.inform.times import job_configurations
from opl.program.listing import angles_text, pose_text, pose_values

_SIGNAL = re.compile(r"\b(?:IN|OT|IG|OG|AO|AI)#\([^)]*\)")
_SPEEDS = ("VJ", "V", "VR", "VE")


def describe(job: InformJob, robot: Robot) -> list[str]:
    """Return the summary of a job and its instructions in order, one line each.

    Positions in pulses are shown as joint angles and as the pose of the flange in the base frame,
    Cartesian ones as the pose that the file gives. Those of tool 0 in the base frame are shown as
    joint angles too; what other tools and user frames are, only the controller knows.
    """
    return [*_summary(job), "", *_steps(job, robot)]


def _summary(job: InformJob) -> Iterator[str]:
    dates = ", ".join(job.values("///DATE"))
    groups = [header.value for header in job.headers if header.key.startswith("///GROUP")]
    about = [f"job {job.name}", dates, *(f"group {group}" for group in groups)]
    about += [f"attributes {value}" for value in job.values("///ATTR")]
    about += [f"frame {value}" for value in job.values("////FRAME")]
    yield ", ".join(part for part in about if part)
    yield from (f"comment: {text}" for text in job.values("///COMM"))
    kinds = Counter((p.kind, p.frame or p.coordinates or "unknown", p.tool) for p in job.positions)
    for (kind, frame, tool), count in sorted(kinds.items(), key=str):
        yield f"{count} {kind} positions: {frame}, tool {'unknown' if tool is None else tool}"
    counts = tuple(sum(p.kind == kind for p in job.positions) for kind in POSITION_KINDS)
    if job.npos and job.npos != counts:
        yield f"caution: ///NPOS is {_listed(job.npos)}, there are {_listed(counts)}"
    yield from _moves(job)
    for title, texts in (
        ("calls", job.calls),
        ("signals", [s for step in job.instructions for s in _signals(job, step)]),
        ("switched off", [f"line {s.line}" for s in job.instructions if s.disabled]),
    ):
        if texts:
            yield f"{title}: {', '.join(dict.fromkeys(texts))}"


def _moves(job: InformJob) -> Iterator[str]:
    for word in dict.fromkeys(move.word for move in job.moves):
        moves = [move for move in job.moves if move.word == word]
        spans = []
        for name in _SPEEDS:
            values = [_number(move.tag(name)) for move in moves]
            known = [value for value in values if value is not None]
            if known:
                spans.append(f"{name} {min(known):g} to {max(known):g}")
        yield ", ".join([f"{len(moves)} {word}", *spans])


def _steps(job: InformJob, robot: Robot) -> Iterator[str]:
    places = {(p.kind, p.number): k for k, p in enumerate(job.positions)}
    q = job_configurations(job, robot, np.eye(4), np.eye(4))
    for step in job.instructions:
        yield f"{step.line:5d}  {job.lines[step.line - 1].expandtabs(2).rstrip()}"
        for label in step.positions:
            if label in places:
                yield from _where(job.positions[places[label]], q[places[label]], robot)


def _where(position: Position, q: np.ndarray, robot: Robot) -> Iterator[str]:
    label = f"       {position.label}"
    pulses = position.coordinates == "PULSE"
    frame_known = position.frame in ("BASE", "ROBOT") and position.tool == 0
    if not np.isnan(q).any() and (pulses or frame_known):
        yield f"{label} {angles_text(q, robot)}"
        if pulses:
            yield f"{label} flange {pose_text(pose_values(forward_kinematics(robot, q)))}"
    if not pulses:
        frame = f"USER {position.user}" if position.frame == "USER" else position.frame or "?"
        known = len(position.values) >= 6
        shown = pose_text(position.values[:6]) if known else _listed(position.values)
        yield f"{label} in {frame}: {shown}"


def _signals(job: InformJob, step: Instruction) -> list[str]:
    return [] if step.word == "'" else _SIGNAL.findall(job.lines[step.line - 1])


def _number(text: str | None) -> float | None:
    return float(text) if text and re.fullmatch(r"[0-9]{1,9}(?:\.[0-9]{1,9})?", text) else None


def _listed(values: tuple[float, ...]) -> str:
    return ",".join(f"{value:g}" for value in values)
