"""How long each move of a motion takes: at the set feed, and no faster than the joints can follow.

On the wheel and on the way to and from it the time law of `opl.motion.time_law` is asked what the
joints can follow; a free move turns at its share of top speed. The ramps with which a robot leaves
and comes to rest are no part of these times, nor are they of the speeds of a program: the
controller adds them. `opl.program.cycle` counts them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import Robot
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.leads import lead_count
from opl.motion.motion import Motion, Stretch
from opl.motion.process import ProcessSettings
from opl.motion.rounded import rounded_line
from opl.motion.time_law import JointLimits, TimeLaw, fastest_law

# Wanted time of a move in [s] below which its end is no posture of its own for the time law.
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
        motion: The motion with the time of every move.
        way: Way of the ground point along the surface in [m], shape (n,); NaN where the move does
            not stay on the wheel.
        cause: Why it is slower than the feed on each move, n items.
        joint: The joint to blame, shape (n,); -1 where none is.
    """

    motion: Motion
    way: Array
    cause: tuple[Cause, ...]
    joint: NDArray[np.int64]


def timed(motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot) -> Motion:
    """Return a motion with the time of every move; arguments as of `time_motion`."""
    return time_motion(motion, points, process, robot).motion


def time_motion(
    motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Timing:
    """Return how long the moves of a motion take, and why.

    The ground point passes along the surface at the feed, or slower where the contact position
    moves fast over the wheel; approach and retract run at their speed; on free moves the joint with
    the longest way runs at its share of its largest speed. Where a joint cannot follow, moves take
    as long as it needs.

    Args:
        motion: The motion; its durations are not looked at.
        points: Its cutter points.
        process: The speeds.
        robot: Whose motion.

    Raises:
        UnsafeError: If the time law does not keep the limits it was given.
    """
    kinds = _kinds(motion)
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    fastest = (turned / robot.max_speed).max(axis=1)
    arc = np.interp(motion.cutter_point, np.arange(len(points)), points.arc_length)
    on_wheel = np.array([kind == _WHEEL for kind, _ in kinds])
    way = np.where(on_wheel, np.abs(np.diff(arc, prepend=np.nan)), np.nan)
    over_wheel = np.abs(np.diff(motion.contact_position, prepend=np.nan)) / process.contact_speed
    count = lead_count(process.approach_length, process.approach_turn)
    lead = process.approach_length / count / process.approach_speed
    air = np.array([kind == _AIR for kind, _ in kinds])
    wanted = np.where(air, fastest / process.air_speed, lead)
    wanted[on_wheel] = np.maximum(way / process.feed, over_wheel)[on_wheel]

    duration = np.maximum(wanted, fastest)
    duration[0] = 0.0
    joint = np.where(fastest > wanted, (turned / robot.max_speed).argmax(axis=1), -1)
    by_acceleration = np.zeros(len(motion), dtype=bool)
    for moves in _pieces(kinds):
        kept = moves[duration[moves] > SHORTEST]
        if not len(kept):
            continue
        postures = np.concatenate([[moves[0] - 1], kept])
        law = _law(motion.q[postures], duration[kept], robot)
        needed = np.diff(law.node_times)
        slowed = needed > FOLLOWED * duration[kept]
        to_blame, accelerating = _blamed(law)
        joint[kept[slowed]] = to_blame[slowed]
        by_acceleration[kept[slowed]] = accelerating[slowed]
        duration[kept] = np.maximum(needed, duration[kept])
    cause = [Cause.NONE] * len(motion)
    for move in np.flatnonzero(on_wheel):
        if duration[move] * process.feed > FOLLOWED * way[move]:
            slow = Cause.ACCELERATION if by_acceleration[move] else Cause.SPEED
            cause[move] = Cause.PIVOTING if joint[move] < 0 else slow
    return Timing(replace(motion, duration=duration), way, tuple(cause), joint)


def followed(q: Array, times: Array, robot: Robot) -> Array:
    """Return the times of moves that run on without a rest, longer where the joints need it.

    Args:
        q: Joint positions in [rad], shape (n, 6).
        times: Wanted times of the moves in [s], shape (n - 1,).
        robot: Whose moves.
    """
    kept = np.flatnonzero(times > SHORTEST)
    found = times.copy()
    if len(kept):
        law = _law(q[np.concatenate([kept[:1], kept + 1])], times[kept], robot)
        found[kept] = np.maximum(np.diff(law.node_times), times[kept])
    return found


def _law(q: Array, times: Array, robot: Robot) -> TimeLaw:
    limits = JointLimits(robot.max_speed, robot.max_acceleration)
    return fastest_law(rounded_line(q, times), limits, at_rest=False)


_WHEEL, _IN, _OUT, _AIR = "wheel", "in", "out", "air"


def _kinds(motion: Motion) -> list[tuple[str, int]]:
    """Return what each move is part of, and of which pass; the first posture has no move."""
    on_wheel = [stretch in (Stretch.GRIND, Stretch.BETWEEN) for stretch in motion.stretch]
    kinds = []
    for k, stretch in enumerate(motion.stretch):
        index = int(motion.pass_index[k])
        if on_wheel[k] and k and on_wheel[k - 1] and motion.pass_index[k - 1] == index:
            kinds.append((_WHEEL, index))
        elif on_wheel[k] or stretch is Stretch.APPROACH:
            kinds.append((_IN, index))  # the move onto the first cutter point ends the approach
        else:
            kinds.append((_OUT if stretch is Stretch.RETRACT else _AIR, index))
    return kinds


def _pieces(kinds: list[tuple[str, int]]) -> Iterator[NDArray[np.intp]]:
    """Yield the moves of each pass, approach and retract: between two of them the robot rests."""
    for (kind, _), moves in groupby(range(1, len(kinds)), key=kinds.__getitem__):
        if kind != _AIR:
            yield np.fromiter(moves, dtype=np.intp)


def _blamed(law: TimeLaw) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return which joint is nearest to a limit of its own on each move, and whether to which."""
    starts = law.node_index[:-1]
    speed = np.maximum.reduceat(law.speed_load, starts, axis=0)
    acceleration = np.maximum.reduceat(law.acceleration_load, starts, axis=0)
    loads = np.maximum(speed, acceleration)
    joint = loads.argmax(axis=1)
    rows = np.arange(len(joint))
    return joint, acceleration[rows, joint] >= speed[rows, joint]
