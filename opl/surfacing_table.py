"""Cutter points as a table (CSV) for people and spreadsheets."""

from __future__ import annotations

import csv
import io

import numpy as np

from opl.geometry.frames import roll_pitch_yaw
from opl.geometry.passes import LaidPasses

MM = 1e3
COLUMNS = (
    "pass", "cutter_point", "arc_mm",
    "x_mm", "y_mm", "z_mm",
    "rx_deg", "ry_deg", "rz_deg",
    "normal_x", "normal_y", "normal_z",
    "tangent_x", "tangent_y", "tangent_z",
    "curvature_along_1_m", "curvature_across_1_m",
)  # fmt: skip


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
