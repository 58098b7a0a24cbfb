"""The command that checks a cell file and prints what is in it."""

from __future__ import annotations

from pathlib import Path

import click

import opl
from opl.cli.options import FILE


@click.command()
@click.argument("file", type=FILE, metavar="CELL.yaml")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def cell(file: Path, as_json: bool) -> None:
    """Validate a cell file and print what stands in it.

    Tells where each wheel is, as matrix and as the pendant shows it, and for a wheel that was found
    by touching it how far each point is from its place.

    Example: opl cell workpieces/cells/belt_cell.yaml
    """
    loaded = opl.load_cell(file)
    if as_json:
        click.echo(opl.to_json(opl.cell_figures(loaded)))
        return
    click.echo(f"{file} is a valid cell")
    for line in opl.describe_cell(loaded):
        click.echo(line)
