"""A cell as JSON in mm, for programs of others that draw it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from opl.cell.drawn_cell import DrawnChain, DrawnSolid
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.shapes import Box, Cylinder
from opl.geometry.thinning import thinned
from opl.report.solids import MOST_TRIANGLES

MM = 1e3


def cell_json(cell: WorkCell, chain: DrawnChain, solids: Sequence[DrawnSolid], home: Array) -> str:
    """Return joints and solids of a cell: what its collisions are checked with, meshes thinned.

    The pose of a joint at angle q is that of the joint before times its ``T`` times a turn by q
    about its ``axis``. A solid is fixed to the joint of its number, 0 for the base frame; the
    flange is ``T_joint_flange`` after the last one.
    """
    names = cell.robot.joint_names
    joints = zip(names, chain.Ts_parent_joint, chain.axes, strict=True)
    whole = {
        "robot": cell.robot.name,
        "joints": [
            {"name": name, "T_mm": _rows(T), "axis": np.round(axis, 9).tolist()}
            for name, T, axis in joints
        ],
        "T_joint_flange_mm": _rows(chain.T_joint_flange),
        "T_flange_workpiece_mm": _rows(cell.T_flange_workpiece),
        "T_base_contact0_mm": _rows(cell.wheel.T_base_contact0),
        "home_rad": np.round(home, 9).tolist(),
        "solids": [
            {
                "name": solid.body.name,
                "joint": solid.joint,
                "robot": solid.of_robot,
                "T_mm": _rows(solid.body.T_parent_body),
                **_shape(solid),
            }
            for solid in solids
        ],
    }
    return json.dumps(whole) + "\n"


def _rows(T: Array) -> list[list[float]]:
    scaled = T.copy()
    scaled[:3, 3] *= MM
    rows: list[list[float]] = (np.round(scaled, 9) + 0.0).tolist()
    return rows


def _shape(solid: DrawnSolid) -> dict[str, Any]:
    shape = solid.body.shape
    if isinstance(shape, Box):
        return {"box_mm": [round(MM * edge, 6) for edge in shape.size]}
    if isinstance(shape, Cylinder):
        return {"cylinder_mm": [round(MM * shape.radius, 6), round(MM * shape.length, 6)]}
    mesh = thinned(shape, MOST_TRIANGLES)
    vertices = np.round(MM * mesh.vertices, 3) + 0.0
    return {"vertices_mm": vertices.tolist(), "triangles": mesh.faces.tolist()}
