"""The moves of job files in the order a controller makes them, calls followed.

Only what leaves no doubt is followed. Whatever else could change where the robot goes (variables,
shifts, jumps past moves, calls on a condition, words nobody knows) is a finding, never passed over.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from opl.errors import InputError
from opl.findings import Finding, Level
from opl.program.inform.job import InformJob, Instruction, read_label

# Instructions that neither move the robot nor decide what it does next, and those of them at which
# it stands still.
_WAITS = frozenset(["TIMER", "WAIT", "PAUSE"])
_PASSING = frozenset(["DOUT", "DIN", "PULSE", "AOUT", "MSG", "CLS"])
_SPEEDS = {"MOVJ": ("VJ",), "MOVL": ("V", "VR")}
_MOVE_TAGS = frozenset({"VJ", "V", "VR", "PL", "CR", "ACC", "DEC"})
_NUMBER = re.compile(r"[0-9]{1,9}(?:\.[0-9]{1,9})?")


@dataclass(frozen=True)
class Visit:
    """A move of a job to one of its positions.

    Attributes:
        job: The job.
        step: The move.
        position: Index of the position in the job.
    """

    job: InformJob
    step: Instruction
    position: int

    @property
    def place(self) -> str:
        """Job and line, for people."""
        return _place(self.job, self.step)


@dataclass(frozen=True)
class Doing:
    """An instruction of a job that is no move.

    Attributes:
        job: The job.
        step: The instruction.
        waits: Whether the robot stands still for it.
    """

    job: InformJob
    step: Instruction
    waits: bool

    @property
    def place(self) -> str:
        """Job and line, for people."""
        return _place(self.job, self.step)

    @property
    def text(self) -> str:
        """The instruction without the comment behind it."""
        line = self.job.lines[self.step.line - 1].strip()
        comment = self.step.comment
        return line if comment is None else line.removesuffix(f"//{comment.rstrip()}").rstrip()


def first_job(jobs: Mapping[str, InformJob]) -> str:
    """Return the name of the job that no other one calls.

    Raises:
        InputError: If that is not one.
    """
    called = {name for job in jobs.values() for name in job.calls}
    starts = [name for name in jobs if name not in called]
    if len(starts) != 1:
        message = f"start with one job and give those it calls; no job calls {' or '.join(starts)}"
        raise InputError("program", message if starts else "the jobs call each other in a circle")
    return starts[0]


def visits(
    jobs: Mapping[str, InformJob], start: str, foreign: Collection[str]
) -> tuple[list[Visit | Doing], list[Finding]]:
    """Return what is done in order, and what cannot be followed; foreign jobs are the user's own.

    Raises:
        InputError: If a job is called that is not there.
    """
    found: list[Finding] = []
    return list(_follow(jobs, jobs[start], foreign, (), found)), found


def _follow(
    jobs: Mapping[str, InformJob],
    job: InformJob,
    foreign: Collection[str],
    callers: tuple[str, ...],
    found: list[Finding],
) -> Iterator[Visit | Doing]:
    places = {(p.kind, p.number): k for k, p in enumerate(job.positions)}
    for index, step in enumerate(job.instructions):
        if step.disabled or not step.word or step.word == "'":
            continue
        fault = None
        if step.word == "CALL":
            name = _called(step)
            if name is None:
                fault = "calls on a condition or with arguments"
            elif name in (*callers, job.name):
                fault = f"calls {name}, which is running"
            elif name in jobs:
                yield from _follow(jobs, jobs[name], foreign, (*callers, job.name), found)
            elif name in foreign:
                yield Doing(job, step, waits=True)
            else:
                raise InputError(
                    _place(job, step), f"calls {name}, which is not there; have: {', '.join(jobs)}"
                )
        elif step.word in _PASSING or step.word in _WAITS or step.word[0] == "*":
            yield Doing(job, step, step.word in _WAITS)
        elif step.word == "JUMP":
            fault = _jump_fault(job, index)
            yield Doing(job, step, waits=False)
        elif step.word in _SPEEDS:
            fault = _move_fault(step, places)
            if fault is None:
                label = read_label(step.operands[0])
                assert label is not None
                yield Visit(job, step, places[label])
        else:
            fault = f"nobody can tell from the file what {step.word} leads to"
        if fault is not None:
            found.append(Finding(Level.ERROR, "program", _place(job, step), fault))


def _called(step: Instruction) -> str | None:
    plain = len(step.operands) == 1 and step.operands[0].startswith("JOB:") and not step.tags
    return step.operands[0].removeprefix("JOB:") if plain else None


def _jump_fault(job: InformJob, index: int) -> str | None:
    """Say what is wrong with a jump: it may wait, but neither skip nor repeat a move."""
    target = job.instructions[index].operands[:1]
    labels = [k for k, step in enumerate(job.instructions) if (step.word,) == target]
    if len(labels) != 1:
        return "jumps to a label that is not there once"
    low, high = sorted((labels[0], index))
    between = job.instructions[low:high]
    if any(step.moves or step.word == "CALL" for step in between):
        return "jumps past moves"
    return None


def _move_fault(step: Instruction, places: Mapping[tuple[str, int], int]) -> str | None:
    label = read_label(step.operands[0]) if len(step.operands) == 1 else None
    tags = [name for name, _ in step.tags]
    if step.coupled or label is None or not set(tags) <= _MOVE_TAGS or len(set(tags)) < len(tags):
        return f"nobody can tell from the file where this {step.word} leads"
    if {"PL", "CR"} <= set(tags):
        return "has PL and CR, and nobody can tell which of them holds"
    if label[0] != "C" or label not in places:
        return f"moves to {step.operands[0]}, which is no position of the job"
    speeds = [name for name in tags if name in ("VJ", "V", "VR")]
    text = step.tag(speeds[0]) if len(speeds) == 1 else None
    if text is None or speeds[0] not in _SPEEDS[step.word]:
        return f"{step.word} needs one speed, {' or '.join(_SPEEDS[step.word])}"
    if not _NUMBER.fullmatch(text) or not float(text) > 0.0:
        return f"{speeds[0]} must be a number above 0, got {text}"
    return None


def _place(job: InformJob, step: Instruction) -> str:
    return f"{job.name} line {step.line}"
