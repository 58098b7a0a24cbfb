"""The end of a run: the texts that will be written are read back and compared with the proof.

The configurations of a motion are rounded to the digits of the language before they are proven
(`in_file_digits`), so what is read back must be the proven motion itself, to the last bit. Where it
is not, because straight moves lead between the same configurations on other paths, the files are
proven on their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from opl.cell.part_tree import PartTree
from opl.cell.robot import SAME_CONFIGURATION, forward_kinematics
from opl.files.beside import Beside
from opl.findings import Finding, Level
from opl.geometry.frames import Array, transform
from opl.geometry.mesh import box_corners
from opl.geometry.toolpath import CutterPoints
from opl.job.values import Job
from opl.motion.motion import Motion, VerifiedMotion
from opl.planning.positions import PositionRule
from opl.program.moves import Program
from opl.program.played import Playback
from opl.program.posts import find_post
from opl.proof.corners import CornerProof, corner_proof
from opl.proof.events import name_findings
from opl.proof.prove import prove, rule_of
from opl.proof.roundings import tool_points_of
from opl.proof.too_wide import TooWide
from opl.proof.written import written_findings
from opl.verification.kinematic_checks import limit_findings, missing_points
from opl.verification.recognise import recognise
from opl.verification.seen import Seen

EXACT = 1e-9  # [rad] of round-off between a configuration and itself, read back


@dataclass(frozen=True)
class FileProof:
    """What was found when the files of a run were read back.

    Attributes:
        files: Names of the program's files.
        configurations: Number of configurations in them, in order, repeated ones once.
        largest_rounding: Farthest in [m] that rounding to the digits of the file moved any corner
            of the box around the part, before the proof.
        largest_difference: Farthest in [m] that a corner is, at a configuration read back, from
            where it was proven; 0 if they are one.
        replayed: Whether the files were proven anew on their own.
        findings: What is wrong.
        places: File and line of the move to each configuration, for people; none where the files
            do not hold as many as were proven.
        corners: What rounding leaves of them; None where something else is wrong.
    """

    files: tuple[str, ...]
    configurations: int
    largest_rounding: float
    largest_difference: float
    replayed: bool
    findings: tuple[Finding, ...]
    places: tuple[str, ...] = ()
    corners: CornerProof | None = None

    @property
    def proven(self) -> bool:
        """Whether the files say what was proven."""
        return not self.findings

    def stops(self, program: Program) -> frozenset[int]:
        """Return which positions must not be rounded, as their moves count the motion."""
        near = () if self.corners is None else self.corners.stops
        return frozenset(
            move.motion_index
            for move, place in zip(program.moves, self.places, strict=bool(self.places))
            if place in near
        )


def in_file_digits(motion: Motion, job: Job) -> Motion:
    """Return a motion whose configurations the digits of the job's program can express.

    As it is where programs of the controller cannot be read: nobody knows their digits.

    Raises:
        UnsafeError: If a configuration cannot be expressed.
    """
    reader = find_post(job.program.controller).reader
    if reader is None:
        return motion
    return replace(motion, q=reader.rounded(motion.q, job.cell.robot, job.program))


def position_rule(job: Job, points: CutterPoints, part: PartTree) -> PositionRule:
    """Return what the written positions of a job have to keep."""
    search, post = job.search, find_post(job.program.controller)
    corners = None if post.reader is None else post.reader.corners(job.program, job.cell.robot)
    zone = np.inf if corners is None else corners.on_wheel.zone
    return PositionRule(
        search.max_contact_error,
        search.max_contact_error - search.interpolation.max_contact_error,
        post.shortest_move,
        zone,
        tool_points_of(job),
        TooWide(job, points, part, zone),
    )


def read_back(
    job: Job,
    points: CutterPoints,
    planned: Motion,
    verified: VerifiedMotion,
    program: Program,
    texts: Mapping[str, str],
    seen: Seen | None = None,
    beside: Beside | None = None,
) -> FileProof | None:
    """Compare the texts of a program with what was proven; None if they cannot be read.

    Args:
        job: The job.
        points: Its cutter points.
        planned: The motion before its configurations were rounded and chosen.
        verified: What was proven.
        program: The moves that were to be written.
        texts: All files of the run.
        seen: What was seen of the configurations that were to be written, if anything.
        beside: What may work beside this process, if anything.
    """
    reader = find_post(job.program.controller).reader
    if reader is None:
        return None
    files = {
        name: text.encode("utf-8")
        for name, text in texts.items()
        if name.endswith(reader.suffix) or name in reader.companions
    }
    reading = reader.read(files, job.cell.robot, job.program)
    playback, findings = reading.playback, reading.findings
    positions = verified.motion.positions
    rounding = _apart(job, planned.q[positions], verified.motion.q[positions])
    if playback is None:
        return FileProof(tuple(files), 0, rounding, 0.0, False, findings)
    kept = _without_repeats(playback)
    configurations = [move.motion_index for move in program.moves]
    if len(kept.stations) != len(configurations):
        message = f"{len(kept.stations)} configurations read back, {len(configurations)} proven"
        findings = (*findings, Finding(Level.ERROR, "file", "program", message))
        return FileProof(tuple(files), len(kept.stations), rounding, 0.0, False, findings)
    q, proven = kept.q[kept.stations], verified.motion.q[configurations]
    difference = np.abs(q - proven).max()
    other_paths = difference > EXACT or len(kept.stations) < len(kept.q)
    findings = (*findings, *_differences(kept, program))
    if other_paths:
        proof = prove(job, points, files, beside=beside)
        findings, corners = (*findings, *proof.findings), proof.corners
    else:
        # what the moves mean is recognised anew, as `opl verify` does it: the same findings
        played = playback.q, playback.duration, playback.stations
        found = recognise(job.cell, points, *played, rule_of(job), seen)
        motion = found.timed.motion
        corners = corner_proof(job, points, motion, playback, beside)
        findings = (
            *findings,
            *found.findings,
            *missing_points(points, motion),
            *corners.findings,
            *limit_findings(job.cell, found.timed),
            *written_findings(job, points, motion, playback, reader),
            *name_findings(job, reading.name),
        )
    apart = _apart(job, q, proven) if difference > EXACT else 0.0
    places = tuple(move.place for move in kept.moves)
    anew = bool(other_paths)
    return FileProof(tuple(files), len(q), rounding, apart, anew, findings, places, corners)


def _without_repeats(playback: Playback) -> Playback:
    """Leave out the moves of no length with which the parts of a program begin."""
    q = playback.q[playback.stations]
    moved = np.abs(np.diff(q, axis=0)).max(axis=1) > SAME_CONFIGURATION
    kept = np.flatnonzero(np.concatenate([[True], moved]))
    # such a move is one configuration of no duration, wherever it stands
    gone = np.delete(playback.stations, kept)
    all_but = np.delete(np.arange(len(playback.q)), gone)
    # of several moves that end at one place the first is kept
    own = np.searchsorted(kept, np.arange(len(playback.moves)), side="right") - 1
    return Playback(
        playback.q[all_but],
        playback.duration[all_but],
        np.searchsorted(all_but, playback.stations[kept]),
        tuple(playback.moves[k] for k in kept),
        tuple(
            replace(event, after=int(own[event.after]) if event.after >= 0 else event.after)
            for event in playback.events
        ),
    )


def _differences(playback: Playback, program: Program) -> Iterator[Finding]:
    """Give what differs, move by move: where it leads, how, and whether it stops."""
    for k, (read, move) in enumerate(zip(playback.moves, program.moves, strict=True)):
        away = np.abs(playback.q[playback.stations[k]] - move.q)
        messages = []
        if (away > read.resolution).any():
            messages.append(
                f"leads {np.rad2deg(away.max()):.4f} deg away from the proven configuration"
            )
        if read.straight and not move.straight:
            messages.append("is straight, a joint move was proven")
        if move.exact_stop and not read.corner.exact_stop:
            messages.append("does not stop")
        for message in messages:
            yield Finding(Level.ERROR, "file", read.place, message)


def _apart(job: Job, q: Array, other: Array) -> float:
    """Return the farthest in [m] that a corner of the part's box is moved between two ``q``."""
    cell = job.cell
    corners = box_corners(cell.part.vertices)
    places = [
        transform((forward_kinematics(cell.robot, p) @ cell.T_flange_workpiece)[:, None], corners)
        for p in (q, other)
    ]
    return float(np.linalg.norm(places[0] - places[1], axis=-1).max(initial=0.0))
