"""Faces of STEP and IGES files as trimmed NURBS faces. The one home of OCP (OpenCASCADE).

Needs the optional extra ``opl[cad]``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomConvert import GeomConvert
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.IGESControl import IGESControl_Reader
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_Orientation, TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS

from opl.errors import InputError
from opl.files.reading import MB, read_bytes
from opl.geometry.frames import Array
from opl.geometry.nurbs import NurbsSurface
from opl.geometry.patchwork import Face
from opl.geometry.trim import Trim, polygon_area

# OpenCASCADE reads every file into millimetres, whatever unit its header states
_MM = 1e-3

# border curves are cut into chords that turn by this much at most [rad]
_BORDER_TURN = math.radians(1.0)
_BORDER_POINTS = (8, 400)

# a border that follows the sides of the parameters' rectangle this closely is no trim
_SIDE = 1e-6

# a face with less area is none [mm^2]
_LEAST_AREA = 1e-6

# in the order of GeomAbs_SurfaceType
_TYPES = ("plane", "cylinder", "cone", "sphere", "torus", "bezier", "b-spline",
          "revolution", "extrusion", "offset", "other")  # fmt: skip


MOST_BYTES = 100 * MB


def load_cad_faces(path: Path) -> tuple[Face, ...]:
    """Read the faces of a STEP or IGES file, in the order of the file.

    The outside is where the file has it: of a face that bounds a solid, away from that.

    Raises:
        InputError: If the file cannot be read, has no faces, or has a face without area.
    """
    faces = tuple(
        _converted(path, TopoDS.Face_s(raw), number)
        for number, raw in enumerate(_all(_read(path), "FACE"), start=1)
    )
    if not faces:
        raise InputError(str(path), "holds no faces")
    return faces


def _all(shape: Any, kind: str) -> Iterator[Any]:

    explorer = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}"))
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _read(path: Path) -> Any:

    content = read_bytes(path, MOST_BYTES).rstrip()
    if not content:
        raise InputError(str(path), "is empty")
    # OpenCASCADE prints its troubles to standard output
    printers = Message.DefaultMessenger_s().ChangePrinters()
    printers.Clear()
    is_step = path.suffix.lower() in (".step", ".stp")
    reader = STEPControl_Reader() if is_step else IGESControl_Reader()
    what = "STEP" if is_step else "IGES"
    # the last record of an IGES file has a T in column 73; OpenCASCADE reads what is cut short
    if not is_step and content.splitlines()[-1][72:73] != b"T":
        raise InputError(str(path), "is not a whole IGES file")
    try:
        done = reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone
        shape = reader.OneShape() if done and reader.TransferRoots() else None
    except Exception as error:  # OpenCASCADE raises many kinds, all of them about the file
        raise InputError(str(path), f"is not a {what} file: {error}") from error
    if not done:
        raise InputError(str(path), f"is not a whole {what} file")
    if shape is None or shape.IsNull():
        raise InputError(str(path), f"holds no shape that can be read; is the {what} file whole?")
    return shape


def _converted(path: Path, raw: Any, number: int) -> Face:

    outward = -1.0 if raw.Orientation() == TopAbs_Orientation.TopAbs_REVERSED else 1.0
    try:
        kind = int(BRepAdaptor_Surface(raw).GetType())
        properties = GProp_GProps()
        BRepGProp.SurfaceProperties_s(raw, properties)
        if not abs(properties.Mass()) > _LEAST_AREA:
            raise ValueError("has no area")
        converted = TopoDS.Face_s(BRepBuilderAPI_NurbsConvert(raw, True).Shape())
        geometry = BRep_Tool.Surface_s(converted)
        if not isinstance(geometry, Geom_BSplineSurface):
            geometry = GeomConvert.SurfaceToBSplineSurface_s(geometry)
        placed = geometry.Transformed(converted.Location().Transformation())
        loops = tuple(_loops(converted))
        surface, trim = _surface(placed, loops)
        return Face(surface, outward, trim, _TYPES[kind] if kind < len(_TYPES) else "other")
    except Exception as error:
        # OpenCASCADE raises many kinds, which have nothing in common but where they come from
        if not isinstance(error, ValueError) and not type(error).__module__.startswith("OCP"):
            raise
        raise InputError(str(path), f"face {number}: {error}") from error


def _surface(spline: Any, loops: tuple[Array, ...]) -> tuple[NurbsSurface, Trim | None]:
    """Return the part of a B-spline surface that its loops span, and the trim if there is one."""
    if not loops:
        raise ValueError("has no border that can be read")
    corners = np.concatenate(loops)
    low, high = corners.min(axis=0), corners.max(axis=0)
    spline = spline.Copy()
    bounds = np.array(spline.Bounds()).reshape(2, 2)  # (u0, u1), (v0, v1)
    for axis, periodic in enumerate((spline.IsUPeriodic(), spline.IsVPeriodic())):
        if not periodic:
            low[axis], high[axis] = np.clip((low[axis], high[axis]), *bounds[axis])
    if (high - low <= 0.0).any():
        raise ValueError("has no area")
    if spline.IsUPeriodic():
        spline.SetUNotPeriodic()
    if spline.IsVPeriodic():
        spline.SetVNotPeriodic()
    surface = _nurbs(spline)
    # loops of a periodic face may lie one period further along
    first, last = surface.domain
    middle = 0.5 * (low + high)
    periods = np.round((0.5 * (first + last) - middle) / (last - first))
    inside = (first - 1e-9 <= middle) & (middle <= last + 1e-9)
    loops = tuple(loop + np.where(inside, 0.0, (last - first) * periods) for loop in loops)
    if len(loops) == 1 and _is_rectangle(loops[0], surface.domain):
        return surface, None
    return surface, Trim(loops)


def _nurbs(spline: Any) -> NurbsSurface:
    nu, nv = spline.NbUPoles(), spline.NbVPoles()
    net, weights = np.empty((nu, nv, 3)), np.empty((nu, nv))
    for i in range(nu):
        for j in range(nv):
            pole = spline.Pole(i + 1, j + 1)
            net[i, j] = pole.X(), pole.Y(), pole.Z()
            weights[i, j] = spline.Weight(i + 1, j + 1)
    knots_u, knots_v = (
        np.array(list(knots)) for knots in (spline.UKnotSequence(), spline.VKnotSequence())
    )
    return NurbsSurface(spline.UDegree(), spline.VDegree(), knots_u, knots_v, _MM * net, weights)


def _loops(face: Any) -> Iterator[Array]:
    """Yield the borders of a face as polygons in its parameters."""
    for wire in _all(face, "WIRE"):
        explorer = BRepTools_WireExplorer(TopoDS.Wire_s(wire), face)
        corners: list[Array] = []
        while explorer.More():
            edge = explorer.Current()
            curve = BRepAdaptor_Curve2d(edge, face)
            first, last = curve.FirstParameter(), curve.LastParameter()
            coarse = _points(curve, np.linspace(first, last, 65))
            chords = np.diff(coarse, axis=0)
            angles = np.unwrap(np.arctan2(chords[:, 1], chords[:, 0]))
            turn = float(np.abs(np.diff(angles)).sum())
            count = int(np.clip(np.ceil(turn / _BORDER_TURN), *_BORDER_POINTS))
            straight = turn < 1e-9
            places = np.linspace(first, last, count + 1)
            points = coarse[[0, -1]] if straight else _points(curve, places)
            if edge.Orientation() == TopAbs_Orientation.TopAbs_REVERSED:
                points = points[::-1]
            corners.append(points[:-1])
            explorer.Next()
        if corners:
            loop = np.concatenate(corners)
            if len(loop) >= 3:
                yield loop


def _points(curve: Any, parameters: Array) -> Array:
    values = [curve.Value(float(t)) for t in parameters]
    return np.array([[p.X(), p.Y()] for p in values])


def _is_rectangle(loop: Array, domain: Array) -> bool:
    """Return whether a loop runs along the sides of the domain and nowhere else."""
    span = np.ptp(domain, axis=0)
    on_side = (np.abs(loop[:, None] - domain) <= _SIDE * span).any(axis=(1, 2))
    return bool(on_side.all()) and polygon_area(loop) >= (1.0 - 1e-5) * float(span.prod())
