"""The wheel as job and cell files give it: its size, and where it is by one of four ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from opl.cell.robot import Robot
from opl.errors import InputError
from opl.files.documents import Document
from opl.geometry.frames import Array, from_roll_pitch_yaw, inverse, pose
from opl.geometry.touched import KINDS, TouchedError, TouchedFit, fit_touched
from opl.geometry.wheel import ContactWheel
from opl.job.bodies import MM, Matrix, NotNegative, Positive, Triple, pose_of
from opl.job.source import Source

# robot: as its controller's pendant shows positions in the robot's own frame
Frame = Literal["robot", "cell"]
Points = list[Triple]


class PendantSection(Document):
    """Contact frame 0 as a pendant shows a position: R = Rz Ry Rx, turns about fixed axes."""

    frame: Frame = "robot"
    xyz_mm: Triple
    rx_ry_rz_deg: Triple


class TouchedSection(Document):
    """Points touched on the wheel; what each kind says is told in `opl.geometry.touched`."""

    frame: Frame = "robot"
    left_edge: Points = Field(default=[])
    right_edge: Points = Field(default=[])
    front: Points = Field(default=[])
    axle: Points = Field(default=[])
    rim: Points = Field(default=[])
    left_side: Points = Field(default=[])
    right_side: Points = Field(default=[])
    radius_mm: Positive | None = None  # where it was touched, if not with the belt on
    largest_residual_mm: Positive = 0.5


class WheelSection(Document):
    """One wheel."""

    T_base_contact0_mm: Matrix | None = None
    pendant: PendantSection | None = None
    touched: TouchedSection | None = None
    width_mm: Positive
    radius_mm: Positive
    max_roll_deg: Annotated[float, Field(ge=0.0, le=90.0)]
    contact_allowance_mm: NotNegative = 0.5

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
        above = robot.controller_base_height - robot.base_height
        T_base_seen = {"cell": T_base_cell, "robot": pose(np.eye(3), np.array([0.0, 0.0, above]))}
        fit = None
        if self.touched is not None:
            fit = self._fit(self.touched, source.at(f"{key}.touched"))
            belt = self.radius_mm - (self.touched.radius_mm or self.radius_mm)
            T_bare_contact0 = pose(np.eye(3), np.array([0.0, 0.0, -belt * MM]))
            T = T_base_seen[self.touched.frame] @ fit.T_base_contact0 @ T_bare_contact0
        elif self.pendant is not None:
            shown = self.pendant
            angles, origin = np.deg2rad(shown.rx_ry_rz_deg), np.array(shown.xyz_mm) * MM
            T = T_base_seen[shown.frame] @ from_roll_pitch_yaw(angles, origin)
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
            self.contact_allowance_mm * MM,
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
                points, self.width_mm * MM, radius * MM, touched.largest_residual_mm * MM
            )
        except TouchedError as error:
            raise InputError(where, str(error)) from error


class CellWheelSection(WheelSection):
    """One wheel of a cell, that a job picks by its name."""

    name: Annotated[str, Field(min_length=1)] = "wheel"
    T_cell_contact0_mm: Matrix | None = None

    def _places(self) -> list[str]:
        return ["T_cell_contact0_mm", *super()._places()]

    def _name(self) -> str:
        return self.name

    def _matrix(self, T_base_cell: Array) -> Array:
        if self.T_cell_contact0_mm is not None:
            return T_base_cell @ pose_of(self.T_cell_contact0_mm)
        return super()._matrix(T_base_cell)


@dataclass(frozen=True)
class PlacedWheel:
    """A wheel in the base frame, and how it came there.

    Attributes:
        name: What the cell calls it.
        wheel: The wheel.
        contact_allowance: How deep a part may sink into its belt in [m].
        fit: How its touched points fit; None if it was given as a pose.
    """

    name: str
    wheel: ContactWheel
    contact_allowance: float
    fit: TouchedFit | None
