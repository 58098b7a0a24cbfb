"""The configurations that a UR script can express: radians of six decimals."""

from __future__ import annotations

from opl.cell.robot import Robot
from opl.program.digits import within
from opl.program.settings import Array, ProgramSettings

DECIMALS = 6


def rounded(q: Array, robot: Robot, settings: ProgramSettings) -> Array:
    """Return the configurations nearest to some that a script can express, shape (n, 6).

    Raises:
        UnsafeError: If one is beyond the limits.
    """
    return within(q, robot.lower, robot.upper, DECIMALS)
