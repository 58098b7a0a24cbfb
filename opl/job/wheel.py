"""The wheel as job and cell files give it: its size, and where it is, in one of four forms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files.documents import Document
from opl.files.quantities import Positive, at_most, between
from opl.geometry.frames import Array, from_roll_pitch_yaw, inverse, pose
from opl.geometry.touched import KINDS, TouchedError, TouchedFit, fit_touched
from opl.geometry.wheel import ContactWheel
from opl.job.bodies import MM, Matrix, Triple, pose_of
from opl.job.source import Source
from opl.job.values import PlacedWheel

# robot: as its controller's pendant shows positions in the robot's own frame
Frame = Literal["robot", "cell"]
Points = Annotated[list[Triple], at_most(1000)]


def _points(where: str) -> Any:
    return Field(default=[], description=f"{where}.", json_schema_extra={"unit": "mm"})


class PendantSection(Document):
    """Contact frame 0 as a pendant shows a position: R = Rz Ry Rx, turns about fixed axes."""

    model_config = ConfigDict(title="Wheel by a position of the pendant")

    frame: Frame = Field(
        default="robot",
        description="Frame of the values: `robot`, the controller's own robot frame, or `cell`.",
    )
    xyz_mm: Triple = Field(description="X, Y and Z as the pendant shows them.")
    rx_ry_rz_deg: Triple = Field(
        description="Rx, Ry and Rz as the pendant shows them; of Universal Robots its RPY values, "
        "not the rotation vector."
    )


class TouchedSection(Document):
    """Points (x, y, z) touched on the wheel with a calibrated tip, fitted by least squares.

    Left and right are as seen from the front with y of the contact frame up. Three points are
    enough: left_edge, right_edge and axle.
    """

    model_config = ConfigDict(title="Wheel by touched points")
    renamed: ClassVar[Mapping[str, str]] = {"largest_residual_mm": "max_residual_mm"}

    frame: Frame = Field(
        default="robot",
        description="Frame of the points: `robot`, the controller's own robot frame, or `cell`.",
    )
    left_edge: Points = _points(
        "Corner of rim and left side, at the height where the part shall touch"
    )
    right_edge: Points = _points(
        "Corner of rim and right side, at the height where the part shall touch"
    )
    front: Points = _points("On the rim, at the height where the part shall touch")
    axle: Points = _points("On the axis of the axle, such as the centre hole of its end")
    rim: Points = _points("Anywhere on the rim")
    left_side: Points = _points("Anywhere on the flat left side of the wheel")
    right_side: Points = _points("Anywhere on the flat right side of the wheel")
    radius_mm: Positive | None = Field(
        default=None,
        description="Radius of the wheel where it was touched, if the belt was not on; else the "
        "radius of the wheel.",
    )
    max_residual_mm: Positive = Field(
        default=0.5, description="Points that fit worse than this are refused."
    )


class WheelSection(Document):
    """A contact wheel: its size, and where its contact frame 0 is, given in exactly one form.

    Contact frame 0 lies where the part touches in the middle of the wheel: z into the wheel, x
    along the axle to the left as seen from the front, y up.
    """

    model_config = ConfigDict(title="Wheel")
    renamed: ClassVar[Mapping[str, str]] = {"contact_allowance_mm": "max_belt_penetration_mm"}

    T_base_contact0_mm: Matrix | None = Field(
        default=None,
        description="Pose of contact frame 0 in the robot's base frame, 4x4 with its origin in mm. "
        "The base frame lies on axis 1 at the height of axis 2.",
    )
    pendant: PendantSection | None = Field(
        default=None, description="Or contact frame 0 as a pendant shows a position."
    )
    touched: TouchedSection | None = Field(
        default=None, description="Or points touched on the wheel."
    )
    width_mm: Annotated[float, Field(gt=0.0, le=2000.0)] = Field(
        description="Width of the wheel's flat, along its axle."
    )
    radius_mm: Annotated[float, Field(gt=0.0, le=5000.0)] = Field(
        description="Radius of the wheel with the belt on."
    )
    max_roll_deg: Annotated[float, Field(ge=0.0, le=90.0)] = Field(
        description="Largest roll of the part about either edge of the wheel; 0 for none."
    )
    max_belt_penetration_mm: Annotated[float, between(0.0, 50.0)] = Field(
        default=0.5, description="How deep the part may sink into the belt."
    )

    @model_validator(mode="after")
    def _placed_once(self) -> WheelSection:
        known = self._places()
        if sum(getattr(self, key) is not None for key in known) != 1:
            raise ValueError(f"needs exactly one of {', '.join(known)}")
        return self

    def _places(self) -> list[str]:
        return ["T_base_contact0_mm", "pendant", "touched"]

    def in_si(self, source: Source, key: str, robot: Robot, T_cell_base: Array) -> PlacedWheel:
        """Return the wheel in the base frame.

        Args:
            source: Where it stands.
            key: Its place there.
            robot: Whose pendant showed positions.
            T_cell_base: Where its base frame is in the frame of the cell, shape (4, 4).

        Raises:
            InputError: If its points do not tell where it is.
        """
        T_base_cell = inverse(T_cell_base)
        T_base_shown = {"cell": T_base_cell, "robot": inverse(robot.T_controller_base)}
        fit = None
        if self.touched is not None:
            fit = self._fit(self.touched, source.at(f"{key}.touched"))
            belt = self.radius_mm - (self.touched.radius_mm or self.radius_mm)
            T_bare_contact0 = pose(np.eye(3), np.array([0.0, 0.0, -belt * MM]))
            T = T_base_shown[self.touched.frame] @ fit.T_base_contact0 @ T_bare_contact0
        elif self.pendant is not None:
            shown = self.pendant
            angles, origin = np.deg2rad(shown.rx_ry_rz_deg), np.array(shown.xyz_mm) * MM
            T = T_base_shown[shown.frame] @ from_roll_pitch_yaw(angles, origin)
        else:
            T = self._matrix(T_base_cell)
        return PlacedWheel(
            self._name(),
            ContactWheel(
                self.width_mm * MM,
                self.radius_mm * MM,
                float(np.deg2rad(self.max_roll_deg)),
                T,
            ),
            self.max_belt_penetration_mm * MM,
            fit,
        )

    def _name(self) -> str:
        return "wheel"

    def _matrix(self, T_base_cell: Array) -> Array:
        assert self.T_base_contact0_mm is not None
        return pose_of(self.T_base_contact0_mm)

    def _fit(self, touched: TouchedSection, where: str) -> TouchedFit:
        points = {
            kind: [[value * MM for value in point] for point in getattr(touched, kind)]
            for kind in KINDS
        }
        radius = touched.radius_mm or self.radius_mm
        try:
            return fit_touched(
                points, self.width_mm * MM, radius * MM, touched.max_residual_mm * MM
            )
        except TouchedError as error:
            raise InputError(where, str(error)) from error


class CellWheelSection(WheelSection):
    """A contact wheel of the cell: its size, and where it is, given in exactly one form."""

    model_config = ConfigDict(title="Wheel of a cell")

    name: Annotated[str, Field(min_length=1)] = Field(
        default="wheel",
        description="Name by which a job picks it; each of several wheels needs its own.",
    )
    T_cell_contact0_mm: Matrix | None = Field(
        default=None,
        description="Pose of contact frame 0 in the frame of the cell, 4x4 with its origin in mm.",
    )

    def _places(self) -> list[str]:
        return ["T_cell_contact0_mm", *super()._places()]

    def _name(self) -> str:
        return self.name

    def _matrix(self, T_base_cell: Array) -> Array:
        if self.T_cell_contact0_mm is not None:
            return T_base_cell @ pose_of(self.T_cell_contact0_mm)
        return super()._matrix(T_base_cell)
