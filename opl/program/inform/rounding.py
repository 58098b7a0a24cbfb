"""The configurations that an INFORM job can express: pulses are whole, poses have few digits."""

from __future__ import annotations

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.program.controller import ControllerProfile
from opl.program.inform.motion import write_positions
from opl.program.moves import Move, Program
from opl.program.pulses import PulseScale
from opl.program.settings import PositionForm, ProgramSettings


def rounded(q: Array, robot: Robot, settings: ProgramSettings, profile: ControllerProfile) -> Array:
    """Return the configurations nearest to some that a job can express, shape (n, 6).

    Within the limits: a joint at its limit is rounded inwards.

    Args:
        q: Joint positions in [rad], shape (n, 6).
        robot: Whose.
        settings: How positions are written.
        profile: The controller.

    Raises:
        UnsafeError: If one is beyond the limits, or no Cartesian position names it.
    """
    if settings.positions is PositionForm.PULSES:
        scale = PulseScale.of(robot)
        ratio = scale.pulses_per_radian
        slack = 1e-6  # pulses
        lowest, highest = (
            np.ceil(scale.lower * ratio - slack),
            np.floor(scale.upper * ratio + slack),
        )
        return scale.to_angles(np.clip(scale.to_pulses(q), lowest, highest))
    moves = tuple(
        Move(p, 1.0, exact_stop=True, on_wheel=False, motion_index=k) for k, p in enumerate(q)
    )
    return write_positions(Program("ROUNDED", moves=moves), robot, settings, profile).q
