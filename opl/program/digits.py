"""Joint angles in the digits of a language: as texts, and as the configurations they stand for."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import Robot
from opl.errors import UnsafeError

Array = NDArray[np.float64]

_SLACK = 1e-6  # of a last digit: round-off in a limit that is a whole number of them


def degrees(q: Array, decimals: int) -> list[str]:
    """Return joint positions [rad] in [deg] as written, never -0."""
    return [fixed(float(angle), decimals) for angle in np.rad2deg(q)]


def fixed(value: float, decimals: int) -> str:
    """Return a number as written, never -0."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def within(values: Array, lower: Array, upper: Array, decimals: int) -> Array:
    """Return values rounded to some decimals, inwards where a limit is in the way.

    Args:
        values: Any number of rows, shape (..., k).
        lower: Smallest values, shape (..., k).
        upper: Largest values, shape (..., k).
        decimals: Digits behind the point.

    Raises:
        UnsafeError: If a value is beyond its limit by more than a last digit.
    """
    unit = 10.0**decimals
    lowest, highest = np.ceil(lower * unit - _SLACK), np.floor(upper * unit + _SLACK)
    rounded = np.clip(np.rint(values * unit), lowest, highest)
    if np.abs(rounded - values * unit).max(initial=0.0) > 1.0 + _SLACK:
        raise UnsafeError("a configuration is beyond the limits of the joints")
    # as the nearest number to its digits, which is what a reader takes from them
    return np.asarray(np.round(rounded / unit, decimals) + 0.0)


def rounded_degrees(q: Array, robot: Robot, decimals: int) -> Array:
    """Return the configurations nearest to some that degrees of few decimals can express.

    Args:
        q: Joint positions in [rad], shape (n, 6).
        robot: Whose.
        decimals: Digits of an angle behind the point.

    Raises:
        UnsafeError: If one is beyond the limits.
    """
    limits = np.rad2deg(robot.lower), np.rad2deg(robot.upper)
    return np.deg2rad(within(np.rad2deg(q), *limits, decimals))
