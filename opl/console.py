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
from opl.cell.inverse import branch_name
from opl.cell.robot import Robot
from opl.job import Job
from opl.pipeline import Outcome
from opl.pipeline import Progress as Watch
from opl.result import search_seconds

FILE_WIDTH = 120  # columns

STAGES = {
    "cutter_points": "cutter points",
    "nodes": "node matrix",
    "clearance": "clearance to the wheel",
    "comparison": "comparison with fixed contact",
    "search": "search",
    "motion": "motion",
    "verification": "verification in PyBullet",
    "export": "program and pictures",
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

        def watch(stage: str, fraction: float) -> None:
            done = order.index(stage) + fraction
            bar.update(task, description=STAGES[stage], completed=done)

        yield watch


def show_outcome(outcome: Outcome, written: list[Path], verbose: bool) -> None:
    """Print what became of a job."""
    console = _console()
    if outcome.plan is not None:
        console.print(_comparison(outcome))
        for line in _facts(outcome):
            console.print(line, markup=False)
    if verbose:
        for stage, spent in outcome.seconds.items():
            console.print(f"  {STAGES[stage]}: {spent:.3f} s", markup=False)
    for path in written:
        console.print(f"wrote {path}", markup=False)


def _comparison(outcome: Outcome) -> Table:
    """Return joint ranges, contact fixed beside found, as in table 2 of the paper."""
    names = outcome.job.cell.robot.joint_names
    table = Table(title="joint ranges along the path, in rad", title_justify="left")
    table.add_column("path", no_wrap=True)
    for name in (*names, "sum", "travel"):
        table.add_column(name, justify="right", no_wrap=True)
    fixed = outcome.fixed
    if fixed is not None and fixed.q is not None:
        passes = outcome.points.pass_index if outcome.points is not None else np.zeros(0)
        on_wheel = np.diff(passes) == 0
        travel = float(np.abs(np.diff(fixed.q, axis=0)[on_wheel]).sum())
        label = "contact fixed at t = 0" + ("" if fixed.feasible else " (!)")
        ranges = np.ptp(fixed.q, axis=0)
        table.add_row(label, *_figures(ranges), f"{ranges.sum():.4f}", f"{travel:.2f}")
    for label, plan in (
        ("recursive, paper's start", outcome.paper_start),
        (f"{outcome.job.method.value}, {outcome.job.start.value} start", outcome.plan),
    ):
        if plan is not None:
            path = plan.path
            figures = (*_figures(path.joint_ranges), f"{path.joint_range_sum:.4f}")
            table.add_row(label, *figures, f"{path.joint_travel:.2f}")
    return table


def _figures(ranges: np.ndarray) -> list[str]:
    return [f"{value:.4f}" for value in ranges]


def _facts(outcome: Outcome) -> Iterator[str]:
    points, plan, found = outcome.points, outcome.plan, outcome.verification
    fixed, robot = outcome.fixed, outcome.job.cell.robot
    assert points is not None and plan is not None
    path = plan.path
    if fixed is not None and not fixed.feasible:
        yield f"contact fixed at t = 0 is not feasible: {fixed.reason}"
    yield (
        f"path: {len(points)} cutter points in {points.n_passes} passes, "
        f"{path.n_intermediate} intermediate nodes, branch {branch_name(path.branch)}"
    )
    yield f"search with its collision checks: {search_seconds(outcome):.2f} s"
    if found is not None:
        yield (
            f"verified in {found.engine}: {found.poses} poses, {found.collisions} collisions, "
            f"clearance {found.min_clearance * 1e3:.1f} mm or more, contact error "
            f"{found.max_contact_error * 1e3:.3f} mm at most, "
            f"{found.limit_violations} limit violations"
        )
    if outcome.program is not None and found is not None and found.verified is not None:
        duration = found.verified.motion.duration.sum()
        yield f"program: {len(outcome.program.moves)} moves, {duration:.1f} s"
        if robot.unverified_pulses:
            yield (
                f"caution: the pulse ratios of {', '.join(robot.unverified_pulses)} of "
                f"{robot.title} are not verified; compare a posture at the pendant before playing"
            )


def show_check(job: Job, n_points: int, n_passes: int) -> None:
    """Print what a run of the job would do."""
    console = _console()
    cell, wheel = job.cell, job.cell.wheel
    lines = [
        f"{job.path} is a valid job",
        f"program {job.name} for {cell.robot.title}",
        f"wheel {wheel.width * 1e3:g} mm wide, radius {wheel.radius * 1e3:g} mm, roll up to "
        f"{np.rad2deg(wheel.max_roll):g} deg about its edges",
        f"{n_points} cutter points in {n_passes} passes ({job.passes.order.value}), bow height "
        f"{job.passes.max_bow_height * 1e3:g} mm",
        f"node matrix {n_points} x {job.n_contact_positions}, search {job.method.value} from the "
        f"{job.start.value} start node",
        f"obstacles: {', '.join(body.name for body in cell.obstacles) or 'none'}",
    ]
    if cell.robot.unverified_pulses:
        lines.append(f"pulse ratios not verified: {', '.join(cell.robot.unverified_pulses)}")
    for line in lines:
        console.print(line, markup=False)


def show_batch(rows: Sequence[Row]) -> None:
    """Print what became of the jobs of a batch."""
    console = _console()
    table = Table()
    for name in ("job", "status", "points", "range sum [rad]", "time [s]", "files, or why not"):
        table.add_column(name, overflow="fold")
    for row in rows:
        points = total = spent = ""
        if row.result is not None:
            points = str(row.result["cutter_points"])
            spent = f"{row.result['seconds']['total']:.1f}"
            if row.result["path"] is not None:
                total = f"{row.result['path']['joint_range_sum_rad']:.4f}"
        last = str(row.folder) if row.exit_status == 0 else row.message
        cells = (str(row.job), row.status, points, total, spent, last)
        table.add_row(*(Text(cell) for cell in cells))
    console.print(table)
    failed = sum(row.exit_status != 0 for row in rows)
    console.print(f"{len(rows) - failed} of {len(rows)} jobs have a program", markup=False)


def show_robots(robots: Sequence[Robot]) -> None:
    """Print the robots that are known."""
    console = _console()
    table = Table()
    for name in ("name", "robot", "reach [mm]", "pulse ratios not verified"):
        table.add_column(name)
    for robot in robots:
        arm = robot.arm
        reach = arm.a1 + arm.c2 + np.hypot(arm.a2, arm.c3)
        cells = (robot.name, robot.title, f"{reach * 1e3:.0f}", " ".join(robot.unverified_pulses))
        table.add_row(*(Text(cell) for cell in cells))
    console.print(table)
