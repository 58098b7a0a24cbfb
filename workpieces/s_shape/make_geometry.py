"""Make surface.json and s_shape.stl, the S-shaped part, beside this file.

Run by hand after a change of a size below; the same sizes give the same bytes. Lengths in
millimetres, angles in radians. The profile lies in the plane of x and z of the workpiece frame: a
hollow arc, then a round one, tangent to each other. The angle of the normal is counted from +z
towards +x.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

RADIUS = 57.687
FIRST_ANGLE = 1.327
TURN = 1.022
MIDDLE_X, MIDDLE_Z = -7.479, -53.983
HALF_WIDTH = 12.5
THICKNESS = 20.0
CHORD_ERROR = 0.01

FOLDER = Path(__file__).resolve().parent
Array = NDArray[np.float64]


def normal(angle: Array | float) -> Array:
    """Return (x, z) of the unit normal, shape (..., 2)."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)


def centres() -> tuple[Array, Array]:
    """Return (x, z) of the centre of the hollow and of the round arc."""
    first, inner = normal(FIRST_ANGLE), normal(FIRST_ANGLE - TURN)
    # the arcs meet where the angle is the inner one; the profile's ends lie evenly about the middle
    hollow = np.zeros(2)
    round_ = hollow - 2.0 * RADIUS * inner
    middle = 0.5 * (hollow - RADIUS * first + round_ + RADIUS * first)
    shift = np.array([MIDDLE_X, MIDDLE_Z]) - middle
    return hollow + shift, round_ + shift


def profile(angle: Array, arc: int, depth: float = 0.0) -> Array:
    """Return (x, z) on an arc, 0 hollow, 1 round, where the normal has an angle, shape (..., 2)."""
    centre, radius = centres()[arc], (-RADIUS, RADIUS)[arc]
    return centre + (radius - depth) * normal(angle)


def surface() -> dict[str, object]:
    """Return the profile as an exact rational quadratic, extruded along y.

    u runs along the profile towards +x, near to its arc length, and v along y, so that du x dv
    points outward.
    """
    half = 0.5 * TURN
    net, weights = [], []
    for arc, middle in ((0, FIRST_ANGLE - half), (1, FIRST_ANGLE - half)):
        first, last = (middle + half, middle - half) if arc == 0 else (middle - half, middle + half)
        centre, radius = centres()[arc], (-RADIUS, RADIUS)[arc]
        meeting = centre + radius / np.cos(half) * normal(middle)
        points = [profile(np.array(first), arc), meeting, profile(np.array(last), arc)]
        net += points if arc == 0 else points[1:]
        weights += [1.0, float(np.cos(half)), 1.0][arc:]
    length = RADIUS * TURN
    knots_u = np.repeat([0.0, length, 2.0 * length], [3, 2, 3])
    return {
        "degree_u": 2,
        "degree_v": 1,
        "knots_u": [float(knot) for knot in knots_u],
        "knots_v": [-HALF_WIDTH, -HALF_WIDTH, HALF_WIDTH, HALF_WIDTH],
        "control_points_mm": [
            [[float(x), v, float(z)] for v in (-HALF_WIDTH, HALF_WIDTH)] for x, z in net
        ],
        "weights": [[w, w] for w in weights],
    }


def solid() -> trimesh.Trimesh:
    """Return the closed slab of even thickness behind the profile.

    The corners of the round arc lie on the surface. Those of the hollow arc do too: its facets
    stand out of the hollow by the chord error at most.
    """
    n_facets = int(np.ceil(TURN / (2.0 * np.arccos(1.0 - CHORD_ERROR / RADIUS))))
    down = np.linspace(FIRST_ANGLE, FIRST_ANGLE - TURN, n_facets + 1)
    front = np.vstack([profile(down, 0), profile(down[-2::-1], 1)])
    back = np.vstack([profile(down, 0, THICKNESS), profile(down[-2::-1], 1, THICKNESS)])
    n = len(front)
    corners = np.vstack([front, back])
    sides = [
        np.column_stack([corners[:, 0], np.full(2 * n, y), corners[:, 1]])
        for y in (-HALF_WIDTH, HALF_WIDTH)
    ]
    faces: list[tuple[int, int, int]] = []
    quads = [(i, i + 1, i + 1 + 2 * n, i + 2 * n) for i in range(n - 1)]  # front
    quads += [(n + i + 1, n + i, n + i + 2 * n, n + i + 1 + 2 * n) for i in range(n - 1)]  # back
    quads += [(n, 0, 2 * n, 3 * n), (n - 1, 2 * n - 1, 4 * n - 1, 3 * n - 1)]  # both ends
    for i in range(n - 1):
        quads.append((i, n + i, n + i + 1, i + 1))
        quads.append((2 * n + i, 2 * n + i + 1, 3 * n + i + 1, 3 * n + i))
    for a, b, c, d in quads:
        faces += [(a, b, c), (a, c, d)]
    mesh = trimesh.Trimesh(np.vstack(sides), faces, process=False)
    return mesh if mesh.volume > 0.0 else trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1])


if __name__ == "__main__":
    text = json.dumps(surface(), indent=1) + "\n"
    (FOLDER / "surface.json").write_text(text, encoding="utf-8")
    solid().export(FOLDER / "s_shape.stl")
