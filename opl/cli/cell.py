"""The command that checks a cell file and prints what is in it."""

from __future__ import annotations

import json
from pathlib import Path

import click

from opl.console.cell import cell_figures, cell_lines
from opl.job.cell import load_cell

FILE = click.Path(path_type=Path, readable=False)


@click.command()
@click.argument("file", type=FILE, metavar="CELL.yaml")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def cell(file: Path, as_json: bool) -> None:
    """Validate a cell file and print what stands in it.

    Tells where each wheel is, as matrix and as the pendant shows it, and for a wheel that was found
    by touching it how far each point is from its place.

    Example: opl cell workpieces/cells/belt_cell.yaml
    """
    loaded = load_cell(file)
    if as_json:
        click.echo(json.dumps(cell_figures(loaded), indent=2))
        return
    click.echo(f"{file} is a valid cell")
    for line in cell_lines(loaded):
        click.echo(line)
