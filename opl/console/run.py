"""What the command line shows: progress, the comparison table, where the files are."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from opl.batch import Row
from opl.cell.inverse_kinematics import ik_branch_name
from opl.console.cell import cell_lines, wheel_lines
from opl.console.times import told_times
from opl.geometry.toolpath import CutterPoints
from opl.job.load import Job
from opl.outcome import Outcome
from opl.pipeline import Progress as Watch
from opl.planning.plan import Plan
from opl.proof.prove import Proof
from opl.result import search_seconds
from opl.surfacing import Surfacing

FILE_WIDTH = 120  # columns

STAGES = {
    "cutter_points": "cutter points",
    "nodes": "node matrix",
    "clearance": "clearance to the wheel",
    "comparison": "comparison with fixed contact",
    "search": "search",
    "remedies": "what would help",
    "motion": "motion",
    "verification": "verification in PyBullet",
    "export": "program and pictures",
    "read_back": "proof of the written files",
}


def _console() -> Console:
    """Return standard output; in a file or a pipe wide enough for the tables."""
    width = None if sys.stdout.isatty() else FILE_WIDTH
    return Console(highlight=False, soft_wrap=True, width=width)


@contextmanager
def progress_bar(quiet: bool) -> Iterator[Watch]:
    """Show a bar with the stage at work, on a terminal only; yields what the pipeline calls."""
    if quiet or not sys.stderr.isatty():
        yield lambda stage, fraction: None
        return
    columns = (TextColumn("{task.description:30}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=len(STAGES))
        order = list(STAGES)
        furthest = 0.0  # a stage may come twice

        def watch(stage: str, fraction: float) -> None:
            nonlocal furthest
            furthest = max(furthest, order.index(stage) + fraction)
            bar.update(task, description=STAGES[stage], completed=furthest)

        yield watch


def show_outcome(outcome: Outcome, written: list[Path], verbose: bool) -> None:
    """Print what became of a job."""
    console = _console()
    if outcome.plan is not None:
        console.print(_comparison(outcome))
    for finding in outcome.warnings:
        console.print(f"warning: {finding}", markup=False)
    if outcome.plan is not None:
        for line in _facts(outcome):
            console.print(line, markup=False)
    if verbose:
        for stage, spent in outcome.seconds.items():
            console.print(f"  {STAGES[stage]}: {spent:.3f} s", markup=False)
    for path in written:
        console.print(f"wrote {path}", markup=False)


HEADINGS = {
    "fixed": "contact fixed\nat t = 0",
    "paper_start": "recursive,\npaper's start",
    "recursive": "recursive,\nbest start",
    "optimal": "optimal",
}


def _comparison(outcome: Outcome) -> Table:
    """Return what every path costs, contact fixed beside found, as in table 2 of the paper."""
    columns = list(outcome.compared.items())
    table = Table(title="joint ranges along the path, in rad", title_justify="left")
    table.add_column("joint")
    for name, _ in columns:
        heading = HEADINGS[name]
        if name == "fixed" and outcome.fixed is not None and not outcome.fixed.feasible:
            heading += ", not feasible"
        table.add_column(heading, justify="right", min_width=10)
    names = outcome.job.cell.robot.joint_names
    for k, name in enumerate(names):
        last = k == len(names) - 1
        table.add_row(name, *(f"{f.joint_ranges[k]:.4f}" for _, f in columns), end_section=last)
    table.add_row("sum", *(f"{f.joint_range_sum:.4f}" for _, f in columns), end_section=True)
    table.add_row("joint travel", *(f"{f.joint_travel:.2f}" for _, f in columns))
    table.add_row("travel of t", *(f"{f.contact_travel:.0f}" for _, f in columns))
    table.add_row("time on wheel, s", *(f"{f.seconds:.1f}" for _, f in columns))
    weights = outcome.job.search.weights_asked
    if weights is not None:
        table.add_row("weighted sum", *(f"{weights.value(f):.4f}" for _, f in columns))
    return table


def _facts(outcome: Outcome) -> Iterator[str]:
    points, plan, found = outcome.points, outcome.plan, outcome.verification
    fixed, robot = outcome.fixed, outcome.job.cell.robot
    assert points is not None and plan is not None
    path = plan.path
    if fixed is not None and not fixed.feasible:
        yield f"contact fixed at t = 0 is not feasible: {fixed.reason}"
    yield (
        f"path: {len(points)} cutter points in {points.n_passes} passes, "
        f"{path.n_intermediate} intermediate nodes, branch {ik_branch_name(path.branch)}"
    )
    yield from _certified(plan, outcome.job.search.n_contact_positions)
    yield f"search with its collision checks: {search_seconds(outcome):.2f} s"
    if found is not None:
        yield (
            f"verified in {found.engine}: {found.poses} poses, {found.collisions} collisions, "
            f"clearance {found.min_clearance * 1e3:.1f} mm or more, contact error "
            f"{found.max_contact_error * 1e3:.3f} mm at most, "
            f"{found.limit_violations} limit violations"
        )
    if outcome.file is None and outcome.program is not None:
        yield (
            f"written, not read back: opl has no reader for {outcome.job.program.controller}, so "
            "nothing is proven of the file itself"
        )
    if outcome.file is not None and outcome.file.proven:
        yield (
            f"read back from {', '.join(outcome.file.files)}: {outcome.file.postures} postures, "
            "moves and speeds as proven"
        )
    if outcome.program is not None and found is not None and found.verified is not None:
        worst = max((abs(time.error) for time in outcome.program.pass_times), default=0.0)
        yield (
            f"program: {len(outcome.program.moves)} moves, passes within {100.0 * worst:.2f} % of "
            "their time"
        )
        yield from told_times(outcome)
        if robot.unverified_pulses:
            yield (
                f"caution: the pulse ratios of {', '.join(robot.unverified_pulses)} of "
                f"{robot.title} are not verified; compare a posture at the pendant before playing"
            )


def _certified(plan: Plan, n_positions: int) -> Iterator[str]:
    if plan.weighted is not None:
        yield (
            f"no path through these points at {n_positions} contact positions has a weighted sum "
            f"below {plan.weighted.lower_bound:.4f}: the one found has {plan.weighted.value:.4f}, "
            f"{100.0 * plan.weighted.gap:.1f} % of which may be too much"
        )
    if plan.lower_bound is None or plan.gap is None:
        return
    if plan.lower_bound <= 0.0:
        yield "the time was up before anything was proven of the least joint range sum there is"
        return
    refined = plan.refinement
    if refined is not None and refined.rounds:
        yield (
            f"contact positions between the {n_positions} bring the joint range sum from "
            f"{refined.joint_range_sum:.4f} to {plan.path.joint_range_sum:.4f} rad"
        )
        if refined.bound_positions == n_positions and refined.lower_bound is not None:
            # the bound holds for the job's positions: what it says is of the path at these
            gap = 1.0 - refined.lower_bound / refined.joint_range_sum
            yield (
                f"no path through these points at {n_positions} contact positions has a joint "
                f"range sum below {refined.lower_bound:.4f} rad: the one found at these is within "
                f"{100.0 * gap:.3f} % of the least there is"
            )
            return
        n_positions = refined.bound_positions
    yield (
        f"no path through these points at {n_positions} contact positions has a joint range sum "
        f"below {plan.lower_bound:.4f} rad: the one found is within {100.0 * plan.gap:.3f} % of "
        "the least there is"
    )


def show_proof(job: Job, points: CutterPoints, proof: Proof, as_written: bool | None) -> None:
    """Print what was proven of a program, or how far the proof came.

    Args:
        job: Its job.
        points: The cutter points of the job.
        proof: What was found out.
        as_written: Whether the files are to the byte what a run proved; None if nobody can tell.
    """
    console = _console()
    lines = [f"read {path}" for path in proof.files]
    lines += [f"calls {name}, which was not looked at" for name in proof.foreign]
    found, motion = proof.verification, proof.motion
    if found is not None and motion is not None:
        lines += [
            f"{proof.moves} positions, {motion.duration.sum():.1f} s, for {job.cell.robot.title}",
            f"{proof.ground} of {len(points)} cutter points recognised in order, "
            f"{points.n_passes} passes",
            f"replayed in {found.engine}: {found.poses} poses, {found.collisions} collisions, "
            f"clearance {found.min_clearance * 1e3:.1f} mm or more, contact error "
            f"{found.max_contact_error * 1e3:.3f} mm at most, "
            f"{found.limit_violations} limit violations",
        ]
    if job.cell.robot.unverified_pulses:
        lines.append(
            f"caution: the pulse ratios of {', '.join(job.cell.robot.unverified_pulses)} of "
            f"{job.cell.robot.title} are not verified; the proof rests on them"
        )
    if as_written is None:
        lines.append("no result.json beside it tells whether opl run wrote these very bytes")
    elif as_written:
        lines.append("to the last byte what opl run proved and wrote")
    lines.append("proven" if proof.proven else f"not proven: {len(proof.findings)} findings")
    for line in lines:
        console.print(line, markup=False)


def show_check(job: Job, surfacing: Surfacing) -> None:
    """Print what a run of the job would do."""
    console = _console()
    cell, wheel = job.cell, job.cell.wheel
    n_points, n_passes = len(surfacing.points), surfacing.points.n_passes
    lines = [
        f"{job.path} is a valid job",
        f"program {job.name} for {cell.robot.title}",
        f"wheel {wheel.width * 1e3:g} mm wide, radius {wheel.radius * 1e3:g} mm, roll up to "
        f"{np.rad2deg(wheel.max_roll):g} deg about its edges",
        f"{n_points} cutter points in {n_passes} passes ({job.passes.order.value}), bow height "
        f"{job.passes.max_bow_height * 1e3:g} mm",
        f"node matrix {n_points} x {job.search.n_contact_positions}, search "
        f"{job.search.method.value} for the least {job.search.objective.value}",
    ]
    around = job.around
    if around.cell is not None:
        lines.append(f"cell {around.cell.path}:")
        lines += [f"  {line}" for line in cell_lines(around.cell)]
    else:
        lines += list(wheel_lines(cell.robot, around.placed))[1:]
        lines.append(f"obstacles: {', '.join(body.name for body in cell.obstacles) or 'none'}")
    if cell.robot.unverified_pulses:
        lines.append(f"pulse ratios not verified: {', '.join(cell.robot.unverified_pulses)}")
    lines += [f"warning: {finding}" for finding in surfacing.warnings]
    for line in lines:
        console.print(line, markup=False)


def show_batch(rows: Sequence[Row]) -> None:
    """Print what became of the jobs of a batch."""
    console = _console()
    table = _table("job", "status", "cutter points", "range sum [rad]", "time [s]", "files in")
    for row in rows:
        points = total = spent = ""
        if row.result is not None:
            points = str(row.result["cutter_points"])
            spent = f"{row.result['seconds']['total']:.1f}"
            if row.result["path"] is not None:
                total = f"{row.result['path']['joint_range_sum_rad']:.4f}"
        folder = "" if row.folder is None else str(row.folder)
        cells = (str(row.job), row.status, points, total, spent, folder)
        table.add_row(*(Text(cell) for cell in cells))
    console.print(table)
    for row in rows:
        if row.message:
            named = row.message.startswith(str(row.job))
            told = row.message if named else f"{row.job}: {row.message}"
            console.print(told.replace("\n", "\n  "), markup=False)
    failed = sum(row.exit_status != 0 for row in rows)
    console.print(f"{len(rows) - failed} of {len(rows)} jobs have a program", markup=False)


def _table(*headings: str) -> Table:
    table = Table()
    for heading in headings:
        # as Text: rich would take a unit in brackets for markup and leave it out
        table.add_column(Text(heading), overflow="fold")
    return table
