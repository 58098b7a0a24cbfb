"""Programs as they stand in their files, proven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from opl.findings import Finding
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.job.refusals import keys_named
from opl.program.posts import find_post
from opl.proof.digest import changed_since, digests_in
from opl.proof.prove import Proof, prove
from opl.run.delivery import RESULT
from opl.run.listings import read_program
from opl.run.reporting import replay_report
from opl.run.result import VerificationReport
from opl.run.surfacing import cut_surface
from opl.run.watch import Stage, Watch


@dataclass(frozen=True, eq=False)
class ProgramProof:
    """What was found out about the files of a program.

    Attributes:
        proof: What the files say, and what the replay of it found.
        as_written: Whether the files are to the byte what a run proved; None if no ``result.json``
            beside them tells.
        report: The same in plain numbers, in mm; None stands for what could not be found out.
    """

    proof: Proof
    as_written: bool | None
    report: dict[str, Any]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is wrong."""
        return self.proof.findings

    @property
    def proven(self) -> bool:
        """Whether the program is safe and complete."""
        return self.proof.proven


def prove_program(job: Job, files: Sequence[Path], watch: Watch | None = None) -> ProgramProof:
    """Prove program files against the cell of a job, knowing nothing of how they were planned.

    Args:
        job: Cell, surface, feed and tolerances.
        files: The files: the master and all parts of a program that is split. Files of frames and
            tools beside them are read with them.
        watch: Follows the work.

    Raises:
        InputError: If a file cannot be read, or the files are not those of one program for the
            controller and the robot of the job.
        Cancelled: If the work was cancelled.
    """
    watch = watch or Watch()
    reader = find_post(job.program.controller).reader
    beside = [
        path.parent / name
        for path in files
        for name in (() if reader is None else reader.companions)
        if (path.parent / name).is_file()
    ]
    content = {path: read_program(path) for path in dict.fromkeys([*files, *beside])}
    points = cut_surface(job, watch).points
    with watch.stage(Stage.VERIFICATION) as progress, keys_named(job.source):
        found = prove(job, points, {str(path): data for path, data in content.items()}, progress)
    changed, as_written = _compared_with_results(content)
    proof = replace(found, findings=(*found.findings, *changed))
    return ProgramProof(proof, as_written, _report(job, points, proof, as_written))


def _report(
    job: Job, points: CutterPoints, proof: Proof, as_written: bool | None
) -> dict[str, Any]:
    found, timed = proof.verification, proof.timed
    replayed = dict.fromkeys(field.name for field in fields(VerificationReport))
    if found is not None:
        replayed = vars(replay_report(found, None)).copy()
    del replayed["file"]
    return {
        "proven": proof.proven,
        "job": job.name,
        "robot": job.cell.robot.name,
        "unverified_pulse_ratios": job.cell.robot.unverified_pulses,
        "files": proof.files,
        "calls_not_looked_at": proof.foreign,
        "positions": proof.moves,
        "cutter_points": len(points),
        "passes": points.n_passes,
        "cutter_points_ground": proof.ground,
        "duration_s": None if timed is None else round(timed.seconds, 3),
        **replayed,
        "findings": [
            {"kind": one.kind, "where": one.where, "message": one.message} for one in proof.findings
        ],
        "as_written": as_written,
    }


def _compared_with_results(files: Mapping[Path, bytes]) -> tuple[list[Finding], bool | None]:
    """Return what differs from what a run wrote, and whether all is as written; None if unknown."""
    findings, known = [], True
    for path, content in files.items():
        try:
            digests = digests_in((path.parent / RESULT).read_bytes())
        except OSError:
            digests = {}
        if path.name in digests:
            findings += changed_since(str(path), content, digests[path.name])
        else:
            known = False
    return findings, False if findings else True if known else None
