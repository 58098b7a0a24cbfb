"""The section ``workpiece`` of a job file: the part, and its surface to be ground."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from opl.errors import InputError
from opl.files.documents import Document
from opl.files.quantities import between
from opl.geometry.frames import Array, transform
from opl.geometry.machined import CAD, MESHES, load_machined
from opl.geometry.mesh import TriangleMesh, load_mesh
from opl.geometry.passes import MachinedSurface
from opl.geometry.surface_on_solid import SizeError, check_sizes, facing_inward
from opl.job.bodies import MM, Triple
from opl.job.source import Source
from opl.program.settings import Load

# so much of a surface may look as if it faced into the solid before it is refused
MOST_INWARD = 0.1

_Id = Annotated[int, between(1, 1_000_000)]

# key of the validation context: what a program gives as a value, ``surface`` or ``part`` or both
GIVEN = "given"


class GripperSection(Document):
    """What the gripper weighs."""

    model_config = ConfigDict(title="Gripper")

    mass_kg: Annotated[float, between(0.001, 10_000.0)] = Field(
        description="Mass of the gripper and all else between flange and part.",
        json_schema_extra={"unit": "kg"},
    )
    centre_mm: Triple = Field(description="Its centre of gravity in the flange frame.")

    def in_si(self) -> Load:
        """Return the load."""
        return Load(self.mass_kg, np.array(self.centre_mm) * MM)


class WorkpieceSection(Document):
    """The part as a closed solid, and its surface to be ground; both in the workpiece frame."""

    model_config = ConfigDict(
        title="Workpiece", json_schema_extra={"required": ["surface", "mesh", "mesh_unit"]}
    )

    surface: str | None = Field(
        default=None,
        validate_default=True,
        description="The surface to be ground: NURBS faces (.json, .yaml, in mm), a CAD file "
        "(.step, .stp, .iges, .igs) or a mesh (.stl, .ply, .obj), relative to this file.",
    )
    surface_unit: Literal["mm", "m"] | None = Field(
        default=None, description="Unit of a surface from a mesh; needed there, and only there."
    )
    faces: Annotated[list[_Id], Field(min_length=1, max_length=10_000)] | None = Field(
        default=None,
        description="Faces to be ground, by their numbers in `opl faces`; else all of the file.",
    )
    crease_deg: Annotated[float, Field(gt=0.0, lt=180.0)] | None = Field(
        default=None,
        description="Angle between triangles of a mesh that ends a face; without it, 30. For "
        "surfaces from a mesh only.",
    )
    reversed_normal: bool = Field(
        default=False,
        description="Whether the outside of the faces is the side that the file has as inside. Not "
        "for meshes.",
    )
    mesh: str | None = Field(
        default=None,
        validate_default=True,
        description="The part as a closed solid, for collisions: .stl, .ply or .obj, relative to "
        "this file.",
    )
    mesh_unit: Literal["mm", "m"] | None = Field(
        default=None,
        validate_default=True,
        description="Unit of the mesh file, which does not carry one.",
    )

    density_kg_m3: Annotated[float, between(1.0, 25_000.0)] | None = Field(
        default=None,
        description="Density of the part: its mass and centre of gravity, from its mesh, are told "
        "in the program and where its controller keeps them: TOOL.CND, RAPID's loaddata; with "
        "`program.gripper` KRL's $LOAD and UR's payload too. FANUC's PAYLOAD is set there.",
        json_schema_extra={"unit": "kg/m3"},
    )

    @field_validator("surface", "mesh", "mesh_unit")
    @classmethod
    def _given_once(cls, value: str | None, info: ValidationInfo) -> str | None:
        """Require a key, unless a program gives what it names; then refuse it."""
        given = (info.context or {}).get(GIVEN, ())
        argument = "surface" if info.field_name == "surface" else "part"
        if value is None and argument not in given:
            raise PydanticCustomError("missing", "is missing")
        if value is not None and argument in given:
            raise ValueError(f"the argument {argument} is given as well; leave one out")
        return value

    @model_validator(mode="after")
    def _fits(self) -> WorkpieceSection:
        if self.surface is None:
            beside = self.model_fields_set - {"mesh", "mesh_unit"}
            if beside:
                raise ValueError(f"{min(beside)} goes with surface, a file")
            return self
        is_mesh = self._suffix in MESHES
        if is_mesh and self.surface_unit is None:
            raise ValueError("surface_unit is missing: mesh files do not say their unit, mm or m")
        if not is_mesh:
            for key in ("surface_unit", "crease_deg"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key} is for a surface from a mesh, {', '.join(MESHES)}")
        if is_mesh and self.reversed_normal:
            raise ValueError("reversed_normal is not for meshes: their triangles tell the outside")
        return self

    @property
    def _suffix(self) -> str:
        """The kind of the surface's file, e.g. ``.stl``."""
        return Path(self.surface or "").suffix.lower()

    def load_surface(self, source: Source) -> MachinedSurface:
        """Return the surface to be ground.

        Raises:
            InputError: If its file or a face of it cannot be used.
        """
        unit, crease = self.surface_unit or "mm", np.deg2rad(self.crease_deg or 30.0)
        try:
            return load_machined(
                source.file(str(self.surface)),
                self.faces,
                self.reversed_normal,
                unit,
                float(crease),
            )
        except InputError as error:
            raise InputError(source.at("workpiece.surface"), str(error)) from error
        except ValueError as error:
            raise InputError(source.at("workpiece.faces"), str(error)) from error

    def load_part(self, source: Source) -> TriangleMesh:
        """Return the solid for collisions.

        Raises:
            InputError: If its file holds no solid.
        """
        try:
            return load_mesh(source.file(str(self.mesh)), self.mesh_unit or "mm")
        except InputError as error:
            raise InputError(source.at("workpiece.mesh"), str(error)) from error

    def load_in_hand(self, part: TriangleMesh, T_flange_workpiece: Array) -> Load | None:
        """Return mass and centre of gravity of the part, None without a density."""
        if self.density_kg_m3 is None:
            return None
        p_flange = transform(T_flange_workpiece, part.centre_of_volume[None])[0]
        return Load(self.density_kg_m3 * part.volume, p_flange)

    def check_sizes(self, source: Source, surface: MachinedSurface, part: TriangleMesh) -> None:
        """Refuse a surface and a solid that are not of one part of a size that a robot holds.

        Raises:
            InputError: If the unit of one of them must be wrong.
        """
        unit_key = "surface_unit" if self._suffix in MESHES else "surface"
        try:
            check_sizes(surface, part)
        except SizeError as error:
            hint = "; STEP and IGES files carry their unit" if self._suffix in CAD else ""
            if error.of == "part":
                where = "part" if self.mesh is None else "workpiece.mesh_unit"
            else:
                where = "surface" if self.surface is None else f"workpiece.{unit_key}"
            raise InputError(source.at(where), str(error) + hint) from error

    def check_outside(self, source: Source, surface: MachinedSurface, part: TriangleMesh) -> None:
        """Refuse a surface whose normals point into the solid.

        Raises:
            InputError: If they do so at more than a tenth of it.
        """
        inward = facing_inward(surface, part)
        if inward > MOST_INWARD:
            fault = f"normals point into the solid at {100.0 * inward:.0f} % of the surface"
            if self.surface is None:
                raise InputError(source.at("surface"), f"{fault}; turn its outside round")
            if self._suffix in MESHES:
                raise InputError(
                    source.at("workpiece.surface"), f"{fault}; export it with its triangles turned"
                )
            raise InputError(
                source.at("workpiece.reversed_normal"),
                f"{fault}; set it to {str(not self.reversed_normal).lower()}"
                + ("" if inward > 0.9 else ", or let all faces of the file point outward"),
            )
