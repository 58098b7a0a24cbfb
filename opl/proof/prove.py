"""What is proven of a program is what its files say: parsed, played, recognised, replayed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from opl.errors import InputError
from opl.findings import Finding
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.motion.motion import TimedMotion
from opl.program.controller import ControllerProfile
from opl.program.inform.files import program_jobs
from opl.program.inform.playback import play
from opl.program.posts import find_post
from opl.proof.written import written_findings
from opl.verification.recognise import Rule, recognise
from opl.verification.replay import Verification, replay


@dataclass(frozen=True, eq=False)
class Proof:
    """What was found out about the files of a program.

    Attributes:
        files: Names of the files.
        foreign: Names of the user's own jobs that are called and were not looked at.
        moves: Number of moves.
        timed: The motion as recognised and its times, None if the files do not tell one.
        verification: What the replay found, None without a motion.
        findings: What is wrong.
    """

    files: tuple[str, ...]
    foreign: tuple[str, ...]
    moves: int
    timed: TimedMotion | None
    verification: Verification | None
    findings: tuple[Finding, ...]

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
) -> Proof:
    """Prove job files against the cell of a job, knowing nothing of how they were planned.

    Args:
        job: Cell, feed and tolerances.
        points: The cutter points of the job.
        files: Content of the job files, the master and all parts, by what messages call them.
        progress: Told the part of the motion that is replayed, 0 to 1.

    Raises:
        InputError: If the files are no jobs, not those of one program, or of another robot.
    """
    jobs, refused = program_jobs(files, profile_of(job))
    playback, doubtful = play(jobs, job.cell.robot, job.program)
    foreign = tuple(sorted({name for one in jobs.values() for name in one.calls} - jobs.keys()))
    if playback is None:
        return Proof(tuple(files), foreign, 0, None, None, (*refused, *doubtful))
    search = job.search
    rule = Rule(
        search.max_contact_error,
        search.interpolation.max_contact_step,
        job.process.approach_length,
        job.process.approach_turn,
    )
    found = recognise(job.cell, points, playback.q, playback.duration, playback.stations, rule)
    replayed = replay(job.cell, points, found.timed, search.max_contact_error, progress)
    # the written configurations; of one that grinds several cutter points, the last of its rows
    rows = np.searchsorted(found.source, playback.stations, side="right") - 1
    findings = (
        *refused,
        *doubtful,
        *replayed.findings,
        *found.findings,
        *written_findings(job, points, found.timed.take(rows), playback),
    )
    moves = len(playback.visits)
    return Proof(tuple(files), foreign, moves, found.timed, replayed, findings)


def profile_of(job: Job) -> ControllerProfile:
    """Return the Yaskawa controller that a job is for.

    Raises:
        InputError: If it is for another one.
    """
    post = find_post(job.program.controller, f"{job.path}: program.controller")
    if post.profile is None:
        raise InputError(
            f"{job.path}: program.controller",
            f"programs of Yaskawa controllers can be read, not those for {post.title}",
        )
    return post.profile
