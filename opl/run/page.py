"""The page of a run: one HTML file that opens from disk and fetches nothing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from opl.cell.drawn_cell import drawn_solids
from opl.cell.workcell import PART, WHEEL
from opl.motion.motion import Motion
from opl.planning.survey import NodeSurvey
from opl.report.chart import chart_frame
from opl.report.drawn import thinned_meshes
from opl.report.html import bullets, page, section, text
from opl.report.packing import Packer
from opl.report.view_frame import BOXES, choice, hover, view_frame
from opl.run import page_tables, page_text
from opl.run.page_data import (
    blocked_place,
    colliding,
    drawn_run,
    extremes,
    move_to,
    moves_at,
    slow_marks,
)
from opl.run.result import Report
from opl.run.values import Planned, Prepared, Proven, Refused, Written
from opl.verification.replay import Verification

CURVES = {
    "joints": "joint angles",
    "speeds": "joint speeds",
    "accelerations": "joint accelerations",
    "feed": "feed and contact position",
    "clearance": "clearance",
}

# of a line in a program, as readers name it: job or file, line, and more
_PLACE = re.compile(r"(?P<source>.+?) line (?P<line>\d+)")


def run_page(run: Written | Refused, report: Report) -> str:
    """Return the page of a finished run, whose report it shows.

    Nothing in it depends on when or how fast the run was: the same run gives the same bytes.
    """
    reached = run.proven if isinstance(run, Written) else run.reached
    planned = reached.planned if isinstance(reached, Proven) else reached
    prepared = planned.prepared if isinstance(planned, Planned) else planned
    assert isinstance(prepared, Prepared)
    found = planned if isinstance(planned, Planned) else None
    drawn = drawn_run(prepared, prepared.survey, None) if found is None else found.drawn.value()
    data, packer = dict(drawn.data), drawn.packer.copy()
    data["marks"] = _marks(run, prepared, found, report)
    if {PART, WHEEL} & set(data["marks"].get("start", {}).get("hit", ())):  # seen from close by
        data["views"] = {"contact": data["views"]["contact"], **data["views"]}
    job, survey = run.surfaced.job, (prepared if found is None else found).survey
    data["program"] = _program(run, packer)
    motion = None if found is None else found.timed.motion
    paints = ["none", *data["paints"]]
    body = "\n".join(
        [
            page_text.verdict(report, job, data["marks"]),
            '<div class="bench">',
            view_frame("The cell", data["views"], paints, BOXES, found is not None),
            '<div class="rest">',
            bullets(
                f"{name} is drawn with fewer triangles than it is proven with"
                for name in thinned_meshes(drawn_solids(job.cell))
            ),
            section(
                "chart-section",
                "Contact chart",
                '<p class="screen">Point to see what a cell is; click, or use the arrow keys, to '
                "pose the robot there.</p>",
                _chart(prepared, drawn.chart, survey, motion),
                hover(),
                page_tables.causes(survey),
            ),
            "" if found is None else _curves_section(),
            page_tables.figures(report, job, found),
            _program_section(run),
            page_text.signature(),
            "</div></div>",
        ]
    )
    return page(f"{job.name}: report", body, data, packer.block())


def _chart(prepared: Prepared, image: str, survey: NodeSurvey, motion: Motion | None) -> str:
    job = prepared.surfaced.job
    title = f"{job.name}: what each cutter point is at each contact position"
    return chart_frame(
        title,
        image,
        prepared.problem.field.contact_positions,
        prepared.surfaced.points.pass_index,
        job.cell.wheel.flat_end,
        motion,
        prepared.fixed.q is not None,
        page_tables.legend(survey),
    )


def _curves_section() -> str:
    return section(
        "curves-section",
        "Curves",
        f'<div class="controls">{choice("curves-of", "show", CURVES)}</div>',
        '<p class="screen">Blue: found; grey dashes: contact kept at t = 0; band: range on the '
        "wheel; red dashes: limits, where a curve comes near; orange: feed lowered. Point to read, "
        "click to pose the robot there.</p>",
        '<div id="curves"></div>',
    )


def _program(run: Written | Refused, packer: Packer) -> dict[str, object] | None:
    """Return the texts of a program, and the move that each of their lines ends."""
    names = _listed(run)
    if not names or not isinstance(run, Written) or run.read_back is None:
        return None
    by_source = {Path(name).stem: k for k, name in enumerate(names)}
    by_source |= {name: k for k, name in enumerate(names)}
    lines = []
    for move, place in zip(run.program.moves, run.read_back.places, strict=True):
        found = _PLACE.match(place)
        if found is not None and found["source"] in by_source:
            lines.append((by_source[found["source"]], int(found["line"]), move.motion_index))
    texts = [packer.text(run.files[name]) for name in names]
    return {"texts": texts, "lines": packer.counts(np.array(lines).reshape(-1, 3))}


def _program_section(run: Written | Refused) -> str:
    listings = "".join(
        f'<h3>{text(name)}</h3><pre id="program-{k}" tabindex="0" aria-label="{text(name)}"></pre>'
        for k, name in enumerate(_listed(run))
    )
    if not listings:
        return ""
    hint = (
        "A click on the line of a move, or the arrow keys, pose the robot at its end; what is "
        "played is marked."
    )
    return section("program", "Program", f"<p>{hint}</p>", listings)


def _listed(run: Written | Refused) -> list[str]:
    """Return the names of the program files that were read back and are delivered."""
    if not isinstance(run, Written) or run.read_back is None:
        return []
    return [name for name in run.read_back.files if name in run.files]


def _marks(
    run: Written | Refused, prepared: Prepared, planned: Planned | None, report: Report
) -> dict[str, dict[str, object]]:
    """Return the places that rows of the page lead to; the page begins at ``start``."""
    home = prepared.problem.process.home.tolist()
    marks: dict[str, dict[str, object]] = {"home": {"q": home, "text": "home"}}
    if planned is not None:
        motion = planned.timed.motion
        for name, said, extreme in extremes(report):
            q = np.deg2rad(extreme.joints_deg).tolist()
            marks[name] = {"q": q, "text": said, "hit": extreme.subject.split(" and ")}
        for name, point in slow_marks(report):
            marks[name] = {"move": move_to(motion, point), "text": name}
        if isinstance(run, Refused) and isinstance(run.cause, Verification):
            findings = run.cause.findings
            moves = moves_at(motion, [finding.where for finding in findings])
            for k, (finding, move) in enumerate(zip(findings, moves, strict=True)):
                if move is not None:
                    hit = finding.message.split(": ")[0].split(" and ")
                    marks[f"reason-{k}"] = {"move": move, "text": str(finding), "hit": hit}
    else:
        t = prepared.problem.field.contact_positions
        for k, reason in enumerate(report.reasons):
            place = blocked_place(reason, prepared.survey, prepared.problem.wheel_distance)
            if place is not None:
                point, position = place
                at = {"point": point, "t": float(t[position])}
                hit = colliding(prepared.survey, place)
                marks[f"reason-{k}"] = {**at, "text": reason, "hit": hit}
    first = next((mark for name, mark in marks.items() if name.startswith("reason-")), None)
    return marks if first is None else {**marks, "start": first}
