"""The tables of a run's page; every figure is that of its `Report`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.wheel import ContactWheel
from opl.job.values import Job
from opl.planning.survey import NodeState, NodeSurvey
from opl.report.html import bars, bullets, section, table
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
PARTS = {
    "from_home": "in the air",
    "link": "in the air",
    "to_home": "in the air",
    "approach": "approach",
    "pass": "on the wheel",
    "retract": "retract",
}


def figures(report: Report, job: Job, planned: Planned | None) -> str:
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
        rows.append(
            ("time on wheel of the path, s", *(f"{one.seconds_on_wheel:.2f}" for one in figures))
        )
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
            "along these passes has a smaller joint range sum, at any contact positions, on along "
            "each pass and never back, each on an IK branch and count of full turns of its own "
            "(approach, links and retract not counted)"
        )
    if not report.fixed.feasible:
        yield f"contact fixed at t = 0 is not feasible: {report.fixed.reason}"
    yield (
        f"{report.cutter_points} cutter points in {report.passes} passes, "
        f"{path.intermediate_nodes} intermediate nodes, IK branch {path.branch}"
    )


def _cycle(report: Report) -> str:
    """Return the time of every part of the cycle, a row for each pass with the way to it."""
    cycle = report.cycle
    if cycle is None:
        return ""
    heads = list(dict.fromkeys(PARTS.values()))
    passes: dict[str, list[str]] = {}
    for one in cycle.parts:
        name = "back home" if one.pass_ is None else f"pass {one.pass_}"
        row = passes.setdefault(name, [""] * len(heads))
        row[heads.index(PARTS[one.part])] = f"{one.seconds:.3f}"
    waits = f", {cycle.waits_s:.3f} s waiting" if cycle.waits_s else ""
    assumed = ", accelerations assumed" if cycle.accelerations_assumed else ""
    open_end = ", and as long as inputs and other programs take" if cycle.open_ended else ""
    caption = (
        f"cycle time {cycle.total_s:.3f} s: {cycle.passes_s:.3f} s on the wheel, "
        f"{cycle.approach_and_retract_s:.3f} s to it and away, {cycle.air_s:.3f} s in the air"
        f"{waits}; {cycle.ramps_s:.3f} s of all this are ramps{assumed}{open_end}"
    )
    return table(caption, ("s", *heads), [(name, *row) for name, row in passes.items()])


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
    return table(caption, heads, rows, [mark for mark, _ in slow_marks(report)], "reasons")


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
    timed = planned.timed
    t, grinding = timed.motion.contact_position, timed.motion.grinding
    edges = np.linspace(-wheel.last_position, wheel.last_position, 36)
    middle = (t[grinding] + t[np.flatnonzero(grinding) - 1]) / 2.0
    seconds, _ = np.histogram(middle, edges, weights=timed.duration[grinding])
    caption = "seconds of grinding over the contact position t: where the belt wears"
    return bars(
        caption, edges[:-1].round(2).tolist(), float(edges[1] - edges[0]), seconds.tolist(), "s"
    )
