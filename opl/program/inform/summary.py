"""What a job does, for a person who reads it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from opl.cell.robot import Robot, forward_kinematics
from opl.geometry.frames import Array
from opl.program.inform.job import ROBOT_KINDS, InformJob, Instruction, Position
from opl.program.inform.times import job_configurations
from opl.program.listing import angles_text, pose_text, pose_values

_SIGNAL = re.compile(r"\b(?:IN|OT|IG|OG|AO|AI)#\([^)]*\)")
_SPEEDS = ("VJ", "V", "VR", "VE")


def describe(job: InformJob, robot: Robot, cautions: Sequence[str] = ()) -> list[str]:
    """Return the summary of a job and its instructions in order, one line each.

    Positions in pulses are shown as joint angles and as the pose of the flange in the base frame,
    Cartesian ones as the pose that the file gives. Those of tool 0 in the base frame are shown as
    joint angles too; what other tools and user frames are, only the controller knows. Base and
    station axes are shown as the file gives them: their pulses have ratios of their own.

    Args:
        job: The job.
        robot: Whose job it is taken for.
        cautions: What is wrong with it, for the end of the summary.
    """
    return [*_summary(job), *cautions, "", *_steps(job, robot)]


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
        plural = "s" if count > 1 else ""
        yield f"{count} {kind} position{plural}: {frame}, tool {'?' if tool is None else tool}"
    if job.positions and not any(header.key == "///POSTYPE" for header in job.headers):
        yield "no ///POSTYPE: whole numbers are taken for pulses"
    yield from (f"alias: {text}" for text in job.aliases)
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
                low, high = min(known), max(known)
                spans.append(f"{name} {low:g}" + (f" to {high:g}" if high > low else ""))
        yield ", ".join([f"{len(moves)} {word}", *spans])


def _steps(job: InformJob, robot: Robot) -> Iterator[str]:
    places = {(p.kind, p.number): k for k, p in enumerate(job.positions)}
    q = job_configurations(job, robot, np.eye(4), np.eye(4))
    Ts_base_flange = forward_kinematics(robot, q)
    for step in job.instructions:
        yield f"{step.line:5d}  {job.lines[step.line - 1].expandtabs(2).rstrip()}"
        for label in step.positions if step.moves else ():
            if label in places:
                k = places[label]
                yield from _where(job.positions[k], q[k], Ts_base_flange[k], robot)
            else:
                yield f"       {label[0]}{label[1]:03d} is not in the file, the controller has it"


def _where(position: Position, q: Array, T_base_flange: Array, robot: Robot) -> Iterator[str]:
    label = f"       {position.label}"
    pulses = position.coordinates == "PULSE"
    if position.kind not in ROBOT_KINDS or (pulses and np.isnan(q).any()):
        unit = "pulses" if pulses else "deg"
        yield f"{label} {' '.join(f'{value:.10g}' for value in position.values)} {unit}"
        return
    frame_known = position.frame in ("BASE", "ROBOT") and position.tool == 0
    if not np.isnan(q).any() and (pulses or frame_known):
        yield f"{label} {angles_text(q, robot)}"
        if pulses:
            yield f"{label} flange {pose_text(pose_values(T_base_flange))}"
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
