"""What the command line prints of runs, of proofs and of batches, all from their reports."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

import opl
from opl.cli.bound_text import bound_lines
from opl.cli.progress import STAGES
from opl.cli.time_text import feed_and_cycle, parts_of_cycle

FILE_WIDTH = 120  # columns

HEADINGS = {
    "fixed": "contact fixed\nat t = 0",
    "paper_start": "recursive,\npaper's start",
    "recursive": "recursive,\nbest start",
    "optimal": "optimal",
}

_REPLAYED = (
    "{engine}: {poses} poses, {collisions} collisions, clearance {min_clearance_mm:.1f} mm or "
    "more, contact error {max_contact_error_mm:.3f} mm at most, {limit_violations} limit violations"
)


def show_run(report: opl.Report, job: opl.Job, written: Sequence[Path], verbose: bool) -> None:
    """Print what became of a job."""
    console = _console()
    if report.compared:
        console.print(_comparison(report, job.cell.robot.joint_names))
    lines = [f"warning: {warning}" for warning in report.warnings]
    if report.path is not None:
        lines += _facts(report, job)
    if verbose:
        lines += parts_of_cycle(report)
        for stage, label in STAGES.items():
            if stage in report.seconds:
                lines.append(f"  {label}: {report.seconds[stage]:.3f} s")
    lines += [f"wrote {path}" for path in written]
    _print(console, lines)


def _comparison(report: opl.Report, joint_names: Sequence[str]) -> Table:
    """Return what every path costs, contact fixed beside found, as in table 2 of the paper."""
    table = Table(title="joint ranges along the path, in rad", title_justify="left")
    table.add_column("joint")
    for name in report.compared:
        failed = ", not feasible" if name == "fixed" and not report.fixed.feasible else ""
        table.add_column(HEADINGS[name] + failed, justify="right", min_width=10)
    figures = list(report.compared.values())
    for k, joint in enumerate(joint_names):
        ranges = (f"{one.joint_ranges_rad[k]:.4f}" for one in figures)
        table.add_row(joint, *ranges, end_section=joint == joint_names[-1])
    sums = (f"{one.joint_range_sum_rad:.4f}" for one in figures)
    table.add_row("sum", *sums, end_section=True)
    table.add_row("joint travel", *(f"{one.joint_travel_rad:.2f}" for one in figures))
    table.add_row("travel of t", *(f"{one.contact_travel:.0f}" for one in figures))
    table.add_row("time on wheel, s", *(f"{one.seconds_on_wheel:.1f}" for one in figures))
    weighted = [one.weighted_sum for one in figures if one.weighted_sum is not None]
    if weighted:
        table.add_row("weighted sum", *(f"{value:.4f}" for value in weighted))
    return table


def _facts(report: opl.Report, job: opl.Job) -> Iterator[str]:
    fixed, found, program = report.fixed, report.verification, report.program
    path = report.path
    assert path is not None
    if not fixed.feasible:
        yield f"contact fixed at t = 0 is not feasible: {fixed.reason}"
    yield (
        f"path: {report.cutter_points} cutter points in {report.passes} passes, "
        f"{path.intermediate_nodes} intermediate nodes, branch {path.branch}"
    )
    yield from bound_lines(report)
    # the clearance layer is part of the collision checks
    spent = report.seconds["clearance"] + report.seconds["search"]
    yield f"search with its collision checks: {spent:.2f} s"
    if found is not None:
        yield f"verified in {_REPLAYED.format(**vars(found))}"
        yield from _extremes(vars(found), job.cell.robot.joint_names)
        if found.file is not None and found.file.proven:
            yield (
                f"read back from {', '.join(found.file.files)}: {found.file.postures} "
                "configurations, moves and speeds as proven"
            )
            if found.file.corners is not None:
                yield _corners(vars(found.file.corners))
            if job.program.one_job_per_pass:
                yield "each pass is a job from home to home: it may be left out or repeated"
    if program is not None:
        if not program.read_back:
            yield (
                f"written, not read back: opl has no reader for {job.program.controller}, so "
                "nothing is proven of the file itself"
            )
        worst = max((abs(one.error_percent) for one in program.passes), default=0.0)
        single = max((one.largest_move_error_percent for one in program.passes), default=0.0)
        yield (
            f"program: {program.moves} moves, passes within {worst:.2f} % of their time, single "
            f"moves on the wheel within {single:.1f} % of theirs"
        )
        yield from feed_and_cycle(report, job.cell.robot.title)
        yield from _caution(
            report.robot.unverified_pulse_ratios,
            job.cell.robot.title,
            "compare a configuration at the pendant before playing",
        )
        yield from _belt(job.program)


def _extremes(found: Mapping[str, Any], joint_names: Sequence[str]) -> Iterator[str]:
    """Yield where the replay came nearest to what must not be."""
    amounts = {
        "smallest clearance": ("min_clearance_at", f"{found['min_clearance_mm']:.2f} mm"),
        "largest contact error": (
            "max_contact_error_at",
            f"{found['max_contact_error_mm']:.3f} mm",
        ),
        "deepest in the belt": (
            "max_belt_penetration_at",
            f"{found['max_belt_penetration_mm']:.3f} mm of "
            f"{found['allowed_belt_penetration_mm']:g} mm allowed",
        ),
    }
    for what, (key, amount) in amounts.items():
        place = found[key]
        if place is not None:
            joints = zip(joint_names, place.joints_deg, strict=True)
            angles = " ".join(f"{name} {angle:.1f}" for name, angle in joints)
            yield f"  {what}: {amount}, {place.subject}, {place.place}, at {angles} deg"


def _corners(found: Mapping[str, Any]) -> str:
    """Say what was proven of corners, and what that rests on."""
    unknown, where = found["zones_unknown"], found["max_contact_error_at"]
    zones = f", half of each move for {unknown} whose zone nobody knows" if unknown else ""
    return (
        f"{found['rounded']} corners, rounded anyhow within their zones{zones}: contact error "
        f"{found['max_contact_error_mm']:.3f} mm at most of {found['allowed_contact_error_mm']:g} "
        f"mm allowed{where and f', {where}'}, where the part meets and leaves the belt "
        f"{found['max_contact_error_at_ends_mm']:.3f} mm (not limited); clearances, depth in the "
        "belt and order hold. Assumed of the controller: it leaves no move before half-way, and "
        "does not overshoot"
    )


def show_proof(report: Mapping[str, Any], robot: str, joint_names: Sequence[str]) -> None:
    """Print what was proven of a program, or how far the proof came.

    Args:
        report: What was found out.
        robot: The robot, for people.
        joint_names: Of the robot.
    """
    lines = [f"read {path}" for path in report["files"]]
    lines += [f"calls {name}, which was not looked at" for name in report["calls_not_looked_at"]]
    if report["engine"] is not None:
        lines += [
            f"{report['positions']} positions, {report['duration_s']:.1f} s, for {robot}",
            f"{report['cutter_points_ground']} of {report['cutter_points']} cutter points "
            f"recognised in order, {report['passes']} passes",
            f"replayed in {_REPLAYED.format(**report)}",
            *_extremes(report, joint_names),
        ]
    corners, faults = report["corners"], {one["kind"] for one in report["findings"]}
    if corners is not None and "corner" not in faults:
        lines.append(_corners(corners))
    lines += _caution(report["unverified_pulse_ratios"], robot, "the proof rests on them")
    if report["as_written"] is None:
        lines.append("no result.json beside it tells whether opl run wrote these very bytes")
    elif report["as_written"]:
        lines.append("to the last byte what opl run proved and wrote")
    if report["changed"]:
        lines.append(
            "changed since opl wrote it, says the digest in it; what it says now was looked at"
        )
    if report["other_inputs"]:
        names = ", ".join(report["other_inputs"])
        lines.append(f"other inputs than it was made of: {names}; it was held against those of now")
    found = len(report["findings"])
    lines.append("proven" if report["proven"] else f"not proven: {found} findings")
    _print(_console(), lines)


def _caution(unverified: Sequence[str], robot: str, what: str) -> Iterator[str]:
    if unverified:
        joints = ", ".join(unverified)
        yield f"caution: the pulse ratios of {joints} of {robot} are not verified; {what}"


def _belt(settings: Any) -> Iterator[str]:
    """Say who switches the belt, as far as the job tells."""
    if settings.belt_switched_by is not None:
        yield f"the belt is switched by {settings.belt_switched_by}, says the job"
    elif not settings.actions.switches:
        yield (
            "caution: nothing in the program switches the belt; name outputs in "
            f"{opl.keys.PROGRAM_AT_START} and at_end, or who does it in {opl.keys.PROGRAM_BELT}"
        )


def show_batch(rows: Sequence[opl.BatchRow]) -> None:
    """Print what became of the jobs of a batch."""
    console = _console()
    table = Table()
    for heading in ("job", "status", "cutter points", "range sum [rad]", "time [s]", "files in"):
        # as Text: rich would take a unit in brackets for markup and leave it out
        table.add_column(Text(heading), overflow="fold")
    lines = []
    for row in rows:
        points = total = spent = ""
        if row.result is not None:
            points, spent = str(row.result.cutter_points), f"{row.result.seconds['total']:.1f}"
            if row.result.path is not None:
                total = f"{row.result.path.joint_range_sum_rad:.4f}"
        folder = "" if row.folder is None else str(row.folder)
        cells = (str(row.job), row.status, points, total, spent, folder)
        table.add_row(*(Text(cell) for cell in cells))
        if row.message:
            named = row.message.startswith(str(row.job))
            message = row.message if named else f"{row.job}: {row.message}"
            lines.append(message.replace("\n", "\n  "))
    console.print(table)
    if any(row.variant for row in rows):
        console.print(_sweep(rows))
    good, same = sum(row.exit_status == 0 for row in rows), sum(row.unchanged for row in rows)
    unchanged = f"; {same} unchanged, not run again" if same else ""
    _print(console, [*lines, f"{good} of {len(rows)} jobs have a program{unchanged}"])


def _sweep(rows: Sequence[opl.BatchRow]) -> Table:
    """Return what the values of sweeps make of their jobs."""
    swept = list(dict.fromkeys(key for row in rows for key in row.variant))
    figures = ("status", "range sum [rad]", "gap [%]", "cycle [s]", "clearance [mm]")
    table = Table(title="sweeps", title_justify="left")
    for heading in ("folder", *swept, *figures):
        table.add_column(Text(heading), overflow="fold")
    for row in rows:
        if not row.variant:
            continue
        path = cycle = found = None
        if row.result is not None:
            path, cycle, found = row.result.path, row.result.cycle, row.result.verification
        cells = (
            "" if row.folder is None else row.folder.name,
            *(str(row.variant.get(key, "")) for key in swept),
            row.status,
            "" if path is None else f"{path.joint_range_sum_rad:.4f}",
            "" if path is None or path.gap is None else f"{100.0 * path.gap:.3f}",
            "" if cycle is None else f"{cycle.total_s:.1f}",
            "" if found is None else f"{found.min_clearance_mm:.1f}",
        )
        table.add_row(*(Text(cell) for cell in cells))
    return table


def _console() -> Console:
    """Return standard output; in a file or a pipe wide enough for the tables."""
    width = None if sys.stdout.isatty() else FILE_WIDTH
    return Console(highlight=False, soft_wrap=True, width=width)


def _print(console: Console, lines: Sequence[str]) -> None:
    for line in lines:
        console.print(line, markup=False)
