"""How long each move of a motion takes: at the set feed, and no faster than the joints can follow.

On the wheel, on approaches and on retracts the time law of `opl.motion.time_law` says what the
joints can follow; a free move turns at its share of top speed. The ramps with which a robot leaves
and comes to rest are no part of these times, nor are they of the speeds of a program: the
controller adds them. `opl.program.cycle` counts them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import SAME_CONFIGURATION, Robot, forward_kinematics
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.gradual import counted, gradual, largest_ratio
from opl.motion.motion import Motion, Phase, TimedMotion
from opl.motion.process_settings import ProcessSettings
from opl.motion.rounded import rounded_line
from opl.motion.time_law import JointLimits, TimeLaw, fastest_law

# Wanted time of a move in [s] below which its end is no configuration of its own for the time law.
SHORTEST = 1e-6
FOLLOWED = 1.01  # a move that takes no longer than this times what is wanted keeps it
AT_CONTACT = 1e-6  # [m] from the contact that a lead begins or ends at it
MOST_ROUNDS = 4  # of asking the joints again after moves were slowed for their neighbours
# Changes of speed from one move to the next, as `_suddenness` has them, that the corners of a time
# law leave as well: its own are up to 1.3 of what a joint can, because they take more than a move.
SUDDEN = 1.4
SHORTEST_FREE = 0.05  # [s] of a free move: a shorter one is over before a robot is at its speed


class Cause(str, Enum):
    """Why the ground point is slower than the feed."""

    NONE = "none"
    PIVOTING = "pivoting"  # the contact moves over the wheel, which has a speed limit of its own
    SPEED = "speed"  # a joint turns at its top speed
    ACCELERATION = "acceleration"  # a joint speeds up or slows down as fast as it can
    NEIGHBOUR = "slow neighbour"  # a move near by is slow, and speeds change gradually


@dataclass(frozen=True, eq=False)
class Timing:
    """A motion with its times, and what sets them.

    Attributes:
        timed: The written configurations with the time of every move.
        surface_distance: What the ground point moves along the surface in [m], shape (n,); NaN
            where the move does not stay on the wheel.
        cause: Why it is slower than the feed on each move, n items.
        joint: The joint that limits it, shape (n,); -1 where none does.
        speed_ratio: Largest ratio of the speeds of neighbouring moves of a pass and its leads, as
            `opl.motion.gradual` counts them.
    """

    timed: TimedMotion
    surface_distance: Array
    cause: tuple[Cause, ...]
    joint: NDArray[np.int64]
    speed_ratio: float


def time_motion(
    motion: Motion, points: CutterPoints, process: ProcessSettings, robot: Robot
) -> Timing:
    """Return how long the moves of a motion take, and why.

    The ground point passes along the surface at the feed, or slower where the contact position
    moves fast over the wheel. The moves onto the wheel and off it run at the feed, the others of
    approach and retract at theirs; on free moves the joint that takes longest runs at its share of
    its largest speed. Where a joint cannot follow, moves take as long as it needs. From approach to
    retract the robot does not rest, and the speed changes gradually (`opl.motion.gradual`). A move
    through configurations that are not written takes their times together.

    Raises:
        UnsafeError: If the time law does not keep the limits it was given.
    """
    distances, least = on_wheel(motion, points, process)
    surface_distance, least = _between(motion, distances), _between(motion, least)
    motion = motion.take(motion.positions)
    grinding = motion.grinding
    surface_distance[~grinding] = np.nan
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    fastest = (turned / robot.max_speed).max(axis=1)
    # the part is only moved on a lead, so every point of it moves as the flange does
    p_flange = forward_kinematics(robot, motion.q)[:, :3, 3]
    moved = np.linalg.norm(np.diff(p_flange, axis=0, prepend=p_flange[:1]), axis=1)
    distance = np.where(grinding, surface_distance, moved)
    counts = np.where(grinding, counted(surface_distance, least, process.feed), 1.0)
    # a move to where it begins is none, and not written
    moves_freely = motion.free & (turned.max(axis=1) > SAME_CONFIGURATION)
    wanted = np.maximum(fastest / process.air_speed, np.where(moves_freely, SHORTEST_FREE, 0.0))
    wanted[grinding] = least[grinding]

    duration = np.maximum(wanted, fastest)
    duration[0] = 0.0
    joint = np.where(fastest > wanted, (turned / robot.max_speed).argmax(axis=1), -1)
    by_acceleration = np.zeros(len(motion), dtype=bool)
    by_neighbour = np.zeros(len(motion), dtype=bool)
    speed_ratio = 1.0
    for moves in _without_rest(motion):
        near_wheel = _near_wheel(moved[moves], [motion.phase[move] for move in moves], process)
        duration[moves] = np.maximum(duration[moves], near_wheel)
        kept = moves[duration[moves] > SHORTEST]
        if not len(kept):
            continue
        rows = np.concatenate([[moves[0] - 1], kept])
        way, weight = distance[kept], counts[kept]
        found = duration[kept]
        for _ in range(MOST_ROUNDS):
            even = gradual(way, found, weight, process.feed)
            law = _law(motion.q[rows], even, robot)
            needed = np.diff(law.node_times)
            slowed = needed > FOLLOWED * even
            limiting, accelerating = _limiting_joint(law)
            joint[kept[slowed]] = limiting[slowed]
            by_acceleration[kept[slowed]] = accelerating[slowed]
            followed_there = np.maximum(needed, even)
            # what joints slow down, slows its neighbours
            found = gradual(way, followed_there, weight, process.feed)
            by_neighbour[kept] = found > FOLLOWED * duration[kept]
            if _suddenness(motion.q[rows], found, robot) <= SUDDEN:
                break
        else:
            found = followed_there
        duration[kept] = found
        speed_ratio = max(speed_ratio, largest_ratio(way, found, weight, process.feed))
    cause = [Cause.NONE] * len(motion)
    for move in np.flatnonzero(grinding):
        if duration[move] * process.feed > FOLLOWED * distance[move]:
            slow = Cause.ACCELERATION if by_acceleration[move] else Cause.SPEED
            other = Cause.NEIGHBOUR if by_neighbour[move] else Cause.PIVOTING
            cause[move] = other if joint[move] < 0 else slow
    return Timing(TimedMotion(motion, duration), surface_distance, tuple(cause), joint, speed_ratio)


def _without_rest(motion: Motion) -> Iterator[NDArray[np.intp]]:
    """Yield the moves of each pass and its leads, from rest to rest."""
    for free, runs in groupby(motion.runs(), key=lambda run: run[0] is Phase.FREE):
        if not free:
            by_pass = groupby(runs, key=lambda run: int(motion.pass_index[run[1][0]]))
            for _, of_pass in by_pass:
                yield np.concatenate([moves for _, moves in of_pass])


def _near_wheel(way: Array, phases: list[Phase], process: ProcessSettings) -> Array:
    """Return the times that moves take at the least for being near the wheel, in [s], shape (n,).

    `way` is what the part moves in each in [m], shape (n,); on the wheel nothing is asked for here.
    """
    coming = np.array([phase is Phase.APPROACHING for phase in phases])
    going = np.array([phase is Phase.RETRACTING for phase in phases])
    ways_in, ways_out = np.where(coming, way, 0.0), np.where(going, way, 0.0)
    # how far from the contact the nearer end of each move is
    near = np.where(
        coming, np.cumsum(ways_in[::-1])[::-1] - ways_in, np.cumsum(ways_out) - ways_out
    )
    speed = np.where(near < process.approach_slow, process.approach_speed, np.inf)
    speed = np.where(near < AT_CONTACT, process.feed, np.maximum(speed, process.feed))
    return np.where(coming | going, way / speed, 0.0)


def _suddenness(q: Array, times: Array, robot: Robot) -> float:
    """Return the largest change of a joint's speed between two moves, as part of what it can.

    From the middle of a move to the middle of the next; `q` is in [rad], shape (n + 1, 6), `times`
    in [s], shape (n,).
    """
    speed = np.diff(q, axis=0) / times[:, None]
    between = (times[:-1] + times[1:])[:, None] / 2.0
    change = np.abs(np.diff(speed, axis=0)) / between / robot.max_acceleration
    return float(change.max(initial=0.0))


def air_seconds(motion: Motion, robot: Robot, process: ProcessSettings) -> float:
    """Return the time of all free moves in [s], ramps left out."""
    turned = np.abs(np.diff(motion.q, axis=0, prepend=motion.q[:1]))
    fastest = (turned / robot.max_speed).max(axis=1)
    return float(fastest[motion.free].sum()) / process.air_speed


def on_wheel(motion: Motion, points: CutterPoints, process: ProcessSettings) -> tuple[Array, Array]:
    """Return what moves do on the wheel: way along the surface in [m], least time in [s].

    The least time is that at the feed, or at the largest speed of the contact over the wheel; both
    are 0 where a move is not on the wheel all along, shape (n,).
    """
    arc = np.interp(motion.cutter_point, np.arange(len(points)), points.arc_length)
    distance = np.abs(np.diff(arc, prepend=np.nan))
    over = np.abs(np.diff(motion.contact_position, prepend=np.nan)) / process.contact_speed
    least = np.maximum(distance / process.feed, over)
    grinding = motion.grinding
    return np.where(grinding, distance, 0.0), np.where(grinding, least, 0.0)


def _between(motion: Motion, amounts: Array) -> Array:
    """Return what moves from written to written configuration pass, shape (written,)."""
    return np.diff(np.cumsum(amounts)[motion.positions], prepend=0.0)


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
