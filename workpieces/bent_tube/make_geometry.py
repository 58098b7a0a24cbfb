"""Make outside.ply and bent_tube.stl, the end of a bent tube, beside this file.

Run by hand after a change of a size below; the same sizes give the same bytes. Lengths in
millimetres unless said otherwise, angles in radians. The tube runs along y of the workpiece frame,
then bends downwards; its open end is the ground one. outside.ply, in metres, is what a scanner
would see of it from above: triangles that enclose nothing.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

RADIUS, WALL = 22.0, 3.0
AXIS_Z = 10.0
STRAIGHT = (-30.0, 8.0)  # along y
BEND_RADIUS, BEND = 60.0, 0.65
SEEN = 0.9  # half of the sector about the top that is ground
FINE = (180, 60)  # facets around the whole and along, of what is seen
COARSE = (72, 24)  # of the solid

FOLDER = Path(__file__).resolve().parent
Array = NDArray[np.float64]


def tube(radius: float, phi: Array, along: int) -> Array:
    """Return points around each place of the centre line, shape (along, around, 3)."""
    length = STRAIGHT[1] - STRAIGHT[0]
    way = np.linspace(0.0, length + BEND_RADIUS * BEND, along + 1)
    angle = np.maximum(way - length, 0.0) / BEND_RADIUS
    y = STRAIGHT[0] + np.minimum(way, length) + BEND_RADIUS * np.sin(angle)
    z = AXIS_Z - BEND_RADIUS * (1.0 - np.cos(angle))
    up = np.stack([0.0 * angle, np.sin(angle), np.cos(angle)], axis=-1)
    centre = np.stack([0.0 * y, y, z], axis=-1)
    around = np.sin(phi)[None, :, None] * np.array([1.0, 0.0, 0.0])
    return centre[:, None] + radius * (around + np.cos(phi)[None, :, None] * up[:, None])


def quads(first: int, rows: int, columns: int, closed: bool) -> list[tuple[int, int, int]]:
    """Return the triangles of a grid of vertices, outside where columns run towards +x."""
    faces = []
    for k in range(rows - 1):
        for i in range(columns if closed else columns - 1):
            a, b = first + k * columns + i, first + k * columns + (i + 1) % columns
            faces += [(a, b, b + columns), (a, b + columns, a + columns)]
    return faces


def outside() -> trimesh.Trimesh:
    """Return the upper part of the outside, in metres."""
    around, along = FINE
    phi = np.linspace(-SEEN, SEEN, int(around * SEEN / np.pi) + 1)
    grid = tube(RADIUS, phi, along)
    faces = quads(0, along + 1, len(phi), closed=False)
    mesh = trimesh.Trimesh(1e-3 * grid.reshape(-1, 3), faces, process=False)
    up = np.mean(mesh.face_normals[:, 2])
    return mesh if up > 0.0 else trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)


def solid() -> trimesh.Trimesh:
    """Return the tube with its wall as a closed solid."""
    around, along = COARSE
    phi = 2.0 * np.pi * np.arange(around) / around
    outer, inner = (tube(radius, phi, along).reshape(-1, 3) for radius in (RADIUS, RADIUS - WALL))
    n = len(outer)
    faces = quads(0, along + 1, around, closed=True)
    faces += [(c, b, a) for a, b, c in quads(n, along + 1, around, closed=True)]
    for i in range(around):
        j, end = (i + 1) % around, along * around
        faces += [(i, n + i, n + j), (i, n + j, j)]
        faces += [(end + i, end + j, n + end + j), (end + i, n + end + j, n + end + i)]
    mesh = trimesh.Trimesh(np.vstack([outer, inner]), faces, process=False)
    return mesh if mesh.volume > 0.0 else trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1])


if __name__ == "__main__":
    outside().export(FOLDER / "outside.ply")
    solid().export(FOLDER / "bent_tube.stl")
