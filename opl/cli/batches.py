"""Commands for many jobs: run them, see how they stand."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import click

import opl
from opl.cli.inputs import FILE
from opl.cli.logs import log_to
from opl.cli.progress import so_far_text
from opl.cli.stopping import STATUS, Stopped, stopped_by_raising


def limits(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of those who run many jobs."""
    for option in reversed(
        [
            click.option("--workers", type=click.IntRange(min=1), help="Default one per core."),
            click.option("--scheduler", metavar="ADDRESS",
                         help="Run on a cluster of Dask, tcp://HOST:PORT."),
            click.option("--time-limit", type=click.FloatRange(min=1.0), metavar="S",
                         help="Seconds that a job may take."),
            click.option("--memory-limit", type=click.IntRange(min=500), metavar="MB",
                         help="MB of data that a worker may have."),
            click.option("--log", type=FILE, help="Write what happens here, a line of JSON each."),
        ]
    ):  # fmt: skip
        command = option(command)
    return command


def settings_of(
    workers: int | None,
    scheduler: str | None,
    time_limit: float | None,
    memory_limit: int | None,
    force: bool = False,
) -> opl.BatchSettings:
    """Return how a batch is run."""
    memory = None if memory_limit is None else memory_limit * 1_000_000
    count = workers or os.cpu_count() or 1
    return opl.BatchSettings(count, force, time_limit, memory, scheduler)


@click.command()
@click.argument("paths", type=FILE, nargs=-1)
@click.option("--out", type=FILE, default=Path("out"), help="Folder for the jobs' folders.")
@limits
@click.option("--force", is_flag=True, help="Run unchanged jobs too.")
@click.option(
    "--status", "only_status", is_flag=True, help="Print how the jobs stand, run nothing."
)
@click.option("--audit", is_flag=True, help="Hold every file in --out against its digest.")
@click.option("--junit", type=FILE, help="Write the results here as JUnit XML.")
@click.option("-q", "--quiet", is_flag=True, help="Print the last table only.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def batch(
    paths: tuple[Path, ...],
    out: Path,
    workers: int | None,
    scheduler: str | None,
    time_limit: float | None,
    memory_limit: int | None,
    log: Path | None,
    force: bool,
    only_status: bool,
    audit: bool,
    junit: Path | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Run many jobs in worker processes; a folder means every job file in it.

    A job that has not changed since it was run, and whose files are as they were written, is left
    as it is. A list where a job file has one value (radius_mm: [150, 148]) makes a job for each of
    them, named with a number behind. Killed at any moment, the next batch goes on.

    Ends with a table, and with a status other than 0 if any job failed. Stopped by Ctrl-C or
    SIGTERM, the table has the jobs that ended.

    Example: opl batch workpieces --out programs --workers 2
    """
    if audit:
        _audit(out, as_json)
        return
    if not paths:
        raise click.UsageError("Missing argument 'PATHS...'.")
    found = opl.find_jobs(paths)
    if only_status:
        _show_standing(opl.batch_standing(found, out), as_json)
        return
    opl.check_folder(out)
    if junit is not None:
        opl.check_folder(junit.parent)
    log_to(log)

    ended: list[opl.BatchRow] = []

    def done(row: opl.BatchRow) -> None:
        ended.append(row)
        if not (quiet or as_json):
            click.echo(f"{'unchanged, ' if row.unchanged else ''}{row.status}: {row.job}", err=True)

    run_batch = opl.run_batch  # loaded before signals raise
    settings = settings_of(workers, scheduler, time_limit, memory_limit, force)
    try:
        with stopped_by_raising():
            try:
                rows = run_batch(found, out, settings, done)
            except Stopped:
                _show_rows(ended, as_json)
                raise
    except Stopped:
        left = len(found) - len({row.job for row in ended})
        click.echo(f"error: stopped; {left} jobs have not ended", err=True)
        sys.exit(STATUS)
    opl.write_batch_page(rows, out)
    if junit is not None:
        opl.write_file(junit, opl.junit(rows))
    _show_rows(rows, as_json)
    sys.exit(max(row.exit_status for row in rows))


def _show_rows(rows: Sequence[opl.BatchRow], as_json: bool) -> None:
    if as_json:
        click.echo(opl.to_json(rows))
    else:
        from opl.cli.run_text import show_batch  # with rich

        show_batch(rows)


def _show_standing(found: Sequence[opl.JobStanding], as_json: bool) -> None:
    if as_json:
        click.echo(opl.to_json(found))
        return
    for one in found:
        last = "" if one.status is None else f", last time {one.status}"
        click.echo(f"{one.standing}{last}: {one.job}{f' ({one.name})' if one.name else ''}")
    unchanged = sum(one.standing == "unchanged" for one in found)
    click.echo(f"{unchanged} of {len(found)} jobs are unchanged")


def _audit(out: Path, as_json: bool) -> None:
    count, wrong = opl.audit(out)
    if as_json:
        click.echo(opl.to_json({"files": count, "wrong": wrong}))
    else:
        click.echo("\n".join([*wrong, f"{count} files looked at, {len(wrong)} faults"]))
    sys.exit(1 if wrong else 0)


@click.command()
@click.argument("folder", type=FILE, default=Path("out"))
@click.argument("ids", nargs=-1, metavar="[ID]...")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def jobs(folder: Path, ids: tuple[str, ...], as_json: bool) -> None:
    """List the jobs of a folder of a batch, of an outbox, or of a service; show some of them.

    An id may be given by its first characters.

    Example: opl jobs out 37a2f27e
    """
    store = opl.open_store(folder)
    found = store.jobs()
    for id_ in ids:
        if not any(job.id.startswith(id_) for job in found):
            raise opl.InputError(str(folder), f"has no job {id_}")
    if ids:
        found = [job for job in found if job.id.startswith(ids)]
    if as_json:
        click.echo(opl.to_json(found))
        return
    for job in found:
        click.echo(_line(job))
        if ids:
            click.echo("\n".join(f"  {line}" for line in _whole(job)))
    if not ids:
        counts = store.counts()
        click.echo(", ".join(f"{count} {state}" for state, count in counts.items()))


def _at(job: opl.StoredJob) -> str:
    """Return how far a running job is."""
    progress, known = job.progress, ""
    if progress.lower_bound is not None:
        known = f", {so_far_text(progress.value, progress.lower_bound)}"
    return f"{progress.stage} {100.0 * progress.fraction:.0f} %{known}"


def _line(job: opl.StoredJob) -> str:
    status = "" if job.outcome is None else f" {job.outcome.status}"
    stage = f", {_at(job)}" if job.state.value == "running" else ""
    took = "" if job.started is None or job.ended is None else f", {job.ended - job.started:.1f} s"
    return f"{job.id[:12]}  {job.state.value}{status}{stage}{took}  {job.name or job.task.job}"


def _whole(job: opl.StoredJob) -> list[str]:
    lines = [f"id {job.id}", f"{job.task.kind} of {job.task.job}, begun {job.attempts} times"]
    lines += [f"{key} {value}" for key, value in job.task.changes.items()]
    for what in ("created", "started", "ended"):
        at = getattr(job, what)
        if at is not None:
            lines.append(f"{what} {datetime.fromtimestamp(at).isoformat(' ', 'seconds')}")
    if job.outcome is not None:
        lines += job.outcome.message.splitlines()
        lines += [f"{one.digest}  {name}" for name, one in job.outcome.files.items()]
    return lines
