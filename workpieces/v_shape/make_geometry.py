"""Make surface.json and v_shape.stl, the V-shaped part, beside this file.

Run by hand after a change of a size below; the same sizes give the same bytes. Lengths in
millimetres, angles in radians. The profile lies in the plane of y and z of the workpiece frame,
symmetric about the apex: flank, circular tip, flank, each tangent to the next.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

TIP_RADIUS = 61.774
TIP_HALF_ANGLE = 1.132
FLANK_LENGTH = 46.843
APEX_Y, APEX_Z = -24.572, 96.5
HALF_WIDTH = 12.5
TIP_SEGMENTS = 2
CHORD_ERROR = 0.01

FOLDER = Path(__file__).resolve().parent
Array = NDArray[np.float64]


def on_tip(angle: Array, radius: float | Array = TIP_RADIUS) -> Array:
    """Return (y, z) where the normal leans by an angle towards +y, shape (..., 2)."""
    y = APEX_Y + radius * np.sin(angle)
    z = APEX_Z - TIP_RADIUS + radius * np.cos(angle)
    return np.stack([y, z], axis=-1)


def flank_ends() -> tuple[Array, Array]:
    """Return (y, z) of the first and the last point of the profile."""
    c, s = np.cos(TIP_HALF_ANGLE), np.sin(TIP_HALF_ANGLE)
    left, right = on_tip(np.array([-TIP_HALF_ANGLE, TIP_HALF_ANGLE]))
    return left + FLANK_LENGTH * np.array([-c, -s]), right + FLANK_LENGTH * np.array([c, -s])


def surface() -> dict[str, object]:
    """Return the profile as an exact rational quadratic, extruded along x.

    u runs along x and v along the profile towards +y, near to its arc length, so that du x dv
    points outward. A circular arc of half-angle h is the quadratic of its ends and the meeting
    point of their tangents with the weight cos h (Piegl and Tiller, section 7.3).
    """
    first, last = flank_ends()
    nodes = on_tip(np.linspace(-TIP_HALF_ANGLE, TIP_HALF_ANGLE, TIP_SEGMENTS + 1))
    half = TIP_HALF_ANGLE / TIP_SEGMENTS
    middles = np.linspace(-TIP_HALF_ANGLE, TIP_HALF_ANGLE, 2 * TIP_SEGMENTS + 1)[1::2]
    meetings = on_tip(middles, TIP_RADIUS / np.cos(half))

    profile = [first, 0.5 * (first + nodes[0]), nodes[0]]
    weights = [1.0, 1.0, 1.0]
    for meeting, node in zip(meetings, nodes[1:], strict=True):
        profile += [meeting, node]
        weights += [float(np.cos(half)), 1.0]
    profile += [0.5 * (nodes[-1] + last), last]
    weights += [1.0, 1.0]

    pieces = [FLANK_LENGTH, *[2.0 * half * TIP_RADIUS] * TIP_SEGMENTS, FLANK_LENGTH]
    joints = np.append(0.0, np.cumsum(pieces))
    knots_v = [joints[0], *np.repeat(joints, 2), joints[-1]]
    return {
        "degree_u": 1,
        "degree_v": 2,
        "knots_u": [-HALF_WIDTH, -HALF_WIDTH, HALF_WIDTH, HALF_WIDTH],
        "knots_v": [float(knot) for knot in knots_v],
        "control_points_mm": [
            [[x, float(y), float(z)] for y, z in profile] for x in (-HALF_WIDTH, HALF_WIDTH)
        ],
        "weights": [weights, weights],
    }


def solid() -> trimesh.Trimesh:
    """Return the closed solid below the profile, down to the line between its ends.

    All corners lie on the surface. The number of facets is even, so that the apex is a corner.
    """
    largest_turn = 2.0 * np.arccos(1.0 - CHORD_ERROR / TIP_RADIUS)
    n_facets = 2 * int(np.ceil(TIP_HALF_ANGLE / largest_turn))
    first, last = flank_ends()
    tip = on_tip(np.linspace(-TIP_HALF_ANGLE, TIP_HALF_ANGLE, n_facets + 1))
    profile = np.vstack([first, tip, last])

    n = len(profile)
    sides = [np.column_stack([np.full(n, x), profile]) for x in (-HALF_WIDTH, HALF_WIDTH)]
    around = [(i, (i + 1) % n) for i in range(n)]  # the last one is the bottom
    faces = [face for i, j in around for face in ((i, i + n, j + n), (i, j + n, j))]
    # the ends of the solid, in strips between corners at one height
    strips = [(i, i + 1, n - 1 - i, n - 2 - i) for i in range(n // 2)]
    for i, j, k, m in strips:
        cap = [(i, j, k), (j, m, k)] if m != j else [(i, j, k)]
        faces += cap
        faces += [(c + n, b + n, a + n) for a, b, c in cap]
    return trimesh.Trimesh(np.vstack(sides), faces, process=False)


if __name__ == "__main__":
    text = json.dumps(surface(), indent=1) + "\n"
    (FOLDER / "surface.json").write_text(text, encoding="utf-8")
    solid().export(FOLDER / "v_shape.stl")
