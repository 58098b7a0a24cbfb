"""The key ``program.user_frame``, and home as a program in a user frame leads to it."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field

from opl.cell.robot import Robot
from opl.files.documents import Document
from opl.files.quantities import between
from opl.geometry.frames import Array
from opl.job.bodies import Matrix, pose_of
from opl.program.inform.cartesian import beside_half_turns
from opl.program.settings import UserFrame

HOME_MARGIN = np.deg2rad(3.0)  # of home from half a turn


class UserFrameSection(Document):
    """A user frame as it is set on the controller."""

    model_config = ConfigDict(title="User frame")

    number: Annotated[int, between(1, 999)] = Field(
        default=1, description="Number of the user frame."
    )
    T_base_user_mm: Matrix | None = Field(
        default=None,
        description="Pose of the user frame in the robot's base frame, 4x4 with its origin in mm; "
        "else contact frame 0 of the wheel.",
    )

    def in_si(self, T_base_contact0: Array) -> UserFrame:
        """Return the frame, that of the wheel where no other is given."""
        given = self.T_base_user_mm
        return UserFrame(self.number, T_base_contact0 if given is None else pose_of(given))


def home_in_user_frame(robot: Robot, home: Array) -> Array:
    """Return home as a program in a user frame leads to it, joint positions in [rad], shape (6,).

    R, T and S stand clear of half a turn: a frame that is touched up moves the joints, and beyond
    half a turn the same position is another one, a full turn away.
    """
    clear: Array = beside_half_turns(home[None], robot, HOME_MARGIN, HOME_MARGIN)[0]
    return clear
