"""Programs as they stand in their files, proven."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from opl.errors import InputError
from opl.files.digests import keeps_stamp
from opl.files.reading import read_bytes
from opl.findings import Finding
from opl.geometry.toolpath import CutterPoints
from opl.job.refusals import keys_named
from opl.job.values import Job
from opl.program.posts import find_post
from opl.proof.digest import changed_since, digests_in, other_inputs, read_result
from opl.proof.prove import Proof, prove
from opl.run.job_folder import MOST_RESULT
from opl.run.listings import read_program
from opl.run.proof_result import VerificationReport
from opl.run.reporting import corners_report, replay_report
from opl.run.result import RESULT
from opl.run.surfacing import cut_surface
from opl.run.watch import Stage, Watch


@dataclass(frozen=True, eq=False)
class ProgramProof:
    """What was found out about the files of a program.

    Attributes:
        proof: What the files say, and what the replay of it found.
        as_written: Whether the files are to the byte what a run proved; None if no ``result.json``
            beside them tells.
        changed: Whether they are other bytes than opl once wrote, as the digests in them tell; None
            if they hold none.
        other_inputs: Names of the inputs that are not those the program was made of; None if
            nothing tells.
        report: The same in plain numbers, in mm; None stands for what could not be found out.
    """

    proof: Proof
    as_written: bool | None
    changed: bool | None
    other_inputs: tuple[str, ...] | None
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
    results = {path: _result_beside(path, job) for path in content}
    findings, as_written = _compared_with_results(content, results)
    proof = replace(found, findings=(*found.findings, *findings))
    kept = [keeps_stamp(content[path]) for path in files]
    changed = True if False in kept else None if None in kept else False
    differing = [other_inputs(content[path], job.inputs, results[path]) for path in files]
    others = (
        None
        if None in differing
        else tuple(sorted({n for names in differing for n in names or ()}))
    )
    report = _report(job, points, proof)
    report |= {"as_written": as_written, "changed": changed, "other_inputs": others}
    return ProgramProof(proof, as_written, changed, others, report)


def _report(job: Job, points: CutterPoints, proof: Proof) -> dict[str, Any]:
    found, timed, corners = proof.verification, proof.timed, corners_report(proof.corners)
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
        "corners": None if corners is None else vars(corners),
        "findings": [
            {"kind": one.kind, "where": one.where, "message": one.message} for one in proof.findings
        ],
    }


def _result_beside(path: Path, job: Job) -> Mapping[str, object] | None:
    """Return the result.json beside a file, None if there is none of this job with a program."""
    try:
        result = read_result(read_bytes(path.parent / RESULT, MOST_RESULT))
    except InputError:
        return None
    return result if result.get("job") == job.name and digests_in(result) else None


def _compared_with_results(
    files: Mapping[Path, bytes], results: Mapping[Path, Mapping[str, object] | None]
) -> tuple[list[Finding], bool | None]:
    """Return what differs from what a run wrote, and whether all is as written; None if unknown."""
    findings, known = [], True
    for path, content in files.items():
        result = results[path]
        if result is None:
            known = False
        else:
            findings += changed_since(str(path), content, digests_in(result).values())
    return findings, False if findings else True if known else None
