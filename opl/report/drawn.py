"""A cell as the viewer draws it, in plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from opl.cell.drawn_cell import DrawnChain, DrawnSolid
from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Box, Cylinder
from opl.geometry.thinning import thinned
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.report.packing import Packer

MOST_TRIANGLES = 12_000  # of a drawn mesh
MOST_FRAMES = 60
FRAME, LIFT = 0.012, 4e-4  # [m] length of a drawn axis; how far lines are above the surface


def drawn_cell(
    chain: DrawnChain | None, solids: Sequence[DrawnSolid], packer: Packer
) -> dict[str, Any]:
    """Return arm and solids; a mesh of very many triangles is drawn with fewer, and says so."""
    return {
        "joints": []
        if chain is None
        else [
            {"T": flat(T), "axis": np.round(axis, 9).tolist()}
            for T, axis in zip(chain.Ts_parent_joint, chain.axes, strict=True)
        ],
        "flange": flat(np.eye(4) if chain is None else chain.T_joint_flange),
        "solids": [
            {
                "name": solid.body.name,
                "joint": solid.joint,
                "robot": solid.of_robot,
                "T": flat(solid.body.T_parent_body),
                **_shape(solid.body.shape, packer),
            }
            for solid in solids
        ],
    }


def drawn_wheel(wheel: ContactWheel) -> dict[str, Any]:
    """Return what the viewer needs to know of a wheel."""
    return {
        "flat_end": wheel.flat_end,
        "last": wheel.last_position,
        "radius": wheel.radius,
        "width": wheel.width,
        "T_base_contact0": flat(wheel.T_base_contact0),
    }


def drawn_passes(
    points: CutterPoints, width: float, missed: Array, packer: Packer
) -> dict[str, Any]:
    """Return the passes as bands on the part, some of the frames, and what no pass comes by.

    Args:
        points: The cutter points.
        width: Of the bands in [m].
        missed: Places that no pass comes by in [m], shape (k, 3).
        packer: Takes the arrays.
    """
    Ts = points.Ts_workpiece_cutter
    x, y, z, p = (Ts[:, :3, k] for k in range(4))
    edges = np.stack([p + width / 2.0 * y, p - width / 2.0 * y], axis=1)
    shown = np.arange(0, len(points), -(-len(points) // MOST_FRAMES))
    triads = [np.stack([p, p + FRAME * axis], axis=1)[shown] for axis in (x, y, z)]
    return {
        "frames": packer.floats(Ts[:, :3]),
        "pass": packer.counts(points.pass_index),
        "edges": packer.floats(edges),
        "line": packer.floats(p + LIFT * z),
        "triads": packer.floats(np.stack(triads)),
        "missed": packer.floats(missed),
    }


def flat(T: Array) -> list[float]:
    """Return the sixteen numbers of a pose, row by row."""
    numbers: list[float] = np.round(T, 9).ravel().tolist()
    return numbers


def _shape(shape: Box | Cylinder | TriangleMesh, packer: Packer) -> dict[str, Any]:
    if isinstance(shape, Box):
        return {"kind": "box", "size": list(shape.size)}
    if isinstance(shape, Cylinder):
        return {"kind": "cylinder", "size": [shape.radius, shape.length]}
    mesh = thinned(shape, MOST_TRIANGLES)
    return {
        "kind": "mesh",
        "vertices": packer.rounded(mesh.vertices.T),
        "faces": packer.counts(mesh.faces),
        "triangles": len(shape.faces),
    }
