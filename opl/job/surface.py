"""The sections ``workpiece`` and ``passes`` of a job file: their keys, units and defaults."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from opl.errors import InputError
from opl.files.documents import Document
from opl.geometry.machined import CAD, MESHES, load_machined
from opl.geometry.mesh import TriangleMesh, load_mesh
from opl.geometry.outside import facing_inward
from opl.geometry.passes import Kind, MachinedSurface, Order, Passes
from opl.geometry.scallop import row_pitch
from opl.geometry.size import check_sizes

MM = 1e-3

# so much of a surface may look as if it faced into the solid before it is refused
MOST_INWARD = 0.1

_Positive = Annotated[float, Field(gt=0.0)]
_NotNegative = Annotated[float, Field(ge=0.0)]
_Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
_Id = Annotated[int, Field(ge=1)]


class WorkpieceSection(Document):
    """The keys of the section ``workpiece``."""

    surface: str
    surface_unit: Literal["mm", "m"] | None = None
    faces: Annotated[list[_Id], Field(min_length=1)] | None = None
    crease_deg: Annotated[float, Field(gt=0.0, lt=180.0)] | None = None
    reversed_normal: bool = False
    mesh: str
    mesh_unit: Literal["mm", "m"]

    @model_validator(mode="after")
    def _fits(self) -> WorkpieceSection:
        is_mesh = Path(self.surface).suffix.lower() in MESHES
        if is_mesh and self.surface_unit is None:
            raise ValueError("surface_unit is missing: mesh files do not say their unit, mm or m")
        if not is_mesh:
            for key in ("surface_unit", "crease_deg"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key} is for a surface from a mesh, {', '.join(MESHES)}")
        if is_mesh and self.reversed_normal:
            raise ValueError("reversed_normal is not for meshes: their triangles tell the outside")
        return self

    def load_surface(self, path: Path) -> MachinedSurface:
        """Return the surface to be ground.

        Args:
            path: The job file.

        Raises:
            InputError: If its file or a face of it cannot be used.
        """
        unit, crease = self.surface_unit or "mm", np.deg2rad(self.crease_deg or 30.0)
        try:
            return load_machined(
                path.parent / self.surface, self.faces, self.reversed_normal, unit, float(crease)
            )
        except InputError as error:
            raise InputError(f"{path}: workpiece.surface", str(error)) from error
        except ValueError as error:
            raise InputError(f"{path}: workpiece.faces", str(error)) from error

    def load_part(self, path: Path) -> TriangleMesh:
        """Return the solid for collisions.

        Args:
            path: The job file.

        Raises:
            InputError: If its file holds no solid.
        """
        try:
            return load_mesh(path.parent / self.mesh, self.mesh_unit)
        except InputError as error:
            raise InputError(f"{path}: workpiece.mesh", str(error)) from error

    def check_sizes(self, path: Path, surface: MachinedSurface, part: TriangleMesh) -> None:
        """Refuse a surface and a solid that are not of one part of a size that a robot holds.

        Raises:
            InputError: If the unit of one of them must be wrong.
        """
        suffix = Path(self.surface).suffix.lower()
        unit_key = "surface_unit" if suffix in MESHES else "surface"
        try:
            check_sizes(surface, part)
        except ValueError as error:
            key, _, message = str(error).partition(": ")
            key = "mesh_unit" if key == "part" else unit_key
            hint = "; STEP and IGES files carry their unit" if suffix in CAD else ""
            raise InputError(f"{path}: workpiece.{key}", message + hint) from error

    def check_outside(self, path: Path, surface: MachinedSurface, part: TriangleMesh) -> None:
        """Refuse a surface whose normals point into the solid.

        Raises:
            InputError: If they do so at more than a tenth of it.
        """
        inward = facing_inward(surface, part)
        if inward > MOST_INWARD:
            told = f"normals point into the solid at {100.0 * inward:.0f} % of the surface"
            if Path(self.surface).suffix.lower() in MESHES:
                raise InputError(
                    f"{path}: workpiece.surface", f"{told}; export it with its triangles turned"
                )
            raise InputError(
                f"{path}: workpiece.reversed_normal",
                f"{told}; set it to {str(not self.reversed_normal).lower()}"
                + ("" if inward > 0.9 else ", or let all faces of the file point outward"),
            )


class PassesSection(Document):
    """The keys of the section ``passes``."""

    kind: Literal["sections", "along_u", "along_v"] = "sections"
    plane_normal: _Triple | None = None
    pitch_mm: _Positive | None = None
    scallop_mm: _Positive | None = None
    margin_mm: _NotNegative = 0.0
    end_margin_mm: _NotNegative = 0.0
    rows: Annotated[int, Field(ge=1)] | None = None
    repeats: Annotated[int, Field(ge=1, le=20)] = 1
    shift_mm: _NotNegative = 0.0
    bow_height_mm: _Positive
    largest_step_mm: _Positive
    order: Literal["one_way", "zigzag", "both", "shortest"] = "one_way"

    @model_validator(mode="after")
    def _fits(self) -> PassesSection:
        if (self.pitch_mm is None) == (self.scallop_mm is None):
            raise ValueError("needs either pitch_mm or scallop_mm, the height left between rows")
        if (self.kind == "sections") != (self.plane_normal is not None):
            raise ValueError("plane_normal goes with kind: sections, and only there")
        if self.kind != "sections" and self.scallop_mm is not None:
            raise ValueError("scallop_mm goes with kind: sections, and only there")
        return self

    def in_si(self, path: Path, surface: MachinedSurface, wheel_radius: float) -> Passes:
        """Return how the surface is cut.

        Args:
            path: The job file.
            surface: The surface to be ground; a pitch from a scallop height depends on it.
            wheel_radius: Radius of the wheel in [m].

        Raises:
            InputError: If there is no pitch that keeps the scallop height.
        """
        normal = np.array(self.plane_normal or [0.0, 0.0, 0.0])
        if self.pitch_mm is not None:
            pitch = self.pitch_mm * MM
        else:
            if not normal.any():
                raise InputError(f"{path}: passes.plane_normal", "must not be zero")
            height = (self.scallop_mm or 0.0) * MM
            try:
                pitch = row_pitch(surface, normal, height, wheel_radius)
            except ValueError as error:
                raise InputError(f"{path}: passes.scallop_mm", str(error)) from error
        return Passes(
            plane_normal=normal,
            pitch=pitch,
            max_bow_height=self.bow_height_mm * MM,
            largest_step=self.largest_step_mm * MM,
            margin=self.margin_mm * MM,
            rows=self.rows,
            order=Order(self.order),
            kind=Kind(self.kind),
            end_margin=self.end_margin_mm * MM,
            repeats=self.repeats,
            shift=self.shift_mm * MM,
        )
