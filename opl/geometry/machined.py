"""The surface to be ground, from whatever file a user has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from opl.errors import InputError
from opl.geometry.mesh_surface import load_mesh_surface
from opl.geometry.passes import MachinedSurface
from opl.geometry.patchwork import Face, Patchwork
from opl.geometry.surface_file import load_faces

NURBS = (".json", ".yaml", ".yml")
MESHES = (".stl", ".ply", ".obj")
CAD = (".step", ".stp", ".iges", ".igs")


def load_smooth_faces(path: Path) -> tuple[Face, ...]:
    """Read the faces of a file that is not a mesh.

    Raises:
        InputError: If the file cannot be used.
    """
    suffix = path.suffix.lower()
    if suffix in CAD:
        from opl.geometry import cad  # the extra is only needed by those who have such files

        return cad.load_cad_faces(path)
    if suffix in NURBS:
        return load_faces(path)
    raise InputError(str(path), f"must be one of {', '.join((*NURBS, *MESHES, *CAD))}")


def load_machined(
    path: Path,
    ids: Sequence[int] | None,
    reversed_normal: bool,
    unit: Literal["mm", "m"],
    crease: float,
) -> MachinedSurface:
    """Read the surface to be ground.

    Args:
        path: A NURBS file, a mesh, or a STEP or IGES file, recognised by its suffix.
        ids: Faces to be ground, counted from 1 as `opl faces` lists them; None for all. In a mesh
            they are regions between creases.
        reversed_normal: Whether the outside is where the file has the inside.
        unit: Of a mesh.
        crease: Angle in [rad] between triangles of a mesh that ends a region.

    Raises:
        InputError: If the file cannot be used.
        ValueError: If it has no face of an id.
    """
    if path.suffix.lower() in MESHES:
        return load_mesh_surface(path, unit, crease, ids)
    faces = load_smooth_faces(path)
    if ids is not None:
        for number in ids:
            if number > len(faces):
                raise ValueError(f"no face {number}; {path.name} has 1 to {len(faces)}")
        faces = tuple(faces[number - 1] for number in sorted(set(ids)))
    if reversed_normal:
        faces = tuple(replace(face, outward=-face.outward) for face in faces)
    return Patchwork(faces)
