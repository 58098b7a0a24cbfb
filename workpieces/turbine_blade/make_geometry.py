"""Make surface.json and turbine_blade.stl, a twisted section of a blade, beside this file.

Run by hand after a change of a size below; the same sizes give the same bytes. Lengths in
millimetres, angles in radians. The span runs along x of the workpiece frame and the chord along y,
from the round leading edge to the thin trailing edge; the round back of the blade, which is ground,
faces +z.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

CHORD = 105.0
CAMBER = 13.0
THICKNESS = 8.0
EDGE_THICKNESS = 0.6
HALF_SPAN = 22.0
TWIST = 0.10  # from one end of the span to the other
MIDDLE_Y, MIDDLE_Z = -25.0, 66.0
CHORD_POINTS, SPAN_POINTS = 40, 5
GROUND = (0.04, 0.995)  # part of the chord that is ground
FACETS = (160, 12)

FOLDER = Path(__file__).resolve().parent
Array = NDArray[np.float64]


def section(s: Array, side: float) -> Array:
    """Return (y, z) of a side, 1 back or -1 belly, at fractions of the chord, shape (..., 2).

    The camber line is a parabola; the thickness is that of a blunt nose that thins out evenly.
    """
    camber = 4.0 * CAMBER * s * (1.0 - s)
    half = 0.5 * (THICKNESS * 2.6 * (np.sqrt(s) - s) + EDGE_THICKNESS * s)
    return np.stack([CHORD * (s - 0.5), camber + side * half - 0.7 * CAMBER], axis=-1)


def placed(yz: Array, x: Array) -> Array:
    """Return points of a section twisted to its place along the span, shape (..., 3)."""
    angle = 0.5 * TWIST * x / HALF_SPAN
    y = yz[..., 0] * np.cos(angle) - yz[..., 1] * np.sin(angle)
    z = yz[..., 0] * np.sin(angle) + yz[..., 1] * np.cos(angle)
    return np.stack([np.broadcast_to(x, y.shape), MIDDLE_Y + y, MIDDLE_Z + z], axis=-1)


def surface() -> dict[str, object]:
    """Return the back as a bicubic spline through points of it.

    u runs along the span and v along the chord, so that du x dv points outward.
    """
    s = GROUND[0] + (GROUND[1] - GROUND[0]) * np.linspace(0.0, 1.0, CHORD_POINTS) ** 1.5
    x = np.linspace(-HALF_SPAN, HALF_SPAN, SPAN_POINTS)
    points = placed(section(s, 1.0)[None], x[:, None])
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points[2], axis=0), axis=1)))
    along = make_interp_spline(length, points, k=3, axis=1)
    both = make_interp_spline(
        x, along.c.swapaxes(0, 1) if along.c.shape[0] != SPAN_POINTS else along.c, k=3, axis=0
    )
    return {
        "degree_u": 3,
        "degree_v": 3,
        "knots_u": both.t.tolist(),
        "knots_v": along.t.tolist(),
        "control_points_mm": np.round(both.c, 9).tolist(),
        "weights": np.ones(both.c.shape[:2]).tolist(),
    }


def solid() -> trimesh.Trimesh:
    """Return the whole blade section as a closed solid; all corners lie on its surface."""
    n, m = FACETS
    s = np.linspace(0.0, 1.0, n + 1) ** 2
    outline = np.vstack([section(s, 1.0), section(s[:0:-1], -1.0)])
    k = len(outline)
    x = np.linspace(-HALF_SPAN, HALF_SPAN, m + 1)
    vertices = placed(outline[None], x[:, None]).reshape(-1, 3)
    faces = []
    for a in range(m):
        for i in range(k):
            j = (i + 1) % k
            p, q = a * k + i, a * k + j
            faces += [(p, q, q + k), (p, q + k, p + k)]
    for end in (0, m * k):
        # strips from back to belly between corners at the same place of the chord
        cap = [(0, 1, k - 1)]
        cap += [t for i in range(1, n) for t in ((i, i + 1, k - i), (i + 1, k - i - 1, k - i))]
        faces += [tuple(end + c for c in (t if end else t[::-1])) for t in cap]
    faces = [face for face in faces if len(set(face)) == 3]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.fix_normals()
    return mesh


if __name__ == "__main__":
    text = json.dumps(surface(), indent=1) + "\n"
    (FOLDER / "surface.json").write_text(text, encoding="utf-8")
    solid().export(FOLDER / "turbine_blade.stl")
