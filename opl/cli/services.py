"""Commands that keep running, a service and a folder that is watched; a plug-in that asks it."""

from __future__ import annotations

import os
from pathlib import Path

import click

import opl
from opl.cli.batches import limits, settings_of
from opl.cli.inputs import FILE
from opl.cli.logs import log_to
from opl.cli.stopping import Stopped, stopped_by_raising

TOKEN = "OPL_TOKEN"


@click.command()
@click.option("--store", type=FILE, default=Path("opl-service"), show_default=True,
              help="Folder for jobs and their files.")  # fmt: skip
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=8765, show_default=True,
              help="0 takes one that is free.")  # fmt: skip
@click.option("--workers", type=click.IntRange(min=1), help="Processes; default one per core.")
@click.option(
    "--scheduler", metavar="ADDRESS", help="Do jobs on a cluster of Dask, tcp://HOST:PORT."
)
@click.option("--token-file", type=FILE, help=f"File with the token; or in {TOKEN}.")
@click.option("--time-limit", type=click.FloatRange(min=1.0), default=600.0, show_default=True,
              help="Seconds that a job may take.")  # fmt: skip
@click.option("--memory-limit", type=click.IntRange(min=1000), default=3000, show_default=True,
              help="MB of data that a worker may have.")  # fmt: skip
@click.option("--max-upload", type=click.IntRange(min=1), default=100, show_default=True,
              help="MB that a request may have.")  # fmt: skip
@click.option("--log", type=FILE, help="Write what happens to this file, a line of JSON each.")
def serve(
    store: Path,
    host: str,
    port: int,
    workers: int | None,
    scheduler: str | None,
    token_file: Path | None,
    time_limit: float,
    memory_limit: int,
    max_upload: int,
    log: Path | None,
) -> None:
    """Serve jobs over HTTP: submit, follow, cancel, fetch the files and the page.

    Listens on this machine only; beyond it each request has to carry a token. docs/service.md says
    what can be asked, /docs of the service shows it. Needs the extra opl[service].

    Example: opl serve --store jobs --workers 2
    """
    token = os.environ.get(TOKEN) if token_file is None else opl.read_text(token_file, 1000).strip()
    log_to(log)
    settings = opl.ServiceSettings(
        folder=store,
        host=host,
        port=port,
        workers=workers or os.cpu_count() or 1,
        token=token or None,
        seconds=time_limit,
        memory=memory_limit * 1_000_000,
        most_bytes=max_upload * 1_000_000,
        scheduler=scheduler,
    )
    opl.serve(settings, lambda address: click.echo(f"opl serves {address}, {address}/docs"))


@click.command()
@click.argument("inbox", type=FILE)
@click.argument("outbox", type=FILE)
@limits
def watch(
    inbox: Path,
    outbox: Path,
    workers: int | None,
    scheduler: str | None,
    time_limit: float | None,
    memory_limit: int | None,
    log: Path | None,
) -> None:
    """Run the jobs of a folder as they come or change, until it is stopped.

    As `opl batch INBOX --out OUTBOX` again and again: what has not changed is left as it is, and
    what a kill has left half done is done again.

    Example: opl watch inbox programs
    """
    opl.check_folder(outbox)
    log_to(log)
    watch_inbox = opl.watch_inbox  # loaded before signals raise
    settings = settings_of(workers, scheduler, time_limit, memory_limit)

    def done(row: opl.BatchRow) -> None:
        click.echo(f"{row.status}: {row.job}")
        if row.message:
            click.echo("  " + row.message.replace("\n", "\n  "), err=True)

    try:
        with stopped_by_raising():
            watch_inbox(inbox, outbox, settings, done)
    except Stopped:
        click.echo("stopped", err=True)


@click.command()
@click.argument("folder", type=FILE, metavar="MOD")
def plugin(folder: Path) -> None:
    """Copy the workbench for FreeCAD into the folder of its add-ons.

    That is the folder Mod of FreeCAD's user data: on Linux ~/.local/share/FreeCAD/Mod; its
    Python console tells it: App.getUserAppDataDir(). docs/plugin.md says how to work with it.

    Example: opl plugin ~/.local/share/FreeCAD/Mod
    """
    click.echo(f"wrote {opl.install_plugin(folder)}; start FreeCAD anew, and opl serve")
