"""Shapes of the document as files of a job: STEP, with the numbers of picked faces, and STL.

Coordinates are those of the document: its origin is the workpiece frame.
"""

from __future__ import annotations

import os
import re
import struct
import tempfile
from collections.abc import Sequence
from typing import Any

import Part

DEVIATION = 0.02  # [mm] of triangles from the shape
_DATE = re.compile(rb"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'")
_COUNT = re.compile(rb"(?<=Open CASCADE STEP translator )(\d+\.\d+) \d+")  # of files written
_ALIKE = 1e-6  # part by which area and place of a face may change in a file


def placed_shape(obj: Any) -> Any:
    """Return the shape of an object where it is in the document.

    Raises:
        ValueError: If it has none.
    """
    shape = getattr(obj, "Shape", None)
    if shape is None or shape.isNull():
        raise ValueError(f"{obj.Label}: has no shape")
    placed = shape.copy()
    placed.Placement = obj.getGlobalPlacement()
    return placed


def shape_figures(shape: Any) -> list[str]:
    """Return figures that tell whether a shape was changed; those of a saved one are the same."""
    return [
        # what rounding makes of a zero is a zero
        " ".join(
            f"{round(value, 8) + 0.0:.9g}" for value in (face.Area, *face.CenterOfMass, face.Length)
        )
        for face in shape.Faces
    ]


def step_file(shape: Any, names: Sequence[str]) -> tuple[bytes, list[int]]:
    """Return a shape as STEP file, and the numbers there of faces, counted from 1.

    Args:
        shape: The shape.
        names: Of faces as FreeCAD has them, ``Face3``.

    Raises:
        ValueError: If a name is no face of the shape, or is not found again in the file.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "part.step")
        shape.exportStep(path)
        with open(path, "rb") as file:
            # the same part is the same file, whenever it is written
            content = _COUNT.sub(rb"\1", _DATE.sub(b"'1970-01-01T00:00:00'", file.read()))
        written = Part.read(path).Faces
    numbers = []
    for name in names:
        try:
            face = shape.getElement(name)
            alike = [k for k, other in enumerate(written, start=1) if _alike(face, other)]
        except (ValueError, AttributeError, Part.OCCError) as error:
            raise ValueError(f"{name}: is no face of the part") from error
        if len(alike) != 1:
            raise ValueError(f"{name}: is found {len(alike)} times in the STEP file of the part")
        numbers.append(alike[0])
    return content, sorted(numbers)


def stl_file(shape: Any) -> bytes:
    """Return a shape as binary STL file in mm.

    Raises:
        ValueError: If it cannot be divided into triangles.
    """
    saved = Part.Shape()  # as it is when the document is opened again: the same triangles
    saved.importBrepFromString(shape.exportBrepToString())
    points, triangles = saved.tessellate(DEVIATION)
    if not triangles:
        raise ValueError("the shape has no surface to be divided into triangles")
    rows = [b"opl".ljust(80), struct.pack("<I", len(triangles))]
    for corners in triangles:
        numbers = [round(x, 6) + 0.0 for corner in corners for x in points[corner]]
        rows.append(struct.pack("<12fH", 0.0, 0.0, 0.0, *numbers, 0))
    return b"".join(rows)


def _alike(one: Any, other: Any) -> bool:
    size = one.BoundBox.DiagonalLength
    near = (one.CenterOfMass - other.CenterOfMass).Length <= _ALIKE * max(size, 1.0)
    return bool(near and abs(one.Area - other.Area) <= _ALIKE * max(one.Area, 1.0))
