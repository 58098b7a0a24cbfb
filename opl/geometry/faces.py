"""The faces of a file, for a person who has to name some of them in a job."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from opl.errors import InputError
from opl.geometry.coverage import AreaSamples
from opl.geometry.frames import Array
from opl.geometry.machined import MESHES, load_smooth_faces
from opl.geometry.mesh import TriangleMesh, load_triangles
from opl.geometry.mesh_surface import MeshSurface
from opl.geometry.passes import MachinedSurface, bounding_box
from opl.geometry.patchwork import Patchwork
from opl.geometry.regions import smooth_regions

# a face is sampled about this often across its longest side
_LOOKS = 40

# characters of a preview, across and down; a character is about twice as high as wide
_WIDTH, _HEIGHT = 28, 7

# the directions a face is looked at from, by the name of what is seen
VIEWS = {
    "top": (2, 1.0),
    "bottom": (2, -1.0),
    "right": (0, 1.0),
    "left": (0, -1.0),
    "back": (1, 1.0),
    "front": (1, -1.0),
}


@dataclass(frozen=True, eq=False)
class FaceSummary:
    """What a person wants to know of a face.

    Attributes:
        number: Its id, from 1.
        type: What it is, e.g. ``cylinder``.
        area: In [m^2].
        low: Least x, y, z in [m], shape (3,).
        high: Largest x, y, z in [m], shape (3,).
        normal: Mean outward normal, not of unit length: a short one means the face turns much,
            shape (3,).
        holes: Number of borders beyond the outer one; None where that is not known.
        samples: Points of it.
    """

    number: int
    type: str
    area: float
    low: Array
    high: Array
    normal: Array
    holes: int | None
    samples: AreaSamples


def list_faces(path: Path, unit: Literal["mm", "m"] | None, crease: float) -> list[FaceSummary]:
    """Return a summary of each face of a file.

    Args:
        path: A STEP or IGES file, a NURBS file, or a mesh.
        unit: Of a mesh; not looked at otherwise.
        crease: Angle in [rad] between triangles of a mesh that ends a face.

    Raises:
        InputError: If the file cannot be used, or the unit of a mesh is missing.
    """
    if path.suffix.lower() in MESHES:
        if unit is None:
            raise InputError(str(path), "a mesh file has no unit: give --unit mm or --unit m")
        return _mesh_faces(load_triangles(path, unit), crease)
    return [
        _summary(number, face.type, Patchwork((face,)), face.n_holes)
        for number, face in enumerate(load_smooth_faces(path), start=1)
    ]


def _mesh_faces(mesh: TriangleMesh, crease: float) -> list[FaceSummary]:
    labels = smooth_regions(mesh, crease)
    found = []
    for label in range(int(labels.max()) + 1):
        triangles = mesh.faces[labels == label]
        part = MeshSurface(TriangleMesh(mesh.vertices, triangles))
        found.append(_summary(label + 1, f"{len(triangles)} triangles", part, None))
    return found


def _summary(number: int, name: str, face: MachinedSurface, holes: int | None) -> FaceSummary:
    low, high = bounding_box(face)
    samples = face.area_samples(float((high - low).max()) / _LOOKS)
    area = float(samples.areas.sum())
    normal = (samples.areas[:, None] * samples.normals).sum(axis=0) / area
    return FaceSummary(number, name, area, low, high, normal, holes, samples)


def preview_face(faces: list[FaceSummary], face: FaceSummary) -> tuple[str, list[str]]:
    """Return where to look from to see one of the faces best, and a picture of all in text.

    The face is drawn with ``#``, the others with dots.
    """
    view = max(VIEWS, key=lambda name: VIEWS[name][1] * float(face.normal[VIEWS[name][0]]))
    depth, sign = VIEWS[view]
    across, up = (k for k in range(3) if k != depth)
    low = np.min([one.low for one in faces], axis=0)
    high = np.max([one.high for one in faces], axis=0)
    # the same scale across and down, a line being as high as two characters are wide
    scale = max((high[across] - low[across]) / _WIDTH, (high[up] - low[up]) / (2.0 * _HEIGHT))
    width = int(np.ceil((high[across] - low[across]) / scale + 1e-9)) + 1
    height = int(np.ceil((high[up] - low[up]) / (2.0 * scale) + 1e-9)) + 1
    # seen from the other side left and right change places; y runs left when seen from the back
    mirrored = (sign > 0.0) == (depth == 1)
    canvas = np.full((height, width), " ")
    for one in [*(other for other in faces if other is not face), face]:
        column = ((one.samples.points[:, across] - low[across]) / scale).astype(int)
        row = ((one.samples.points[:, up] - low[up]) / (2.0 * scale)).astype(int)
        canvas[height - 1 - row, width - 1 - column if mirrored else column] = (
            "#" if one is face else "."
        )
    return view, ["".join(line).rstrip() for line in canvas]
