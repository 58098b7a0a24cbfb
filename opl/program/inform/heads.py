"""What stands in a job before its instructions: as opl writes it, and what else was found there.

A controller acts on more than the positions: a job without a control group cannot move the robot,
position variables overwrite those of the controller when the job is loaded, and a relative job
follows a frame. A line that opl would not write is a finding, whatever it may mean.
"""

from __future__ import annotations

from collections.abc import Iterator

from opl.findings import Finding, Level
from opl.program.inform.job import InformJob
from opl.program.settings import PositionForm, ProgramSettings

_GROUP = "///GROUP1"
# Lines that decide nothing about the motion, or that the positions after them were read by.
# ///FOLDERNAME and ///LVARS are put there by controllers: a folder, and how many variables of its
# own a job has; instructions that use one are findings.
_KNOWN = (
    *("/JOB", "//NAME", "///FOLDERNAME", "//POS", "///NPOS", "///USER", "///TOOL", "///POSTYPE"),
    *("///PULSE", "///RECTAN", "///RCONF", "//INST", "///DATE", "///COMM", "///ATTR", "////FRAME"),
    *(_GROUP, "///LVARS", "NOP"),
)


def attributes(settings: ProgramSettings, moves: bool) -> str:
    """Return the value of ///ATTR of a job, and of one that only calls others."""
    relative = moves and settings.positions is not PositionForm.PULSES
    return "SC,RW,RJ" if relative else "SC,RW"


def frame(settings: ProgramSettings, moves: bool) -> str | None:
    """Return the value of ////FRAME, None for a job that has none."""
    if not moves or settings.positions is PositionForm.PULSES:
        return None
    user = settings.user_frame
    return settings.positions.value.upper() if user is None else f"USER {user.number}"


def head_findings(job: InformJob, settings: ProgramSettings) -> Iterator[Finding]:
    """Return what is in the head of a job that opl would not write, and what is missing."""
    for line, text in _head(job):
        key = text.split()[0] if text.split() else ""
        if key not in _KNOWN:
            yield _finding(job, line, f"nobody can tell from the file what {text[:40]} leads to")
    for position in job.positions:
        if position.kind in ("P", "BP", "EX"):
            message = f"{position.label} overwrites the variable of that name on the controller"
            yield _finding(job, position.line, message)
    moves = bool(job.moves)
    wanted = {"///ATTR": attributes(settings, moves), "////FRAME": frame(settings, moves)}
    if moves:
        wanted[_GROUP] = "RB1"
    for key, value in wanted.items():
        found = ["".join(text.split()) for text in job.values(key)]
        if found != ([] if value is None else ["".join(value.split())]):
            line = next((header.line for header in job.headers if header.key == key), 1)
            message = f"{key} must be {value or 'left out'}, is {' and '.join(found) or 'missing'}"
            yield _finding(job, line, message)


def _head(job: InformJob) -> Iterator[tuple[int, str]]:
    """Give number and text of each line before the instructions that is no position."""
    positions = {position.line for position in job.positions}
    last = job.instructions[0].line if job.instructions else len(job.lines)
    for line, text in enumerate(job.lines[: last - 1], start=1):
        if line not in positions:
            yield line, text.strip()


def _finding(job: InformJob, line: int, message: str) -> Finding:
    return Finding(Level.ERROR, "program", f"{job.name} line {line}", message)
