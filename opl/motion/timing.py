"""How long each move of a motion takes: at the set feed, and no faster than the joints can follow.

On the wheel, on approaches and on retracts the time law of `opl.motion.time_law` says what the
joints can follow; a free move turns at its share of top speed. The ramps with which a robot leaves
and comes to rest are no part of these times, nor are they of the speeds of a program: the
controller adds them. `opl.program.cycle` counts them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.leads import lead_count
from opl.motion.motion import Motion, Phase, TimedMotion
from opl.motion.process_settings import ProcessSettings
from opl.motion.rounded import rounded_line
from opl.motion.time_law import JointLimits, TimeLaw, fastest_law

# Wanted time of a move in [s] below which its end is no configuration of its own for the time law.
SHORTEST = 1e-6
FOLLOWED = 1.01  # a move that takes no longer than this times what is wanted keeps it


class Cause(str, Enum):
    """Why the ground point is slower than the feed."""

    NONE = "none"
    PIVOTING = "pivoting"  # the contact moves over the wheel, which has a speed limit of its own
    SPEED = "speed"  # a joint turns at its top speed
    ACCELERATION = "acceleration"  # a joint speeds up or slows down as fast as it can


@dataclass(frozen=True, eq=False)
class Timing:
    """A motion with its times, and what sets them.

    Attributes:
        timed: The motion with the time of every move.
        surface_distance: What the ground point moves along the surface in [m], shape (n,); NaN
            where the move does not stay on the wheel.
        cause: Why it is slower than the feed on each move, n items.
        joint: The joint that limits it, shape (n,); -1 where none does.
    """

    timed: TimedMotion
    surface_distance: Array
    cause: tuple[Cause, ...]
    joint: NDArray[np.int64]


def time_motion(
    motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Timing:
    """Return how long the moves of a motion take, and why.

    The ground point passes along the surface at the feed, or slower where the contact position
    moves fast over the wheel; approach and retract run at their speed; on free moves the joint that
    takes longest runs at its share of its largest speed. Where a joint cannot follow, moves take as
    long as it needs.

    Raises:
        UnsafeError: If the time law does not keep the limits it was given.
    """
    grinding = motion.grinding
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    fastest = (turned / robot.max_speed).max(axis=1)
    arc = np.interp(motion.cutter_point, np.arange(len(points)), points.arc_length)
    distance = np.where(grinding, np.abs(np.diff(arc, prepend=np.nan)), np.nan)
    over_wheel = np.abs(np.diff(motion.contact_position, prepend=np.nan)) / process.contact_speed
    count = lead_count(process.approach_length, process.approach_turn)
    lead = process.approach_length / count / process.approach_speed
    wanted = np.where(motion.free, fastest / process.air_speed, lead)
    wanted[grinding] = np.maximum(distance / process.feed, over_wheel)[grinding]

    duration = np.maximum(wanted, fastest)
    duration[0] = 0.0
    joint = np.where(fastest > wanted, (turned / robot.max_speed).argmax(axis=1), -1)
    by_acceleration = np.zeros(len(motion), dtype=bool)
    for phase, moves in motion.runs():  # between two of them the robot rests
        kept = moves[duration[moves] > SHORTEST]
        if phase is Phase.FREE or not len(kept):
            continue
        rows = np.concatenate([[moves[0] - 1], kept])
        law = _law(motion.q[rows], duration[kept], robot)
        needed = np.diff(law.node_times)
        slowed = needed > FOLLOWED * duration[kept]
        limiting, accelerating = _limiting_joint(law)
        joint[kept[slowed]] = limiting[slowed]
        by_acceleration[kept[slowed]] = accelerating[slowed]
        duration[kept] = np.maximum(needed, duration[kept])
    cause = [Cause.NONE] * len(motion)
    for move in np.flatnonzero(grinding):
        if duration[move] * process.feed > FOLLOWED * distance[move]:
            slow = Cause.ACCELERATION if by_acceleration[move] else Cause.SPEED
            cause[move] = Cause.PIVOTING if joint[move] < 0 else slow
    return Timing(TimedMotion(motion, duration), distance, tuple(cause), joint)


def air_seconds(motion: Motion, robot: Robot, process: ProcessSettings) -> float:
    """Return the time of all free moves in [s], ramps left out."""
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    fastest = (turned / robot.max_speed).max(axis=1)
    return float(fastest[motion.free].sum()) / process.air_speed


def followed(q: Array, times: Array, robot: Robot) -> Array:
    """Return the times of moves that run on without a rest, longer where the joints need it.

    `q` is in [rad], shape (n, 6); `times` are the wanted times of the moves in [s], shape (n - 1,).
    """
    kept = np.flatnonzero(times > SHORTEST)
    found: Array = times.copy()
    if len(kept):
        law = _law(q[np.concatenate([kept[:1], kept + 1])], times[kept], robot)
        found[kept] = np.maximum(np.diff(law.node_times), times[kept])
    return found


def _law(q: Array, times: Array, robot: Robot) -> TimeLaw:
    limits = JointLimits(robot.max_speed, robot.max_acceleration)
    return fastest_law(rounded_line(q, times), limits, at_rest=False)


def _limiting_joint(law: TimeLaw) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return which joint is nearest to a limit of its own on each move, and whether to which."""
    starts = law.node_index[:-1]
    speed = np.maximum.reduceat(law.speed_load, starts, axis=0)
    acceleration = np.maximum.reduceat(law.acceleration_load, starts, axis=0)
    loads = np.maximum(speed, acceleration)
    joint = loads.argmax(axis=1)
    rows = np.arange(len(joint))
    return joint, acceleration[rows, joint] >= speed[rows, joint]
