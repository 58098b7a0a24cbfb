"""The configurations that a RAPID module can express: degrees of four decimals."""

from __future__ import annotations

from opl.cell.robot import Robot
from opl.program.digits import rounded_degrees
from opl.program.settings import Array, ProgramSettings

DECIMALS = 4


def rounded(q: Array, robot: Robot, settings: ProgramSettings) -> Array:
    """Return the configurations nearest to some that a module can express, shape (n, 6).

    Raises:
        UnsafeError: If one is beyond the limits.
    """
    return rounded_degrees(q, robot, DECIMALS)
