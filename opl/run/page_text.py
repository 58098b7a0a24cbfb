"""The words and tables of a run's page; every figure is that of its `Report`."""

from __future__ import annotations

from collections.abc import Container, Iterator, Sequence

import numpy as np

from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.wheel import ContactWheel
from opl.job.load import Job
from opl.planning.survey import NodeState, NodeSurvey
from opl.report.html import bars, bullets, section, table, text
from opl.run.descriptions import pendant_figures
from opl.run.page_data import extremes, slow_marks
from opl.run.result import FiguresReport, Report
from opl.run.values import Planned

MM = 1e3
NAMES = {
    "fixed": "contact fixed at t = 0",
    "paper_start": "recursive, paper's start",
    "recursive": "recursive, best start",
    "optimal": "optimal",
}
NEVER_PROVEN = (
    "the first move, to home from wherever the robot stands",
    "cables, hoses and people, beyond limits of joints that the cell states",
    "anything that stands in the real cell and not in the job",
    "how the controller rounds corners between exact stops: limited by the program, not proven",
    "what the belt removes: force, wear and finish",
)


def verdict(report: Report, job: Job, marks: Container[str]) -> str:
    """Return what became of the job, what was proven, assumed and not proven.

    A reason for which there is a mark leads to it.
    """
    proven = report.status == "ok"
    said = {
        "ok": "Proven: the program may be tried, slowly, away from the belt, first",
        "no_path": "No path: no program was written",
        "unsafe": "Planned, but not proven safe: no program was written",
    }[report.status]
    head = (
        f'<header><h1>{text(report.job)}</h1><p class="verdict {"ok" if proven else "bad"}">'
        f"{text(said)}</p></header>"
    )
    columns = [
        ("Proven", _proven(report)),
        ("In this cell", _cell(job.cell)),
        ("Assumed", _assumed(report, job)),
        ("Not proven", iter(NEVER_PROVEN)),
    ]
    if not proven:
        columns[:1] = [("Why not", iter(report.reasons)), ("What would help", _help(report))]
    names = [f"reason-{k}" for k in range(len(report.reasons))]
    reasons = [name if name in marks else None for name in names]
    lists = "".join(
        f"<div><h3>{text(name)}</h3>{bullets(lines, reasons if name == 'Why not' else ())}</div>"
        for name, lines in columns
    )
    return head + section("verdict", "What was found", f'<div class="columns">{lists}</div>')


def files(report: Report) -> str:
    """Return the files of the run with their digests."""
    if report.program is None:
        return ""
    rows = [(name, digest) for name, digest in report.program.sha256.items()]
    return section(
        "files", "Files", table("SHA-256 of what was written", ("", ""), rows, (), "words")
    )


def tables(report: Report, job: Job, planned: Planned | None) -> str:
    """Return the comparison, the cycle, slow stretches, and what is typed in at the controller."""
    names = job.cell.robot.joint_names
    extreme = extremes(report)
    return section(
        "figures",
        "Figures",
        bullets([said for _, said, _ in extreme], [mark for mark, _, _ in extreme]),
        _comparison(report, names),
        "" if report.path is None else bullets(_certified(report)),
        _cycle(report),
        _slow(report),
        _frames(job),
        "" if planned is None else _where_on_wheel(planned, job.cell.wheel),
        bullets(report.warnings),
    )


def causes(survey: NodeSurvey) -> str:
    """Return how many nodes are free, and what rules out the others."""
    states = list(NodeState)
    counts = np.bincount(survey.states.ravel(), minlength=len(states))
    rows = [
        (state.value, int(counts[code]), f"{100.0 * counts[code] / survey.states.size:.2f} %")
        for code, state in enumerate(states)
        if counts[code]
    ]
    hits = np.bincount(survey.hit[survey.hit >= 0], minlength=len(survey.pairs))
    for k in np.argsort(-hits, kind="stable")[:8]:
        share = f"{100.0 * hits[k] / survey.states.size:.2f} %"
        rows.append((f"of these: {' and '.join(survey.pairs[k])}", int(hits[k]), share))
    return table("every cutter point at every contact position", ("", "nodes", "share"), rows)


def legend(survey: NodeSurvey) -> list[tuple[int, str, float]]:
    """Return code, name and share of the states that there are."""
    counts = np.bincount(survey.states.ravel(), minlength=len(NodeState))
    return [
        (code, state.value, float(counts[code] / survey.states.size))
        for code, state in enumerate(NodeState)
        if counts[code]
    ]


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


def _assumed(report: Report, job: Job) -> Iterator[str]:
    robot = job.cell.robot
    if report.robot.unverified_pulse_ratios:
        joints = ", ".join(report.robot.unverified_pulse_ratios)
        yield f"pulse ratios of {joints}: never confirmed on this robot"
    if robot.acceleration_assumed:
        yield "accelerations of the joints, and with them feed and cycle time"
    yield "calibration: wheel, gripper and part are where the job says"


