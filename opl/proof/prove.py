"""What is proven of a program is what its files say: read, played, recognised, replayed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from opl.errors import InputError
from opl.files.beside import Beside
from opl.findings import Finding
from opl.geometry.toolpath import CutterPoints
from opl.job import keys
from opl.job.values import Job
from opl.motion.motion import TimedMotion
from opl.program.posts import Reader, find_post, readers
from opl.proof.common_shift import common_shift
from opl.proof.corners import CornerProof, corner_proof
from opl.proof.events import name_findings
from opl.proof.written import written_findings
from opl.verification.recognise import Rule, recognise
from opl.verification.replay import Verification, replay


@dataclass(frozen=True, eq=False)
class Proof:
    """What was found out about the files of a program.

    Attributes:
        files: Names of the files.
        foreign: Names of the user's own programs that are called and were not looked at.
        moves: Number of moves.
        timed: The motion as recognised and its times, None if the files do not tell one.
        verification: What the replay found, None without a motion.
        findings: What is wrong.
        corners: What rounding leaves of it; None where the written points themselves are wrong.
    """

    files: tuple[str, ...]
    foreign: tuple[str, ...]
    moves: int
    timed: TimedMotion | None
    verification: Verification | None
    findings: tuple[Finding, ...]
    corners: CornerProof | None = None

    @property
    def ground(self) -> int:
        """Number of cutter points that are ground."""
        return 0 if self.timed is None else len(self.timed.motion.ground_points)

    @property
    def proven(self) -> bool:
        """Whether the program is safe and complete."""
        return self.timed is not None and not self.findings


def prove(
    job: Job,
    points: CutterPoints,
    files: Mapping[str, bytes],
    progress: Callable[[float], None] = lambda fraction: None,
    beside: Beside | None = None,
) -> Proof:
    """Prove the files of a program against the cell of a job, knowing nothing of its planning.

    Args:
        job: Cell, feed and tolerances.
        points: The cutter points of the job.
        files: Content of all files of the program by what messages call them.
        progress: Gets the part of the motion that is replayed, 0 to 1.
        beside: What may work beside this process, if anything.

    Raises:
        InputError: If the files are not those of one program of the job's controller and robot.
    """
    reader = reader_of(job)
    _require_language(job, files, reader)
    reading = reader.read(files, job.cell.robot, job.program)
    playback = reading.playback
    if playback is None:
        return Proof(tuple(files), reading.foreign, 0, None, None, reading.findings)
    rule = rule_of(job)
    motion = playback.q, playback.duration, playback.stations
    found = recognise(job.cell, points, *motion, rule)
    allowed = job.search.max_contact_error
    replayed = replay(job.cell, points, found.timed, allowed, progress, beside)
    astray = {"order", "contact"} & {one.kind for one in (*replayed.findings, *found.findings)}
    shift = common_shift(job.cell, points, *motion, rule) if astray else None
    findings = (
        *reading.findings,
        *([shift] if shift is not None else []),
        *replayed.findings,
        *found.findings,
        *written_findings(job, points, found.timed.motion, playback, reader),
        *name_findings(job, reading.name),
    )
    moves = len(playback.moves)
    if replayed.findings or found.findings:
        return Proof(tuple(files), reading.foreign, moves, found.timed, replayed, findings)
    corners = corner_proof(job, points, found.timed.motion, playback, beside)
    findings = (*findings, *corners.findings)
    return Proof(tuple(files), reading.foreign, moves, found.timed, replayed, findings, corners)


def rule_of(job: Job) -> Rule:
    """Return by what rule the moves over the wheel of a job's program are recognised."""
    search, process = job.search, job.process
    return Rule(
        search.max_contact_error,
        search.interpolation.max_contact_step,
        process.approach_length,
        process.approach_turn,
        process.approach_run,
        process.feed,
    )


def reader_of(job: Job) -> Reader:
    """Return the reader of the language that a job's program is written in.

    Raises:
        InputError: If programs of its controller cannot be read.
    """
    post = find_post(job.program.controller)
    if post.reader is None:
        where = job.source.at(keys.PROGRAM_CONTROLLER)
        raise InputError(where, f"programs for {post.title} are written, not read back")
    return post.reader


def _require_language(job: Job, files: Mapping[str, bytes], reader: Reader) -> None:
    """Refuse files that by their names are of another language than the job's controller."""
    for name in files:
        suffix = Path(name).suffix.upper()
        if suffix in dict(readers()) and suffix != reader.suffix.upper():
            raise InputError(
                job.source.at(keys.PROGRAM_CONTROLLER),
                f"{job.program.controller} takes {reader.suffix} files, got {name}",
            )
