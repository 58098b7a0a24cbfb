"""What a run's page says first: proven or not, in which cell, made of what, what is assumed."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping

import numpy as np

from opl.cell.robot import Robot
from opl.cell.workcell import WorkCell
from opl.job.values import Job
from opl.report.html import bullets, section, table, text
from opl.run.result import Report

MM = 1e3
SAID = {
    "ok": "Proven: the program may be tried, slowly, away from the belt, first",
    "no_path": "No path: no program was written",
    "unsafe": "Planned, but not proven safe: no program was written",
}
NEVER_PROVEN = (
    "the first move, to home from wherever the robot stands",
    "cables, hoses and people, beyond limits of joints that the cell states",
    "anything that stands in the real cell and not in the job",
    "what the belt removes: force, wear and finish",
)


def verdict(report: Report, job: Job, marks: Container[str]) -> str:
    """Return what became of the job, what was proven, assumed and not proven, made of which files.

    A reason for which there is a mark leads to it.
    """
    proven = report.status == "ok"
    head = (
        f'<header><h1>{text(report.job)}</h1><p class="verdict {"ok" if proven else "bad"}">'
        f"{text(SAID[report.status])}</p></header>"
    )
    names = [f"reason-{k}" for k in range(len(report.reasons))]
    reasons = [name if name in marks else None for name in names]
    found = {"Proven": bullets(_proven(report))}
    if not proven:
        found = {
            "Why not": bullets(report.reasons, reasons),
            "What would help": bullets(_help(report)),
            "Tried, does not help": bullets(report.tried_in_vain),
        }
    conditions = {
        "In this cell": bullets(_cell(job.cell)),
        "Assumed": bullets(_assumed(report, job.cell.robot)),
        "Not proven": bullets(NEVER_PROVEN),
        "Warnings": bullets(report.warnings),
    }
    if proven:
        answer = section("verdict", "What was found", _columns({**found, **conditions}))
    else:  # where it failed comes first
        answer = section("verdict", "What was found", _columns(found))
        answer += section("conditions", "Cell, assumptions and limits", _columns(conditions))
    return head + answer + _files(report)


def _columns(lists: Mapping[str, str]) -> str:
    """Return lists side by side, each under its name; empty ones are left out."""
    inside = "".join(
        f"<div><h3>{text(name)}</h3>{lines}</div>" for name, lines in lists.items() if lines
    )
    return f'<div class="columns">{inside}</div>'


def signature() -> str:
    """Return room for a signature, on paper only."""
    return '<p class="paper">Checked by: <i></i> Date: <i></i></p>'


def _files(report: Report) -> str:
    """Return what the run was made of and what it wrote, with digests, and what made it."""
    made = f"made by opl {report.opl}"
    if report.verification is not None:
        made += f", replayed in {report.verification.engine}"
    heads = ("", "SHA-256")
    outputs = {} if report.program is None else report.program.sha256
    tables = (
        table(
            "inputs: job and cell by what they say, other files by their bytes",
            heads,
            list(report.inputs.items()),
            kind="words digests",
        ),
        table("files written", heads, list(outputs.items()), kind="words digests"),
    )
    beside = f'<div class="beside">{"".join(tables)}</div>'
    return section("files", "Files", f"<p>{text(made)}</p>", beside)


def _proven(report: Report) -> Iterator[str]:
    found, program = report.verification, report.program
    if found is not None:
        yield (
            f"{found.engine} replayed {found.poses} poses: {found.collisions} collisions, "
            f"clearance {found.min_clearance_mm:.3f} mm or more, contact error "
            f"{found.max_contact_error_mm:.4f} mm at most, {found.limit_violations} limit "
            "violations"
        )
        if found.file is not None and found.file.proven:
            yield (
                f"read back from {', '.join(found.file.files)}: {found.file.postures} "
                "configurations, moves and speeds are those proven"
            )
            corners = found.file.corners
            if corners is not None:
                yield (
                    f"{corners.rounded} corners, however the controller rounds them inside their "
                    f"zones: contact error {corners.max_contact_error_mm:.4f} mm at most"
                )
    if program is not None and not program.read_back:
        yield "of the file itself nothing: opl has no reader for this controller"


def _help(report: Report) -> Iterator[str]:
    yield from report.remedies
    if not report.remedies:
        yield "no single change that was tried opens the job; the chart shows what is in the way"


def _cell(cell: WorkCell) -> Iterator[str]:
    wheel = cell.wheel
    yield f"robot {cell.robot.title}"
    yield (
        f"wheel {MM * wheel.width:g} mm wide, radius {MM * wheel.radius:g} mm, roll up to "
        f"{np.rad2deg(wheel.max_roll):g} deg about its edges; the part may sink "
        f"{MM * cell.max_belt_penetration:g} mm into the belt"
    )
    yield f"around it: {', '.join(body.name for body in cell.obstacles) or 'nothing'}"
    yield f"held: part, {', '.join(body.name for body in cell.fixture) or 'nothing else'}"
    yield f"clearance of {MM * cell.required_clearance:g} mm, or as the cell says of single pairs"


def _assumed(report: Report, robot: Robot) -> Iterator[str]:
    if report.robot.unverified_pulse_ratios:
        joints = ", ".join(report.robot.unverified_pulse_ratios)
        yield f"pulse ratios of {joints}: never confirmed on this robot"
    if robot.acceleration_assumed:
        yield "accelerations of the joints, and with them feed and cycle time"
    if robot.position_level_zones is not None:
        zones = ", ".join(f"{MM * zone:g}" for zone in robot.position_level_zones)
        yield f"corner zones of position levels 1 to 8: {zones} mm, as its file has them"
    file = report.verification.file if report.verification is not None else None
    if robot.position_level_zones is None or (
        file is not None and file.corners is not None and file.corners.zones_unknown
    ):
        yield "corner zones: where nobody says how wide, half of a move is taken"
    yield "rounded corners: no move is left before half-way, none overshot"
    yield "calibration: wheel, gripper and part are where the job says"