def _comparison(report: Report, joint_names: Sequence[str]) -> str:
    figures: list[FiguresReport] = list(report.compared.values())
    rows: list[tuple[object, ...]] = [
        (joint, *(f"{one.joint_ranges_rad[k]:.6f}" for one in figures))
        for k, joint in enumerate(joint_names)
        if figures
    ]
    if figures:
        rows.append(("sum", *(f"{one.joint_range_sum_rad:.6f}" for one in figures)))
        rows.append(("joint travel", *(f"{one.joint_travel_rad:.4f}" for one in figures)))
        rows.append(("travel of t", *(f"{one.contact_travel:.1f}" for one in figures)))
        rows.append(("time on wheel, s", *(f"{one.seconds_on_wheel:.2f}" for one in figures)))
    heads = [NAMES.get(name, name) for name in report.compared]
    if not report.fixed.feasible and "fixed" in report.compared:
        heads[list(report.compared).index("fixed")] += " (not feasible)"
    return table("joint ranges along the path, in rad", ("", *heads), rows)


def _certified(report: Report) -> Iterator[str]:
    path = report.path
    assert path is not None
    if path.lower_bound_rad is not None and path.gap is not None:
        yield (
            f"lower bound {path.lower_bound_rad:.6f} rad, gap {100.0 * path.gap:.4f} %: no motion "
            "along these passes has a smaller joint range sum, at any contact positions, each pass "
            "on one IK branch and count of full turns (approach, links and retract not counted)"
        )
    if not report.fixed.feasible:
        yield f"contact fixed at t = 0 is not feasible: {report.fixed.reason}"
    yield (
        f"{report.cutter_points} cutter points in {report.passes} passes, "
        f"{path.intermediate_nodes} intermediate nodes, IK branch {path.branch}"
    )


def _cycle(report: Report) -> str:
    cycle = report.cycle
    if cycle is None:
        return ""
    rows = [
        ("on the wheel", f"{cycle.passes_s:.3f}"),
        ("to it and away", f"{cycle.approach_and_retract_s:.3f}"),
        ("in the air", f"{cycle.air_s:.3f}"),
        ("waiting", f"{cycle.waits_s:.3f}"),
        ("whole cycle", f"{cycle.total_s:.3f}"),
        ("of it ramps", f"{cycle.ramps_s:.3f}"),
    ]
    assumed = ", accelerations assumed" if cycle.accelerations_assumed else ""
    open_end = ", and as long as inputs and other programs take" if cycle.open_ended else ""
    return table(f"cycle time{assumed}{open_end}", ("", "s"), rows)


def _slow(report: Report) -> str:
    if report.feed is None:
        return ""
    rows = [
        (
            f"pass {one.pass_}, points {one.from_cutter_point:g} to {one.to_cutter_point:g}",
            f"{one.lowest_mm_s:.3f}",
            f"{one.longer_s:.3f}",
            f"{one.dwell_s:.3f}",
            ", ".join(
                limit.kind if limit.joint is None else f"{limit.kind} of {limit.joint}"
                for limit in one.limits
            ),
        )
        for one in report.feed.lowered
    ]
    heads = ("", "lowest mm/s", "longer s", "dwell s", "why")
    caption = f"slower than the feed of {report.feed.set_mm_s:g} mm/s"
    return table(caption, heads, rows, [mark for mark, _ in slow_marks(report)])


def _frames(job: Job) -> str:
    robot, cell = job.cell.robot, job.cell
    rows: list[tuple[object, ...]] = [
        (
            "contact frame 0, robot base",
            *_pendant(robot.T_controller_base @ cell.wheel.T_base_contact0),
        ),
        ("workpiece, flange", *_pendant(cell.T_flange_workpiece)),
    ]
    frames = table(
        "calibration as the pendant shows it", ("", "X", "Y", "Z", "Rx", "Ry", "Rz"), rows
    )
    angles = [f"{angle:.4f}" for angle in np.rad2deg(job.process.home)]
    home = table("home in deg", ("", *robot.joint_names), [("home", *angles)], ["home"])
    fit = job.around.placed.fit
    fits = (
        []
        if fit is None
        else [
            (label, f"{MM * off:.3f}") for label, off in zip(fit.labels, fit.residuals, strict=True)
        ]
    )
    return frames + home + table("touched points", ("", "residual mm"), fits)


def _pendant(T: Array) -> tuple[str, ...]:
    return tuple(f"{value:.3f}" for value in pendant_figures(T))


def _where_on_wheel(planned: Planned, wheel: ContactWheel) -> str:
    """Return for how long each stretch of the belt's width works."""
    timed = planned.timing.timed
    t, grinding = timed.motion.contact_position, timed.motion.grinding
    edges = np.linspace(-wheel.last_position, wheel.last_position, 36)
    middle = (t[grinding] + t[np.flatnonzero(grinding) - 1]) / 2.0
    seconds, _ = np.histogram(middle, edges, weights=timed.duration[grinding])
    caption = "seconds of grinding over the contact position t: where the belt wears"
    return bars(
        caption, edges[:-1].round(2).tolist(), float(edges[1] - edges[0]), seconds.tolist(), "s"
    )
