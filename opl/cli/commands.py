"""The command line: arguments, printing, files and exit statuses."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path
from typing import Any

import click

from opl import __version__
from opl import batch as batch_jobs
from opl.cli.cell import cell
from opl.cli.programs import show, templates
from opl.cli.robots import robots
from opl.cli.surfaces import faces, points
from opl.cli.verify import verify
from opl.console.run import progress_bar, show_batch, show_check, show_outcome
from opl.deliver import check_folder, deliver
from opl.errors import InputError, NoPathError, OplError, UnsafeError
from opl.files.resources import folder as resource
from opl.job import reference
from opl.job.cell_file import CellFile
from opl.job.file import JobFile
from opl.job.load import load
from opl.job.search import Method
from opl.outcome import Outcome
from opl.pipeline import run
from opl.result import reasons, render
from opl.surfacing import cut_surface

# what cannot be read is told in one voice, by those who read it
ANY = click.Path(path_type=Path, readable=False)


class _Group(click.Group):
    """Shows opl's own errors as one message and ends with their exit status."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except OplError as error:
            click.echo("error: " + str(error).replace("\n", "\n  "), err=True)
            sys.exit(error.exit_status)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="opl")
def main() -> None:
    """Offline programming for robotic belt grinding.

    A job in YAML becomes a robot program that is proven free of collision, or the reason why it
    cannot be.

    Example: opl run workpieces/v_shape/job.yaml
    """


@main.command("run")
@click.argument("job", type=ANY)
@click.option("--out", type=ANY, help="Folder for the files; default ./out/<job name>.")
@click.option(
    "--method",
    type=click.Choice([method.value for method in Method]),
    help="Search; default as in the job.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.option("-v", "--verbose", is_flag=True, help="Print the time of each stage too.")
@click.option("--json", "as_json", is_flag=True, help="Print result.json instead of tables.")
def run_job(
    job: Path, out: Path | None, method: str | None, quiet: bool, verbose: bool, as_json: bool
) -> None:
    """Plan, prove and write the program of one job.

    Example: opl run workpieces/v_shape/job.yaml --out programs
    """
    loaded = load(job, method)
    folder = out or Path("out") / loaded.name
    check_folder(folder)
    with progress_bar(quiet or as_json) as watch:
        outcome = run(loaded, watch)
    written = deliver(outcome, folder)
    if as_json:
        click.echo(render(outcome), nl=False)
    elif not quiet:
        show_outcome(outcome, written, verbose)
    if outcome.status != "ok":
        raise _refusal(outcome)


def _refusal(outcome: Outcome) -> OplError:
    """Return the error that a run without a program ends with."""
    if outcome.refusal is not None:
        refusal = outcome.refusal
        return NoPathError(refusal.message, [*refusal.reasons, *outcome.remedies])
    lines = ["planned, but not proven safe; no program was written", *reasons(outcome)]
    return UnsafeError("\n".join(lines))


@main.command()
@click.argument("job", type=ANY)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def check(job: Path, as_json: bool) -> None:
    """Validate a job and print what would be done, without planning.

    Example: opl check workpieces/v_shape/job.yaml
    """
    loaded = load(job)
    surfacing = cut_surface(loaded)
    if as_json:
        figures = {
            "job": loaded.name,
            "robot": loaded.cell.robot.name,
            "cutter_points": len(surfacing.points),
            "passes": surfacing.points.n_passes,
            "contact_positions": loaded.search.n_contact_positions,
            "warnings": [str(finding) for finding in surfacing.warnings],
        }
        click.echo(json.dumps(figures, indent=2))
    else:
        show_check(loaded, surfacing)


@main.command()
@click.argument("paths", type=ANY, nargs=-1, required=True)
@click.option("--out", type=ANY, default=Path("out"), help="Folder for the jobs' folders.")
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default one per core.")
@click.option("-q", "--quiet", is_flag=True, help="Print the last table only.")
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def batch(
    paths: tuple[Path, ...], out: Path, workers: int | None, quiet: bool, as_json: bool
) -> None:
    """Run many jobs in worker processes; a folder means every job file in it.

    Ends with a table, and with a status other than 0 if any job failed.

    Example: opl batch workpieces --out programs --workers 2
    """
    jobs = batch_jobs.find_jobs(paths)
    check_folder(out)
    count = min(workers or os.cpu_count() or 1, len(jobs))

    def done(row: batch_jobs.Row) -> None:
        if not (quiet or as_json):
            click.echo(f"{row.status}: {row.job}", err=True)

    rows = batch_jobs.run_batch(jobs, out, count, done)
    if as_json:
        told = [
            {
                "job": str(row.job),
                "status": row.status,
                "exit_status": row.exit_status,
                "folder": None if row.folder is None else str(row.folder),
                "message": row.message,
                "result": row.result,
            }
            for row in rows
        ]
        click.echo(json.dumps(told, indent=2))
    else:
        show_batch(rows)
    sys.exit(max(row.exit_status for row in rows))


@main.command()
@click.argument("directory", type=ANY)
def init(directory: Path) -> None:
    """Start a job: copy the V-shaped example to a new folder, to be changed.

    Example: opl init my_part
    """
    if directory.exists():
        raise InputError(str(directory), "exists already; name a new folder")
    check_folder(directory)
    shutil.copytree(
        resource("workpieces") / "v_shape", directory, ignore=shutil.ignore_patterns("__pycache__")
    )
    job = directory / "job.yaml"
    click.echo(f"wrote {job} and the files it names; next: opl check {job}")


@main.command()
@click.option("--cell", "of_cells", is_flag=True, help="Of cell files instead.")
@click.option("--markdown", is_flag=True, help="Print a page of all keys of both instead.")
def schema(of_cells: bool, markdown: bool) -> None:
    """Print the JSON schema of job files, for editors that check YAML while one types.

    Example: opl schema > job.schema.json
    """
    if markdown:
        click.echo(reference.page(), nl=False)
    else:
        click.echo(json.dumps(reference.schema(CellFile if of_cells else JobFile), indent=2))


for _command in (cell, robots, show, templates, faces, points, verify):
    main.add_command(_command)
