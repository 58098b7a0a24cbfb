"""Commands around surfaces: the cutter points of a job, the faces of a file."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np

from opl.deliver import check_folder, write_texts
from opl.geometry.faces import FaceSummary, list_faces, preview
from opl.geometry.order import link_length
from opl.job.load import load
from opl.report.part_view import part_view
from opl.surfacing import cut_surface
from opl.surfacing_table import points_table

FILE = click.Path(path_type=Path, readable=False)


@click.command()
@click.argument("job", type=FILE)
@click.option("--out", type=FILE, help="Folder for the files; default ./out/<job name>.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def points(job: Path, out: Path | None, as_json: bool) -> None:
    """Write the cutter points of a job as CSV and a picture of part, passes and frames.

    Example: opl points workpieces/v_shape/job.yaml --out programs
    """
    loaded = load(job)
    folder = out or Path("out") / loaded.name
    check_folder(folder)
    surfacing = cut_surface(loaded)
    laid, inspection = surfacing.laid.points, surfacing.inspection
    last = np.append(np.diff(laid.pass_index) != 0, True)
    figures = {
        "job": loaded.name,
        "cutter_points": len(laid),
        "passes": laid.n_passes,
        "pitch_mm": round(1e3 * loaded.passes.pitch, 4),
        "path_mm": round(1e3 * float(laid.arc_length[last].sum()), 2),
        "air_mm": round(1e3 * link_length(laid.Ts_workpiece_cutter, laid.pass_index), 2),
        "uncovered_percent": round(100.0 * inspection.uncovered_fraction, 2),
        "warnings": [str(finding) for finding in surfacing.warnings],
    }
    told = (
        f"{figures['cutter_points']} cutter points in {figures['passes']} passes, pitch "
        f"{figures['pitch_mm']:g} mm, path {figures['path_mm']:g} mm, "
        f"{figures['uncovered_percent']:g} % of the area not covered"
    )
    texts = {
        f"{loaded.name}_points.csv": points_table(surfacing.laid),
        f"{loaded.name}_points.svg": part_view(
            title=f"{loaded.name}: what will be ground",
            subtitle=told,
            vertices=loaded.cell.part.vertices,
            faces=loaded.cell.part.faces,
            Ts_workpiece_cutter=laid.Ts_workpiece_cutter,
            pass_index=laid.pass_index,
            doubtful=inspection.doubtful,
            uncovered=inspection.uncovered.points,
            uncovered_normals=inspection.uncovered.normals,
        ),
    }
    written = write_texts(folder, texts)
    figures["files"] = [str(path) for path in written]
    if as_json:
        click.echo(json.dumps(figures, indent=2))
        return
    click.echo(told)
    for finding in surfacing.warnings:
        click.echo(f"warning: {finding}")
    for path in written:
        click.echo(f"wrote {path}")


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
    found = list_faces(part, "m" if unit == "m" else "mm" if unit else None, np.deg2rad(crease))
    if as_json:
        click.echo(json.dumps([_figures(face) for face in found], indent=2))
        return
    for face in found:
        size = " x ".join(f"{edge:g}" for edge in np.round(1e3 * (face.high - face.low), 2))
        centre = np.round(500.0 * (face.high + face.low), 2) + 0.0  # no negative zero
        middle = ", ".join(f"{value:g}" for value in centre)
        holes = f", {face.holes} holes" if face.holes else ""
        view, lines = preview(found, face)
        click.echo(
            f"face {face.number}: {face.type}, {1e6 * face.area:.4g} mm2, {size} mm about "
            f"({middle}) mm{holes}, seen from {view}:"
        )
        click.echo("\n".join(f"    {line}" for line in lines))
    click.echo(f"{len(found)} faces; a job names some as workpiece.faces, e.g. [1]")


def _figures(face: FaceSummary) -> dict[str, object]:
    return {
        "id": face.number,
        "type": face.type,
        "area_mm2": round(1e6 * face.area, 3),
        "low_mm": np.round(1e3 * face.low, 3).tolist(),
        "high_mm": np.round(1e3 * face.high, 3).tolist(),
        "mean_normal": np.round(face.normal, 4).tolist(),
        "holes": face.holes,
    }
