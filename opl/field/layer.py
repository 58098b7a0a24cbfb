"""Signed distances of part and wheel at the nodes of a matrix: at all of them, or at some."""

from __future__ import annotations

import numpy as np

from opl.cell.wheel_distance import PartTree, signed_wheel_distance
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array, inverse
from opl.geometry.toolpath import CutterPoints


def wheel_layer(
    cell: WorkCell, part: PartTree, points: CutterPoints, contact_positions: Array
) -> Array:
    """Return the signed distance of the part to the wheel in [m], shape (N, M).

    As in `signed_wheel_distance`: exact where it is less than the largest belt penetration allows.

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: N cutter points.
        contact_positions: M values of t.
    """
    Ts_contact0_contact = cell.wheel.T_contact0_contact(contact_positions)
    # cutter and contact coincide, whatever robot brings the part there
    Ts_contact0_workpiece = Ts_contact0_contact @ inverse(points.Ts_workpiece_cutter)[:, None]
    return signed_wheel_distance(part, cell.wheel, Ts_contact0_workpiece, -cell.planned_penetration)


def layer_at(
    cell: WorkCell, part: PartTree, points: CutterPoints, contact_positions: Array, at: np.ndarray
) -> Array:
    """Return `wheel_layer` at some nodes, minus infinity at the others: they are not free.

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: N cutter points.
        contact_positions: M values of t.
        at: Which nodes, shape (N, M).
    """
    columns, rows = np.nonzero(at)
    Ts_contact0_contact = cell.wheel.T_contact0_contact(contact_positions)[rows]
    Ts_contact0_workpiece = Ts_contact0_contact @ inverse(points.Ts_workpiece_cutter)[columns]
    layer = np.full(at.shape, -np.inf)
    layer[at] = signed_wheel_distance(
        part, cell.wheel, Ts_contact0_workpiece, -cell.planned_penetration
    )
    return layer
