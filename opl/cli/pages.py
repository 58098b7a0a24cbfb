"""Pages: which one shows a run, and opening it."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import click

import opl
from opl.cli.inputs import FILE


@click.command()
@click.argument("target", type=FILE, metavar="JOB.yaml|DIR|PROGRAM")
@click.option("--out", type=FILE, default=Path("out"), help="Folder of the jobs' folders.")
@click.option("--path", "path_only", is_flag=True, help="Print where the page is, open nothing.")
def view(target: Path, out: Path, path_only: bool) -> None:
    """Open the page of a run in the browser: of a job, of a folder, of a program.

    The page is a file that fetches nothing. Without a browser its path is printed.

    Example: opl view out/V_SHAPE
    """
    page = opl.find_page(target, out)
    if path_only:
        click.echo(str(page))
    else:
        show_page(page)


def show_page(page: Path) -> None:
    """Open a page in the browser; print where it is if there is none."""
    if not webbrowser.open(page.resolve().as_uri()):
        click.echo(f"no browser to open it with: {page}", err=True)
