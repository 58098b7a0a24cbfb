"""Make surface.json and faucet.stl, a faucet-like body with its spout, beside this file.

Run by hand after a change of a size below; the same sizes give the same bytes. Lengths in
millimetres, angles in radians. The body is turned about an axis along y of the workpiece frame; its
profile narrows to a neck. The spout goes on tangentially and bends downwards.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import BSpline

AXIS_Z = 66.0
PROFILE = [(-92.0, 26.0), (-76.0, 27.0), (-58.0, 17.0), (-40.0, 17.0), (-26.0, 19.0), (-14.0, 19.0)]
BEND_RADIUS = 70.0
BEND = 0.7
HALF_SECTOR = 0.4  # of the ground faces, about the top
AROUND, ALONG = 120, 48  # facets of the solid

FOLDER = Path(__file__).resolve().parent
KNOTS = [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0]
Array = NDArray[np.float64]


def revolved(
    profile: list[tuple[float, float, float]], degree: int, knots: list[float], bend: bool
) -> dict[str, object]:
    """Return a sector of a surface of revolution as a rational quadratic around.

    Args:
        profile: Control points: way along the axis or angle, radius, weight.
        degree: Degree along.
        knots: Knots along.
        bend: Whether the profile lies on the bend, whose centre line is an arc.

    u runs around from -x to +x over the top and v along, so that du x dv points outward.
    """
    c = float(np.cos(HALF_SECTOR))
    around = [(-np.sin(HALF_SECTOR), c, 1.0), (0.0, 1.0 / c, c), (np.sin(HALF_SECTOR), c, 1.0)]
    net, weights = [], []
    for x, up, w_around in around:
        row, row_weights = [], []
        for along, radius, w in profile:
            if bend:
                # the control net of an arc about the bend's axis: its middle lies further out
                reach = (radius * up + BEND_RADIUS) / w
                y = PROFILE[-1][0] + reach * np.sin(along)
                z = AXIS_Z - BEND_RADIUS + reach * np.cos(along)
            else:
                y, z = along, AXIS_Z + radius * up
            row.append([radius * x, float(y), float(z)])
            row_weights.append(w * w_around)
        net.append(row)
        weights.append(row_weights)
    return {
        "degree_u": 2,
        "degree_v": degree,
        "knots_u": [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        "knots_v": knots,
        "control_points_mm": net,
        "weights": weights,
    }


def surface() -> dict[str, object]:
    """Return the ground faces: body and spout, tangent where they meet."""
    body = revolved([(y, r, 1.0) for y, r in PROFILE], 3, KNOTS, bend=False)
    radius = PROFILE[-1][1]
    w = float(np.cos(0.5 * BEND))
    spout = revolved(
        [(0.0, radius, 1.0), (0.5 * BEND, radius, w), (BEND, radius, 1.0)],
        2,
        [0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        bend=True,
    )
    return {"faces": [body, spout]}


def solid() -> trimesh.Trimesh:
    """Return body and spout as a closed solid; all corners lie on the surface."""
    spline = BSpline(np.array(KNOTS), np.array(PROFILE), 3)
    y, r = spline(np.linspace(0.0, 3.0, ALONG + 1)).T
    rings = [(np.array([0.0, yk, AXIS_Z]), 0.0, rk) for yk, rk in zip(y, r, strict=True)]
    for angle in np.linspace(0.0, BEND, ALONG // 2 + 1)[1:]:
        centre = [
            0.0,
            y[-1] + BEND_RADIUS * np.sin(angle),
            AXIS_Z - BEND_RADIUS + BEND_RADIUS * np.cos(angle),
        ]
        rings.append((np.array(centre), float(angle), float(r[-1])))
    phi = 2.0 * np.pi * np.arange(AROUND) / AROUND
    vertices = []
    for centre, angle, radius in rings:
        up = np.array([0.0, np.sin(angle), np.cos(angle)])
        ring = np.outer(np.sin(phi), [1.0, 0.0, 0.0]) + np.outer(np.cos(phi), up)
        vertices.append(centre + radius * ring)
    n = len(rings)
    corners = np.vstack([*vertices, rings[0][0], rings[-1][0]])
    faces = []
    for k in range(n - 1):
        for i in range(AROUND):
            j = (i + 1) % AROUND
            a, b, c, d = k * AROUND + i, k * AROUND + j, (k + 1) * AROUND + j, (k + 1) * AROUND + i
            faces += [(a, b, c), (a, c, d)]
    first, last = n * AROUND, n * AROUND + 1
    for i in range(AROUND):
        j = (i + 1) % AROUND
        faces += [(first, j, i), (last, (n - 1) * AROUND + i, (n - 1) * AROUND + j)]
    mesh = trimesh.Trimesh(corners, faces, process=False)
    return mesh if mesh.volume > 0.0 else trimesh.Trimesh(corners, mesh.faces[:, ::-1])


if __name__ == "__main__":
    text = json.dumps(surface(), indent=1) + "\n"
    (FOLDER / "surface.json").write_text(text, encoding="utf-8")
    solid().export(FOLDER / "faucet.stl")
