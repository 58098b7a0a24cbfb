"""The command line: arguments, printing, files and exit statuses."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

import opl
from opl.cli.batches import batch, jobs
from opl.cli.inputs import FILE, cell, faces, points
from opl.cli.pages import show_page, view
from opl.cli.programs import show, templates, verify
from opl.cli.progress import progress_bar
from opl.cli.robots import robots
from opl.cli.services import plugin, serve, watch
from opl.cli.stopping import left_at_once, stopped_at_once

METHODS = ("recursive", "optimal")
# objects made by a run before Python looks for garbage in cycles, of which there is next to none:
# at its 700 that takes 3 % of the time of the V job, and the memory is the same
BETWEEN_COLLECTIONS = 20_000


class _Group(click.Group):
    """Shows opl's own errors as one message and ends with their exit status."""

    def main(self, args: Sequence[str] | None = None, *others: Any, **settings: Any) -> Any:
        if args is not None:  # of a program, which goes on
            return super().main(args, *others, **settings)
        with left_at_once():
            return super().main(None, *others, **settings)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with stopped_at_once():
                return super().invoke(ctx)
        except opl.OplError as error:
            click.echo("error: " + str(error).replace("\n", "\n  "), err=True)
            sys.exit(error.exit_status)


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(opl.__version__, prog_name="opl")
def main() -> None:
    """Offline programming for robotic belt grinding.

    A job in YAML becomes a robot program that is proven free of collision, or the reason why it
    cannot be.

    Example: opl run workpieces/v_shape/job.yaml
    """
    # its threads wait for each other by spinning, on a core that other work of opl has
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@main.command("run")
@click.argument("job", type=FILE)
@click.option("--out", type=FILE, help="Folder for the files; default ./out/<job name>.")
@click.option(
    "--method",
    type=click.Choice(METHODS),
    help="Search; default as in the job.",
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    help="Processes that work at a time; default one per core. The files are the same.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
@click.option(
    "-v",
    "--verbose",
    is_flag=True,
    help="Print the time of each part of the cycle and of each stage too.",
)
@click.option("--json", "as_json", is_flag=True, help="Print result.json instead of tables.")
@click.option("--png", is_flag=True, help="Write the charts as PNG too.")
@click.option("--open", "opened", is_flag=True, help="Open report.html when the run has ended.")
def run_job(
    job: Path,
    out: Path | None,
    method: str | None,
    workers: int | None,
    quiet: bool,
    verbose: bool,
    as_json: bool,
    png: bool,
    opened: bool,
) -> None:
    """Plan, prove and write the program of one job.

    Example: opl run workpieces/v_shape/job.yaml --out programs
    """
    gc.set_threshold(BETWEEN_COLLECTIONS)
    workers = workers or os.cpu_count() or 1
    with ExitStack() as stack:
        gc.disable()  # what is loaded makes next to no garbage, and much to go through
        stack.callback(gc.enable)
        loaded, surfaced = stack.enter_context(opl.job_ahead(job, method, workers))
        gc.freeze()  # what is loaded by now stays: no collection goes through it, here or in a copy
        gc.enable()
        folder = out or Path("out") / loaded.name
        claim = stack.enter_context(opl.claim_folder(folder, loaded.name))
        with progress_bar(quiet or as_json) as watch:
            run = opl.run_job(loaded, watch, workers, surfaced)
        written = opl.deliver(opl.with_png(run) if png else run, claim)
    report = opl.make_report(run)
    if as_json:
        click.echo(opl.to_json(report))
    elif not quiet:
        from opl.cli.run_text import show_run  # with rich

        show_run(report, loaded, written, verbose)
    if opened:
        show_page(opl.find_page(folder, folder))
    if isinstance(run, opl.Refused):
        raise run.error


@main.command()
@click.argument("job", type=FILE)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def check(job: Path, as_json: bool) -> None:
    """Validate a job and print what would be done, without planning.

    Example: opl check workpieces/v_shape/job.yaml
    """
    loaded = opl.load_job(job)
    surfaced = opl.cut_surface(loaded)
    if as_json:
        figures = {
            "job": loaded.name,
            "robot": loaded.cell.robot.name,
            "cutter_points": len(surfaced.points),
            "passes": surfaced.points.n_passes,
            "contact_positions": loaded.search.n_contact_positions,
            "warnings": [str(finding) for finding in surfaced.warnings],
        }
        click.echo(opl.to_json(figures))
        return
    click.echo("\n".join([f"{job} is a valid job", *opl.describe_job(surfaced)]))


@main.command()
@click.argument("directory", type=FILE)
def init(directory: Path) -> None:
    """Start a job: copy the V-shaped example to a new folder, to be changed.

    Example: opl init my_part
    """
    job = opl.start_job(directory)
    click.echo(f"wrote {job} and the files it names; next: opl check {job}")


@main.command()
@click.option("--cell", "of_cells", is_flag=True, help="Of cell files instead.")
@click.option("--markdown", is_flag=True, help="Print a page of all keys of both instead.")
def schema(of_cells: bool, markdown: bool) -> None:
    """Print the JSON schema of job files, for editors that check YAML while one types.

    Example: opl schema > job.schema.json
    """
    if markdown:
        click.echo(opl.keys_page(), nl=False)
    else:
        click.echo(opl.to_json(opl.json_schema("cell" if of_cells else "job")))


for _command in (
    cell,
    robots,
    show,
    templates,
    faces,
    points,
    verify,
    view,
    batch,
    jobs,
    watch,
    serve,
    plugin,
):
    main.add_command(_command)
