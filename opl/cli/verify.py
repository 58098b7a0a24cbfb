"""The command that proves a program as it stands in its files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from opl.console.run import show_proof
from opl.deliver import RESULT
from opl.errors import InputError, UnsafeError
from opl.findings import Finding
from opl.job.load import Job, load
from opl.proof.digest import changed_since, digests_in
from opl.proof.prove import Proof, prove
from opl.surfacing import cut_surface

FILE = click.Path(path_type=Path, readable=False)
MM = 1e3


@click.command()
@click.argument("job", type=FILE)
@click.argument("programs", type=FILE, nargs=-1, required=True, metavar="PROGRAM...")
@click.option("--json", "as_json", is_flag=True, help="Print what was proven as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def verify(job: Path, programs: tuple[Path, ...], as_json: bool, quiet: bool) -> None:
    """Read a program back and prove it against the cell of a job.

    It may be of any controller that opl reads: INFORM, RAPID, KRL, FANUC TP or UR script. Nothing
    is known of how it was planned: its positions are turned back into joint angles, the moves made
    as the controller makes them, and what is ground is recognised from where the part is. Give the
    master and all parts of a program that is split. Beside the result.json of its run, a program
    must be what was written then to the last byte.

    Ends with status 0 if the program is proven, with 4 and the reasons if not.

    Example: opl verify workpieces/v_shape/job.yaml out/V_SHAPE/V_SHAPE.JBI
    """
    loaded = load(job)
    points = cut_surface(loaded).points
    files = {path: _content(path) for path in programs}
    proof = prove(loaded, points, {str(path): content for path, content in files.items()})
    changed, as_written = _compared_with_results(files)
    proof = replace(proof, findings=(*proof.findings, *changed))
    if as_json:
        found = {**told(loaded, len(points), proof), "as_written": as_written}
        click.echo(json.dumps(found, indent=2))
    elif not quiet:
        show_proof(loaded, points, proof, as_written)
    if not proof.proven:
        raise UnsafeError("\n".join(["not proven", *map(str, proof.findings)]))


def told(job: Job, n_points: int, proof: Proof) -> dict[str, Any]:
    """Return what was proven, for other programs; null stands for what could not be told."""
    found, motion = proof.verification, proof.motion
    return {
        "proven": proof.proven,
        "job": job.name,
        "robot": job.cell.robot.name,
        "unverified_pulse_ratios": list(job.cell.robot.unverified_pulses),
        "files": list(proof.files),
        "calls_not_looked_at": list(proof.foreign),
        "positions": proof.moves,
        "cutter_points": n_points,
        "cutter_points_ground": proof.ground,
        "duration_s": None if motion is None else round(float(motion.duration.sum()), 3),
        "engine": None if found is None else found.engine,
        "poses": None if found is None else found.poses,
        "collisions": None if found is None else found.collisions,
        "min_clearance_mm": None if found is None else round(found.min_clearance * MM, 3),
        "max_contact_error_mm": None if found is None else round(found.max_contact_error * MM, 4),
        "limit_violations": None if found is None else found.limit_violations,
        "findings": [
            {"kind": one.kind, "where": one.where, "message": one.message} for one in proof.findings
        ],
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


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from error
