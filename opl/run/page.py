"""The page of a run: one HTML file that opens from disk and fetches nothing."""

from __future__ import annotations

from opl.report.chart import chart_frame
from opl.report.html import page, section, text
from opl.report.packing import Packer
from opl.run import page_text
from opl.run.page_data import blocked_place, move_to, moves_at, run_data
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
PAINTS = {
    "none": "nothing",
    "t": "contact position",
    "clearance": "clearance",
    "feed": "feed",
    "ridge": "ridge height",
    "pass": "pass",
}
VIEWS = {"cell": "whole cell", "contact": "contact", "axle": "along the axle", "top": "from above"}


def run_page(run: Written | Refused, report: Report) -> str:
    """Return the page of a finished run, whose report it shows.

    Nothing in it depends on when or how fast the run was: the same run gives the same bytes.
    """
    reached = run.proven if isinstance(run, Written) else run.reached
    planned = reached.planned if isinstance(reached, Proven) else reached
    prepared = planned.prepared if isinstance(planned, Planned) else planned
    assert isinstance(prepared, Prepared)
    found = planned if isinstance(planned, Planned) else None
    packer = Packer()
    data = run_data(prepared, found, packer)
    data["marks"] = _marks(run, prepared, found, report)
    job, survey = run.surfaced.job, (prepared if found is None else found).survey
    chart = chart_frame(
        f"{job.name}: what each cutter point is at each contact position",
        prepared.problem.field.contact_positions,
        run.surfaced.points.pass_index,
        job.cell.wheel.flat_end,
        None if found is None else found.timing.timed.motion,
        prepared.fixed.q is not None,
        page_text.legend(survey),
    )
    told = '<p class="told" id="hover" aria-live="polite">&nbsp;</p>'
    body = "\n".join(
        [
            page_text.verdict(report, job),
            view_section(found is not None),
            section(
                "chart-section",
                "Contact chart",
                '<p class="screen">Point to see what a cell is; click, or use the arrow keys, to '
                "pose the robot there.</p>",
                chart,
                told,
                page_text.causes(survey),
            ),
            "" if found is None else _curves_section(),
            page_text.tables(report, job, found),
            page_text.files(report),
        ]
    )
    return page(f"{job.name}: report", body, data, packer.block())


def view_section(moving: bool) -> str:
    """Return the view of the cell with its controls."""
    boxes = [
        ("section", "section through the wheel", False),
        ("line", "line to the nearest pair", True),
        ("frames", "frames", False),
        ("surroundings", "surroundings", True),
    ]
    player = f"""<div class="controls"{"" if moving else " hidden"}>
<button type="button" id="play">play</button>
<input type="range" id="time" min="0" max="1" step="any" value="0" aria-label="time">
<output id="clock"></output>
<label>speed <input type="range" id="speed" min="0" max="6" step="1" value="2">
<output id="speed-text"></output></label></div>"""
    controls = "".join(
        f'<label><input type="checkbox" id="{name}"{" checked" if on else ""}> {label}</label>'
        for name, label, on in boxes
    )
    scale = (
        '<span id="scale" hidden><output id="scale-low"></output><i></i>'
        '<output id="scale-high"></output></span>'
    )
    return section(
        "cell",
        "The cell",
        '<canvas id="view" tabindex="0" role="img" aria-label="the cell in three dimensions; drag '
        'or use the arrow keys to look around; what it shows is said below"></canvas>',
        '<p id="posture" role="status"></p><p id="angles" class="mono"></p>',
        player,
        f'<div class="controls">{_choice("look", "view", VIEWS)}{controls}'
        f"{_choice('paint', 'colour of the passes', PAINTS)}{scale}</div>",
    )


def _curves_section() -> str:
    return section(
        "curves-section",
        "Curves",
        f'<div class="controls">{_choice("curves-of", "show", CURVES)}</div>',
        '<div id="curves"></div>',
    )


def _choice(name: str, label: str, options: dict[str, str]) -> str:
    inside = "".join(
        f'<option value="{key}">{text(said)}</option>' for key, said in options.items()
    )
    return f'<label>{label} <select id="{name}">{inside}</select></label>'


def _marks(
    run: Written | Refused, prepared: Prepared, planned: Planned | None, report: Report
) -> dict[str, dict[str, object]]:
    """Return the places that rows of the page lead to; the page begins at ``start``."""
    home = prepared.problem.process.home.tolist()
    marks: dict[str, dict[str, object]] = {"home": {"q": home, "text": "home"}}
    if planned is not None:
        motion = planned.timing.timed.motion
        for name, point in page_text.slow_marks(report):
            marks[name] = {"move": move_to(motion, point), "text": name}
        if isinstance(run, Refused) and isinstance(run.cause, Verification):
            findings = run.cause.findings
            moves = moves_at(motion, [finding.where for finding in findings])
            for k, (finding, move) in enumerate(zip(findings, moves, strict=True)):
                if move is None:
                    continue
                hit = finding.message.split(": ")[0].split(" and ")
                marks[f"finding-{k}"] = {"move": move, "text": str(finding), "hit": hit}
            first = next((mark for name, mark in marks.items() if "finding" in name), None)
            if first is not None:
                marks["start"] = first
    else:
        place = blocked_place(report.reasons, prepared.survey, prepared.problem.wheel_distance)
        if place is not None:
            t = float(prepared.problem.field.contact_positions[place.pop("position")])
            marks["start"] = {**place, "t": t}
    return marks
