"""Bodies and poses as job and cell files give them: lengths in mm, angles in degrees."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, field_validator, model_validator

from opl.cell.workcell import PART, WHEEL
from opl.errors import InputError
from opl.files.documents import Document
from opl.files.quantities import Number, Positive, at_most, between
from opl.geometry.frames import Array, NotARotationError, from_roll_pitch_yaw, nearest_pose
from opl.geometry.mesh import TriangleMesh, load_shell
from opl.geometry.shapes import Body, Box, Cylinder
from opl.job.source import Source

MM = 1e-3
# [m] a body outside of this is one in the wrong unit
SMALLEST, LARGEST = 1e-3, 100.0

Triple = Annotated[list[Number], Field(min_length=3, max_length=3)]
Six = Annotated[list[Number], Field(min_length=6, max_length=6)]
Clearance = Annotated[float, between(0.0, 1000.0)]  # [mm]
_Row = Annotated[list[Number], Field(min_length=4, max_length=4)]


def _proper(rows: list[list[float]]) -> list[list[float]]:
    """Check a 4x4 matrix with its origin in mm, as a calibration prints it."""
    try:
        nearest_pose(np.array(rows))
    except NotARotationError as error:
        raise ValueError(f"{error}, at most 0.02 is taken for rounding") from error
    return rows


Matrix = Annotated[list[_Row], Field(min_length=4, max_length=4), AfterValidator(_proper)]


def pose_of(matrix_mm: list[list[float]]) -> Array:
    """Return the proper pose of a rounded matrix, its origin in [m]."""
    matrix = np.array(matrix_mm)
    matrix[:3, 3] *= MM
    return nearest_pose(matrix)


class BodySection(Document):
    """A named solid: exactly one of box_mm, cylinder_mm and mesh."""

    model_config = ConfigDict(title="Body")

    name: Annotated[str, Field(min_length=1)] = Field(
        description="Name of the body, for messages and pairs."
    )
    at_mm: Triple = Field(
        description="Position of the body's origin (x, y, z) in the frame of its section; the "
        "origin of a box or a cylinder is its centre."
    )
    rotation_deg: Triple = Field(
        default=[0.0, 0.0, 0.0],
        description="Roll, pitch, yaw: turns about the fixed axes x, then y, then z.",
    )
    box_mm: Annotated[list[Positive], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="A box: its edges along x, y and z."
    )
    cylinder_mm: Annotated[list[Positive], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="A cylinder: its radius, and its length along z."
    )
    mesh: str | None = Field(
        default=None,
        description="A mesh file (STL, PLY, OBJ); it need not be closed. Relative names are looked "
        "up beside this file.",
    )
    mesh_unit: Literal["mm", "m"] | None = Field(
        default=None, description="Unit of the mesh file, which does not carry one."
    )

    @model_validator(mode="after")
    def _one_shape(self) -> BodySection:
        if sum(shape is not None for shape in (self.box_mm, self.cylinder_mm, self.mesh)) != 1:
            raise ValueError(
                "needs either box_mm (edges along x, y, z) or cylinder_mm (radius, length along z) "
                "or mesh (a file)"
            )
        if (self.mesh is None) != (self.mesh_unit is None):
            raise ValueError("mesh_unit, mm or m, goes with mesh: mesh files do not say their unit")
        return self

    @field_validator("name")
    @classmethod
    def _not_taken(cls, name: str) -> str:
        if name in (PART, WHEEL):
            raise ValueError("is the name of something else in the cell")
        return name

    def in_si(self, source: Source, key: str) -> Body:
        """Return the body.

        Args:
            source: Where it stands.
            key: Its place there.

        Raises:
            InputError: If its mesh cannot be used.
        """
        shape: Box | Cylinder | TriangleMesh
        if self.box_mm is not None:
            shape = Box((self.box_mm[0] * MM, self.box_mm[1] * MM, self.box_mm[2] * MM))
        elif self.cylinder_mm is not None:
            shape = Cylinder(*(edge * MM for edge in self.cylinder_mm))
        else:
            shape = self._load(source, key)
        origin = np.array(self.at_mm) * MM
        return Body(self.name, shape, from_roll_pitch_yaw(np.deg2rad(self.rotation_deg), origin))

    def _load(self, source: Source, key: str) -> TriangleMesh:
        try:
            mesh = load_shell(source.file(str(self.mesh)), self.mesh_unit or "mm")
        except InputError as error:
            raise InputError(source.at(f"{key}.mesh"), str(error)) from error
        size = float(np.ptp(mesh.vertices, axis=0).max())
        if not SMALLEST <= size <= LARGEST:
            raise InputError(
                source.at(f"{key}.mesh_unit"),
                f"{self.mesh_unit} makes {self.name} {size / MM:g} mm long, which nothing is",
            )
        return mesh


Bodies = Annotated[list[BodySection], at_most(500)]


def bodies_in_si(source: Source, key: str, bodies: list[BodySection]) -> tuple[Body, ...]:
    """Return the bodies of a list; arguments and errors as of `BodySection.in_si`."""
    return tuple(body.in_si(source, f"{key}.{place}") for place, body in enumerate(bodies))
