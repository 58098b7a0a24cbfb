"""Cutter points before anything is planned: their figures, a table (CSV) and a picture."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.cell.drawn_cell import drawn_chain, drawn_solids
from opl.geometry.frames import roll_pitch_yaw
from opl.geometry.passes import LaidPasses
from opl.report.cell_json import cell_json
from opl.report.part_view import part_view
from opl.run.other_pages import points_page
from opl.run.values import Surfaced

MM = 1e3
COLUMNS = (
    "pass", "cutter_point", "arc_mm",
    "x_mm", "y_mm", "z_mm",
    "rx_deg", "ry_deg", "rz_deg",
    "normal_x", "normal_y", "normal_z",
    "tangent_x", "tangent_y", "tangent_z",
    "curvature_along_1_m", "curvature_across_1_m",
)  # fmt: skip


@dataclass(frozen=True)
class PointsReport:
    """The figures of cutter points.

    Attributes:
        path_mm: Length of all passes together.
        air_mm: Straight distance from the end of each pass to the start of the next, summed.
        uncovered_percent: Part of the area that no pass comes by.
        warnings: What is doubtful, one line each.
    """

    job: str
    cutter_points: int
    passes: int
    pitch_mm: float
    path_mm: float
    air_mm: float
    uncovered_percent: float
    warnings: Sequence[str]

    def __str__(self) -> str:
        return (
            f"{self.cutter_points} cutter points in {self.passes} passes, pitch "
            f"{self.pitch_mm:g} mm, path {self.path_mm:g} mm, {self.uncovered_percent:g} % of the "
            "area not covered"
        )


def report_points(surfaced: Surfaced) -> PointsReport:
    """Return the figures of cutter points."""
    job, points = surfaced.job, surfaced.points
    last = np.append(np.diff(points.pass_index) != 0, True)
    return PointsReport(
        job=job.name,
        cutter_points=len(points),
        passes=points.n_passes,
        pitch_mm=round(MM * job.passes.pitch, 4),
        path_mm=round(MM * float(points.arc_length[last].sum()), 2),
        air_mm=round(MM * points.link_length, 2),
        uncovered_percent=round(100.0 * surfaced.inspection.uncovered_fraction, 2),
        warnings=[str(finding) for finding in surfaced.warnings],
    )


def points_files(surfaced: Surfaced) -> dict[str, str]:
    """Return a table of cutter points, a picture and a page of part and passes, by file name."""
    job, figures = surfaced.job, str(report_points(surfaced))
    picture = part_view(
        title=f"{job.name}: what will be ground",
        subtitle=figures,
        part=job.cell.part,
        points=surfaced.points,
        inspection=surfaced.inspection,
    )
    return {
        f"{job.name}_points.csv": points_table(surfaced.laid),
        f"{job.name}_points.svg": picture,
        f"{job.name}_points.html": points_page(surfaced, figures),
    }


def cell_file(surfaced: Surfaced) -> dict[str, str]:
    """Return the cell of a job as JSON, for programs of others that draw it, by file name."""
    job = surfaced.job
    cell = job.cell
    text = cell_json(cell, drawn_chain(cell.robot), drawn_solids(cell), job.process.home)
    return {f"{job.name}_cell.json": text}


def points_table(laid: LaidPasses) -> str:
    """Return the cutter points, one a row, in the workpiece frame.

    Passes count from 1 and cutter points from 0, as in messages; lines end as CSV has it.
    Curvature is positive where the surface is round.
    """
    points = laid.points
    Ts = points.Ts_workpiece_cutter
    values = np.column_stack(
        [
            MM * points.arc_length,
            MM * Ts[:, :3, 3],
            np.rad2deg(roll_pitch_yaw(Ts)),
            Ts[:, :3, 2],
            Ts[:, :3, 0],
            laid.bending[:, 0, 0],
            laid.bending[:, 1, 1],
        ]
    )
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    for number, (pass_index, row) in enumerate(zip(points.pass_index, values, strict=True)):
        # + 0.0 turns a negative zero round
        writer.writerow([pass_index + 1, number, *(f"{value + 0.0:.6f}" for value in row.round(6))])
    return text.getvalue()
