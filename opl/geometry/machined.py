"""The surface to be ground, from whatever file a user has.

A file of NURBS faces is JSON or YAML, in millimetres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from opl.errors import InputError
from opl.files import documents
from opl.files.apart import apart
from opl.files.quantities import between
from opl.geometry.frames import Array
from opl.geometry.mesh_surface import load_mesh_surface
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.passes import MachinedSurface
from opl.geometry.patchwork import Face, Patchwork
from opl.geometry.trim import Trim

NURBS = (".json", ".yaml", ".yml")
MESHES = (".stl", ".ply", ".obj")
CAD = (".step", ".stp", ".iges", ".igs")


def load_smooth_faces(path: Path) -> tuple[Face, ...]:
    """Read the faces of a file that is not a mesh.

    Raises:
        InputError: If the file cannot be used, or the extra for it is not installed.
    """
    suffix = path.suffix.lower()
    if suffix in CAD:
        if find_spec("OCP") is None:  # the extra is only needed by those who have such files
            extra = "needs the optional extra for STEP and IGES: pip install 'opl[cad]'"
            raise InputError(str(path), extra)
        return tuple(
            Face(NurbsSurface(*surface), outward, None if loops is None else Trim(loops), kind)
            for surface, outward, loops, kind in apart(_cad_faces, path, about=str(path))
        )
    if suffix in NURBS:
        return load_faces(path)
    raise InputError(str(path), f"must be one of {', '.join((*NURBS, *MESHES, *CAD))}")


_Plain = tuple[tuple[Any, ...], float, tuple[Array, ...] | None, str]


def _cad_faces(path: Path) -> list[_Plain]:
    """Return the faces of a STEP or IGES file as plain values, for a process of its own.

    OpenCASCADE crashes on some broken files.
    """
    from opl.geometry.cad import load_cad_faces

    return [
        (
            tuple(getattr(face.surface, one.name) for one in fields(face.surface) if one.init),
            face.outward,
            None if face.trim is None else face.trim.loops,
            face.type,
        )
        for face in load_cad_faces(path)
    ]


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


# of the net as of the knots; sizes of files bound how many there are
_Parameter = Annotated[float, between(-1e9, 1e9)]
_Knots = list[_Parameter]
_Weight = Annotated[float, between(-1e6, 1e6)]
_Degree = Annotated[int, between(-1, 20)]
_Point = Annotated[list[_Parameter], Field(min_length=3, max_length=3)]
_Parameters = Annotated[list[_Parameter], Field(min_length=2, max_length=2)]
_Row = Annotated[list[_Point], Field(min_length=1)]
_Loop = Annotated[list[_Parameters], Field(min_length=3)]


class _SurfaceFile(documents.Document):
    """A face as it is written in a file."""

    degree_u: _Degree
    degree_v: _Degree
    knots_u: _Knots
    knots_v: _Knots
    control_points_mm: Annotated[list[_Row], Field(min_length=1)]
    weights: list[list[_Weight]]
    periodic_u: bool = False
    periodic_v: bool = False
    trim_loops: Annotated[list[_Loop], Field(min_length=1)] | None = None


class _FacesFile(documents.Document):
    """Several faces that are ground as one surface."""

    faces: Annotated[list[_SurfaceFile], Field(min_length=1)]


def load_faces(path: Path) -> tuple[Face, ...]:
    """Read faces from a JSON or YAML file: the keys of one, or a list of such under ``faces``.

    The keys are the attributes of `NurbsSurface`, with ``control_points_mm`` in millimetres for
    ``control_points``: a list along u of lists along v of [x, y, z]. With ``periodic_u`` the
    control points along u are given once round and ``knots_u`` over one period, one more than
    there are control points; likewise along v. ``trim_loops`` are closed polygons of [u, v]; what
    an odd number of them encloses is there.

    Raises:
        InputError: If the file cannot be read or does not hold faces.
    """
    if "faces" in documents.keys(path):
        listed = documents.read(path, _FacesFile).faces
        return tuple(_face(path, content, f"faces.{i}.") for i, content in enumerate(listed))
    return (_face(path, documents.read(path, _SurfaceFile), ""),)


def _face(path: Path, content: _SurfaceFile, key: str) -> Face:
    for name in ("control_points_mm", "weights"):
        lengths = [len(row) for row in getattr(content, name)]
        if len(set(lengths)) > 1:
            raise InputError(str(path), f"{key}{name}: must be rows of one length, got {lengths}")
    net, weights = 1e-3 * np.array(content.control_points_mm), np.array(content.weights)
    knots_u, knots_v = np.array(content.knots_u), np.array(content.knots_v)
    try:
        if content.periodic_u:
            knots_u, net, weights = _unrolled("u", content.degree_u, knots_u, net, weights, 0)
        if content.periodic_v:
            knots_v, net, weights = _unrolled("v", content.degree_v, knots_v, net, weights, 1)
        surface = NurbsSurface(content.degree_u, content.degree_v, knots_u, knots_v, net, weights)
        trim = None
        if content.trim_loops is not None:
            trim = Trim(tuple(np.array(loop) for loop in content.trim_loops))
        return Face(surface, trim=trim)
    except ValueError as error:
        raise InputError(str(path), f"{key}{error}") from error


def _unrolled(
    name: str, degree: int, knots: Array, net: Array, weights: Array, axis: int
) -> tuple[Array, Array, Array]:
    """Return knots, control points and weights of a periodic direction as of an open one."""
    n = net.shape[axis]
    if len(knots) != n + 1:
        raise ValueError(
            f"knots_{name}: must be {n + 1} values, one more than control points (periodic), "
            f"got {len(knots)}"
        )
    if not 1 <= degree <= n or weights.shape != net.shape[:2]:
        return knots, net, weights  # refused by the surface itself
    period = knots[-1] - knots[0]
    knots = np.concatenate(
        [knots[-degree - 1 : -1] - period, knots, knots[1 : degree + 1] + period]
    )
    again = np.arange(n + degree) % n
    return knots, np.take(net, again, axis), np.take(weights, again, axis)
