"""A cell as the viewer draws it, in plain values."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from opl.cell.drawn_cell import DrawnChain, DrawnSolid
from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import Array, inverse, transform
from opl.geometry.mesh import TriangleMesh
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.report.packing import Packer
from opl.report.solids import is_thinned, triangles

MOST_FRAMES = 60
WHEEL_COLOUR = 0x6B5B4B
FRAME, LIFT = 0.012, 4e-4  # [m] length of a drawn axis; how far lines are above the surface


def drawn_cell(
    chain: DrawnChain | None,
    solids: Sequence[DrawnSolid],
    packer: Packer,
    wheels: Collection[str] = (WHEEL,),
) -> dict[str, Any]:
    """Return arm and solids, without a chain solids alone; large meshes thinned.

    What stands around the arm is seen through, but for the wheels named.
    """
    return {
        "joints": []
        if chain is None
        else [
            {"T": flat(T), "axis": np.round(axis, 9).tolist()}
            for T, axis in zip(chain.Ts_parent_joint, chain.axes, strict=True)
        ],
        "flange": flat(np.eye(4) if chain is None else chain.T_joint_flange),
        "solids": [_drawn(group, wheels, packer) for group in _grouped(solids)],
    }


def thinned_meshes(solids: Sequence[DrawnSolid]) -> list[str]:
    """Return the names of what is drawn with fewer triangles than it is proven with."""
    return [solid.body.name for solid in solids if is_thinned(solid.body)]


def views(wheel: ContactWheel) -> dict[str, list[list[float]]]:
    """Return from where a cell is looked at: eye and what it looks at, by name, in [m]."""
    T = wheel.T_base_contact0
    x, y, z, p = (T[:3, k] for k in range(4))
    near = 3.0 * max(wheel.radius, wheel.width)
    middle = p / 2.0 + np.array([0.0, 0.0, 0.25])
    eyes = {
        "cell": (middle + np.array([2.0, -2.6, 1.4]), middle),
        "contact": (p + near * (0.75 * x - 0.35 * z + 0.55 * y), p),
        "axle": (p + 1.6 * near * x, p),
        "top": (p + np.array([0.0, -0.01, 3.4]), p),
    }
    return {name: [flat(eye), flat(target)] for name, (eye, target) in eyes.items()}


def views_of_part(part: TriangleMesh, normal: Array) -> dict[str, list[list[float]]]:
    """Return from where a part is looked at; its surface faces along a normal, shape (3,)."""
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    centre, size = (low + high) / 2.0, float(np.linalg.norm(high - low))
    up = normal / (np.linalg.norm(normal) or 1.0)
    aside = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    oblique = up + 0.8 * aside + 0.5 * np.cross(up, aside)
    eyes = {"part": oblique / np.linalg.norm(oblique), "top": up + 1e-3 * aside, "side": aside}
    return {name: [flat(centre + 1.7 * size * eye), flat(centre)] for name, eye in eyes.items()}


def drawn_wheel(wheel: ContactWheel) -> dict[str, Any]:
    """Return what the viewer needs to know of a wheel."""
    return {
        "flat_end": wheel.flat_end,
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


def painted(values: Array, unit: str, packer: Packer) -> dict[str, Any]:
    """Return colours for a value of each cutter point, grey for NaN, and what their ends stand for.

    From dark to light evenly, so that they can be distinguished without hue and in print.
    """
    from matplotlib import colormaps

    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    parts = (values - low) / (high - low or 1.0)
    colours = colormaps["viridis"](np.nan_to_num(parts))[:, :3]
    colours[np.isnan(values)] = 0.5
    return {
        "low": f"{low:.2f}" if len(known) else "",
        "high": f"{high:.2f} {unit}" if len(known) else "not known",
        "colours": packer.counts(np.rint(255.0 * colours)),
    }


def flat(T: Array) -> list[float]:
    """Return the numbers of an array, row by row."""
    numbers: list[float] = np.round(T, 9).ravel().tolist()
    return numbers


def _grouped(solids: Sequence[DrawnSolid]) -> list[list[DrawnSolid]]:
    """Return the pieces of each body together: the viewer paints a few large meshes faster."""
    groups: dict[tuple[str, int], list[DrawnSolid]] = {}
    for solid in solids:
        groups.setdefault((solid.body.name, solid.joint), []).append(solid)
    return list(groups.values())


def _drawn(pieces: Sequence[DrawnSolid], wheels: Collection[str], packer: Packer) -> dict[str, Any]:
    first = pieces[0]
    is_wheel = first.body.name in wheels
    corners, faces = triangles([piece.body for piece in pieces])
    T = first.body.T_parent_body  # passes and the part alone are drawn in the frame of the part
    return {
        "name": first.body.name,
        "joint": first.joint,
        "robot": first.of_robot,
        "around": _stands_around(first) and not is_wheel,
        "colour": WHEEL_COLOUR if is_wheel else _colour(first),
        "T": flat(T),
        "vertices": packer.floats(transform(inverse(T), corners)),
        "faces": packer.counts(faces),
    }


def _stands_around(solid: DrawnSolid) -> bool:
    return solid.joint == 0 and not solid.of_robot and solid.body.name != PART


def _colour(solid: DrawnSolid) -> int:
    if solid.of_robot:  # neighbours differ
        return 0xE6A13C if solid.joint % 2 else 0xD2D7DB
    if solid.body.name == PART:
        return 0x9FB4C4
    return 0x5B6670 if solid.joint else 0x8FA0AD
