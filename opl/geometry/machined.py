"""The surface to be ground, from whatever file a user has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from opl.errors import InputError
from opl.geometry.mesh_surface import load_mesh_surface
from opl.geometry.passes import MachinedSurface
from opl.geometry.patchwork import Patchwork
from opl.geometry.surface_file import load_faces

NURBS = (".json", ".yaml", ".yml")
MESHES = (".stl", ".ply", ".obj")
CAD = (".step", ".stp", ".iges", ".igs")


def load_machined(
    path: Path,
    ids: Sequence[int] | None,
    reversed_normal: bool,
    unit: Literal["mm", "m"],
    crease: float,
) -> MachinedSurface:
    """Read the surface to be ground.

    Args:
        path: A NURBS file, a mesh, or a STEP or IGES file, told by the end of its name.
        ids: Faces to be ground, counted from 1 as `opl faces` lists them; None for all. In a mesh
            they are regions between creases.
        reversed_normal: Whether the outside is where the file has the inside.
        unit: Of a mesh.
        crease: Angle in [rad] between triangles of a mesh that ends a region.

    Raises:
        InputError: If the file cannot be used.
        ValueError: If it has no face of an id.
    """
    suffix = path.suffix.lower()
    if suffix in MESHES:
        return load_mesh_surface(path, unit, crease, ids)
    if suffix in CAD:
        from opl.geometry import cad  # the extra is only needed by those who have such files

        faces = tuple(cad_face.face for cad_face in cad.load_cad_faces(path))
    elif suffix in NURBS:
        faces = load_faces(path)
    else:
        known = ", ".join((*NURBS, *MESHES, *CAD))
        raise InputError(str(path), f"must be one of {known}")
    if ids is not None:
        for number in ids:
            if number > len(faces):
                raise ValueError(f"no face {number}; {path.name} has 1 to {len(faces)}")
        faces = tuple(faces[number - 1] for number in sorted(set(ids)))
    if reversed_normal:
        faces = tuple(replace(face, outward=-face.outward) for face in faces)
    return Patchwork(faces)
