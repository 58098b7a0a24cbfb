"""Limits of the joints: those of the robot, and those that the dress pack adds in a cell.

The robot keeps its own ranges, because its controller tells full turns apart by them. A cell
narrows the range of a joint, or of a sum of joints: the hose along the forearm does not care which
of two axes winds it up, R + T together may turn only so far. Such a limit is linear in the joints,
so where both ends of a linear joint move keep it, the whole move does.

This is what the planner asks; the replay has its own sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.cell.robot import Robot
from opl.geometry.frames import Array


@dataclass(frozen=True, eq=False)
class Limit:
    """A range that a joint, or a weighted sum of joints, must stay in, beside the robot's own.

    Attributes:
        name: What messages call it, such as ``R`` or ``R+T``.
        coefficients: Weight of each joint, shape (6,).
        lower: Smallest sum in [rad].
        upper: Largest sum in [rad].
    """

    name: str
    coefficients: Array
    lower: float
    upper: float

    def __post_init__(self) -> None:
        copy = np.array(self.coefficients, dtype=float)
        copy.setflags(write=False)
        object.__setattr__(self, "coefficients", copy)


# [rad] postures are rounded to what a program can say before they are proven; pulses and digits are
# finer than this, for each joint in the sum
ROUNDING = np.deg2rad(0.01)


def within(robot: Robot, limits: Sequence[Limit], q: Array) -> np.ndarray:
    """Return which postures keep every limit; one with NaN keeps none.

    Args:
        robot: For its own limits.
        limits: Those of the cell.
        q: Joint positions in [rad], shape (..., 6).

    Returns:
        Shape (...) of bool.
    """
    kept = ((q >= robot.lower) & (q <= robot.upper)).all(axis=-1)
    for limit in limits:
        kept &= _keeps(limit, q)
    return np.asarray(kept)


def broken(robot: Robot, limits: Sequence[Limit], q: Array) -> list[str]:
    """Return the names of the limits that any of some postures breaks.

    Args:
        robot: For its own limits.
        limits: Those of the cell.
        q: Joint positions in [rad], shape (..., 6).
    """
    q = q.reshape(-1, 6)
    beyond = ((q < robot.lower) | (q > robot.upper)).any(axis=0)
    names = [robot.joint_names[joint] for joint in np.flatnonzero(beyond)]
    for limit in limits:
        if not _keeps(limit, q).all():
            names.append(limit.name)
    return list(dict.fromkeys(names))


def _keeps(limit: Limit, q: Array) -> np.ndarray:
    total = q @ limit.coefficients
    margin = ROUNDING * np.abs(limit.coefficients).sum()
    return (total >= limit.lower + margin) & (total <= limit.upper - margin)
