"""The fastest law of time along a line of configurations that wanted times and joints allow.

The law is TOPP-RA's (Pham and Pham, 2018, by toppra): the path speed is as high as its own limit
(the wanted times) and the speed and acceleration of each joint permit. Between two places of its
grid the line's slopes and the law's squared path speed are linear, so joint accelerations are
largest at the ends of such a piece, and limits that are kept there are kept everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.errors import TimeLawError, UnsafeError
from opl.geometry.frames import Array
from opl.motion.rounded import SAME_PLACE, RoundedLine

# What a sampled joint speed or acceleration may be beyond its limit, as a fraction: round-off.
TOLERANCE = 1e-3
SAMPLE = 1e-3  # [s] between the samples at which a law is looked at again
# Where on a straight piece the path speed may begin to change otherwise, from either end on.
_GRADED = np.array([1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4])
GRADES = np.concatenate([_GRADED, [1 / 2], 1.0 - _GRADED[::-1]])
AROUND = 24  # places first taken on either side of what is too fast to be gone over evenly
SHORT = 1e-3  # [s]: a straight piece not longer than this is halved only


@dataclass(frozen=True, eq=False)
class JointLimits:
    """Largest speeds in [rad/s] and accelerations in [rad/s^2] of the joints, shape (6,) each."""

    speed: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class TimeLaw:
    """When the robot is where on a line.

    Attributes:
        line: The line.
        place: Places on it in [s], ascending, shape (g,).
        path_speed: Change of the place with time there, 1 where the wanted times are kept, shape
            (g,).
        speed_load: Largest part of its speed limit that each joint uses up on the piece that ends
            at each place but the first, shape (g - 1, 6).
        acceleration_load: The same of its acceleration limit.
    """

    line: RoundedLine
    place: Array
    path_speed: Array
    speed_load: Array
    acceleration_load: Array

    @property
    def time(self) -> Array:
        """When it gets to each place in [s], from 0, shape (g,)."""
        steps = 2.0 * np.diff(self.place) / (self.path_speed[:-1] + self.path_speed[1:])
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def node_index(self) -> np.ndarray:
        """Which place is that of each configuration of the line, shape (n,)."""
        return np.searchsorted(self.place, self.line.nodes - 1e-12)

    @property
    def node_times(self) -> Array:
        """When it gets to each configuration of the line in [s], shape (n,)."""
        times: Array = self.time[self.node_index]
        return times

    def configurations(self, time: Array) -> Array:
        """Return the joint positions at times in [rad], shape (k, 6)."""
        at = self.time
        piece = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
        spent = time - at[piece]
        change = np.diff(self.path_speed) / np.diff(at)
        return self.line.configurations(
            self.place[piece] + (self.path_speed[piece] + change[piece] * spent / 2.0) * spent
        )


def fastest_law(line: RoundedLine, limits: JointLimits, at_rest: bool) -> TimeLaw:
    """Return the fastest law along a line.

    If the robot is not `at_rest` at both ends, it comes and goes on straight on, as fast as the
    line lets it.

    Raises:
        UnsafeError: If no law is found, or what is found does not keep the limits.
    """
    # wanted times in which full path speed is reached from rest, straight on, in [s]
    run_up = 0.51 * np.max(np.abs(line.slope[[0, -1]]) / limits.acceleration, axis=1) + 1e-3
    whole = line if at_rest else line.extended(*run_up.tolist())
    place = _grid(whole, limits)
    slope = whole.slopes(place)
    bend = np.diff(slope, axis=0) / np.diff(place)[:, None]
    path_speed = _path_speed(place, slope, bend, limits, at_rest)
    first, last = np.searchsorted(place, line.knots[[0, -1]] - 1e-12).tolist()
    inside = slice(first, last + 1)
    speed, acceleration = (
        load[first:last] for load in _loads(slope, bend, place, path_speed, limits)
    )
    law = TimeLaw(line, place[inside], path_speed[inside], speed, acceleration)
    require_limits(law, limits)
    return law


def _grid(line: RoundedLine, limits: JointLimits) -> Array:
    """Return the places at which a law may change, shape (g,)."""
    knots = line.knots
    length = np.diff(knots)
    straight = np.abs(np.diff(line.slope, axis=0)).max(axis=1) < 1e-12
    graded = straight & (length > SHORT)
    places = [knots, knots[:-1][~graded] + length[~graded] / 2.0]
    places.append((knots[:-1, None] + length[:, None] * GRADES)[graded].ravel())
    # from rest to full path speed on a straight piece, and back
    for end, inwards in ((0, 1.0), (-1, -1.0)):
        ramp = 0.5 * np.max(np.abs(line.slope[end]) / limits.acceleration)
        if straight[end] and 0.0 < ramp < length[end]:
            places.append(knots[[end]] + inwards * ramp)
    found = np.unique(np.concatenate(places))
    close = np.diff(found) < SAME_PLACE / 2.0
    # of two places that are as good as one, the knot stays
    gone = np.flatnonzero(close)
    gone = np.where(np.isin(found[gone], knots), gone + 1, gone)
    return np.delete(found, gone)


def _loads(
    slope: Array, bend: Array, place: Array, path_speed: Array, limits: JointLimits
) -> tuple[Array, Array]:
    """Return what a law uses up of speed and acceleration on each piece, shape (g - 1, 6) each."""
    speed = np.abs(slope) * path_speed[:, None] / limits.speed
    squared = path_speed[:, None] ** 2
    gain = np.diff(squared, axis=0) / (2.0 * np.diff(place)[:, None])
    at_start = slope[:-1] * gain + bend * squared[:-1]
    at_end = slope[1:] * gain + bend * squared[1:]
    acceleration = np.maximum(np.abs(at_start), np.abs(at_end)) / limits.acceleration
    return np.maximum(speed[:-1], speed[1:]), acceleration


def _path_speed(
    place: Array, slope: Array, bend: Array, limits: JointLimits, at_rest: bool
) -> Array:
    """Return the highest path speed at each place, shape (g,).

    Full path speed is kept but around the pieces that do not allow it. They are solved one by one,
    with as much before and after as it takes to come down to their path speed and up again.
    """
    steady = np.ones(len(place))
    hot = np.maximum(*_loads(slope, bend, place, steady, limits)).max(axis=1) > 1.0
    hot[[0, -1]] |= at_rest
    counted = np.append(0, np.cumsum(hot))
    index = np.arange(len(hot))
    last, around = len(place) - 1, AROUND
    while True:
        before, after = np.maximum(index - around, 0), np.minimum(index + around + 1, len(hot))
        near = (counted[after] > counted[before]).astype(int)
        edges = np.flatnonzero(np.diff(near, prepend=0, append=0))
        path_speed: Array = steady.copy()
        for start, end in edges.reshape(-1, 2):
            part = slice(start, end + 1)
            found = _fastest_path_speed(
                place[part], slope[part], bend[start:end], limits, start > 0, end < last
            )
            if found is None:
                break
            path_speed[part] = found
        else:
            return path_speed
        if around >= last:
            raise TimeLawError("no time law keeps the joints' speeds and accelerations")
        around = min(4 * around, last)


def _fastest_path_speed(
    place: Array, slope: Array, bend: Array, limits: JointLimits, enters: bool, leaves: bool
) -> Array | None:
    """Return the highest path speed over some pieces, None if toppra finds none.

    Where it does not enter or leave at full path speed, it is at rest. `place` and `slope` have
    shapes (g,) and (g, 6), `bend`, of the pieces, (g - 1, 6).
    """
    from opl.motion.engine import path_speeds  # with all that toppra loads

    found = path_speeds(place, slope, bend, limits.speed, limits.acceleration, enters, leaves)
    if found is None or (np.maximum(found[:-1], found[1:]) <= 0.0).any():
        return None
    return np.asarray(found)


def require_limits(law: TimeLaw, limits: JointLimits) -> None:
    """Refuse a law whose configurations, sampled, show more than the limits.

    Nothing but positions is looked at: differences of samples never exceed what lies between.
    """
    duration = float(law.time[-1])
    step = min(SAMPLE, duration / 100.0)
    # joint by joint: along rows of six numpy is five times as slow
    q = np.ascontiguousarray(law.configurations(np.arange(0.0, duration, step)).T)
    # what is left of round-off in positions of some radians
    slack = 1e-14 / step ** np.arange(1, 3)
    for order, what in ((1, "speed"), (2, "acceleration")):
        found = np.abs(np.diff(q, order)).max(axis=1) / step**order
        over = (found - slack[order - 1]) / getattr(limits, what)
        if over.max() > 1.0 + TOLERANCE:
            raise UnsafeError(
                f"the time law uses {100.0 * over.max():.2f} % of the {what} of joint "
                f"{int(over.argmax()) + 1}"
            )
