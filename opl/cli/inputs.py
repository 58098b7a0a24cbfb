"""Commands around what a job is made of: cells, cutter points, the faces of a part."""

from __future__ import annotations

import math
from pathlib import Path

import click

import opl

FILE = click.Path(path_type=Path, readable=False)  # whoever reads it refuses what cannot be read


@click.command()
@click.argument("file", type=FILE, metavar="CELL.yaml")
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
@click.option("--page", type=FILE, help="Write a page that shows it, to be opened in a browser.")
def cell(file: Path, as_json: bool, page: Path | None) -> None:
    """Validate a cell file and print what stands in it.

    Where each wheel is, as matrix and as the pendant shows it, and for a wheel that was found by
    touching it how far each point is from its place.

    Example: opl cell workpieces/cells/belt_cell.yaml
    """
    loaded = opl.load_cell(file)
    if page is not None:
        opl.write_file(page, opl.cell_page(loaded))
    if as_json:
        click.echo(opl.to_json(opl.cell_figures(loaded)))
        return
    click.echo("\n".join([f"{file} is a valid cell", *opl.describe_cell(loaded)]))


@click.command()
@click.argument("job", type=FILE)
@click.option("--out", type=FILE, help="Folder for the files; default ./out/<job name>.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def points(job: Path, out: Path | None, as_json: bool) -> None:
    """Write the cutter points of a job as CSV, a picture and a page of part, passes and frames.

    Example: opl points workpieces/v_shape/job.yaml --out programs
    """
    loaded = opl.load_job(job)
    folder = out or Path("out") / loaded.name
    opl.check_folder(folder)
    surfaced = opl.cut_surface(loaded)
    report = opl.report_points(surfaced)
    written = opl.write_files(folder, opl.points_files(surfaced))
    if as_json:
        click.echo(opl.to_json({**vars(report), "files": written}))
        return
    warnings = [f"warning: {warning}" for warning in report.warnings]
    click.echo("\n".join([str(report), *warnings, *(f"wrote {path}" for path in written)]))


@click.command()
@click.argument("part", type=FILE)
@click.option("--unit", type=click.Choice(["mm", "m"]), help="Of a mesh, which does not say.")
@click.option(
    "--crease",
    type=click.FloatRange(0.0, 180.0, min_open=True, max_open=True),
    default=30.0,
    show_default=True,
    help="Angle in degrees between triangles of a mesh that ends a face.",
)
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def faces(part: Path, unit: str | None, crease: float, as_json: bool) -> None:
    """List the faces of a STEP, IGES, NURBS or mesh file, to be named in a job.

    Each with its id, type, area, size and a preview. STEP and IGES need the extra opl[cad].

    Example: opl faces part.step
    """
    found = opl.list_faces(
        part, "m" if unit == "m" else "mm" if unit else None, math.radians(crease)
    )
    if as_json:
        click.echo(opl.to_json([opl.face_figures(face) for face in found]))
        return
    for face in found:
        size = " x ".join(f"{edge:g}" for edge in (1e3 * (face.high - face.low)).round(2))
        centre = (500.0 * (face.high + face.low)).round(2) + 0.0  # no negative zero
        middle = ", ".join(f"{value:g}" for value in centre)
        holes = f", {face.holes} holes" if face.holes else ""
        view, lines = opl.preview_face(found, face)
        click.echo(
            f"face {face.number}: {face.type}, {1e6 * face.area:.4g} mm2, {size} mm about "
            f"({middle}) mm{holes}, seen from {view}:"
        )
        click.echo("\n".join(f"    {line}" for line in lines))
    click.echo(f"{len(found)} faces; a job names some as {opl.keys.FACES}, e.g. [1]")
