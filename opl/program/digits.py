"""Joint angles in the digits of a language: as texts, and as the configurations they stand for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from opl.cell.robot import Robot
from opl.errors import UnsafeError
from opl.geometry.frames import Array
from opl.program.settings import ProgramSettings

Rounding = Callable[[Array, Robot, ProgramSettings], Array]

_SLACK = 1e-6  # of a last digit: round-off in a limit that is a whole number of them


def degrees(q: Array, decimals: int) -> list[str]:
    """Return joint positions [rad] in [deg] as written, never -0."""
    return [fixed(float(angle), decimals) for angle in np.rad2deg(q)]


def fixed(value: float, decimals: int) -> str:
    """Return a number as written, never -0."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def within(values: Array, lower: Array, upper: Array, decimals: int) -> Array:
    """Return values rounded to some decimals, inwards at a limit.

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


def rounded_radians(decimals: int) -> Rounding:
    """Return what rounds configurations, shape (n, 6), to radians of few decimals."""
    return lambda q, robot, settings: within(q, robot.lower, robot.upper, decimals)


def rounded_degrees(decimals: int) -> Rounding:
    """Return what rounds configurations, shape (n, 6), to degrees of few decimals."""

    def rounded(q: Array, robot: Robot, settings: ProgramSettings) -> Array:
        limits = np.rad2deg(robot.lower), np.rad2deg(robot.upper)
        return np.deg2rad(within(np.rad2deg(q), *limits, decimals))

    return rounded
