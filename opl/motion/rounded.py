"""A line through configurations with its corners rounded, as a controller goes through it.

Straight from configuration to configuration, joint speeds would jump. A controller overlaps
the end of a move with the beginning of the next; so does this line: around each configuration the
speeds change evenly, for half of the shorter of its two moves on either side. It leaves the
straight line by no more than an eighth of what the two moves differ, and never overshoots it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from opl.geometry.frames import Array, read_only

# How far a corner is cut at most, in [rad] of any joint: some tenths of a millimetre at the end of
# an arm, as the finest rounding of a controller.
CORNER_CUT = np.deg2rad(0.03)
SAME_PLACE = 1e-7  # [s]: knots nearer to each other are one


@dataclass(frozen=True, eq=False)
class RoundedLine:
    """Joint positions along a place, which is the wanted time since the start in [s].

    Between knots the speeds change linearly, so positions are parabolas.

    Attributes:
        nodes: Place of each configuration, shape (n,).
        knots: Where the speeds begin or end to change, ascending, shape (m,).
        q: Joint positions at the knots in [rad], shape (m, 6).
        slope: Their change with the place at the knots in [rad/s], shape (m, 6).
    """

    nodes: Array
    knots: Array
    q: Array
    slope: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))

    def slopes(self, place: Array) -> Array:
        """Return the change of the joint positions with the place in [rad/s], shape (k, 6)."""
        return np.stack([np.interp(place, self.knots, joint) for joint in self.slope.T], axis=-1)

    def configurations(self, place: Array) -> Array:
        """Return the joint positions at places in [rad], shape (k, 6)."""
        last = np.clip(np.searchsorted(self.knots, place, side="right") - 1, 0, len(self.knots) - 1)
        ahead = (np.asarray(place) - self.knots[last])[:, None]
        return self.q[last] + (self.slope[last] + self.slopes(place)) / 2.0 * ahead

    def extended(self, before: float, after: float) -> RoundedLine:
        """Return the line with its ends drawn on straight, each for a wanted time in [s] > 0."""
        first = self.q[0] - before * self.slope[0]
        last = self.q[-1] + after * self.slope[-1]
        return RoundedLine(
            self.nodes,
            np.concatenate([[self.knots[0] - before], self.knots, [self.knots[-1] + after]]),
            np.vstack([first, self.q, last]),
            np.vstack([self.slope[0], self.slope, self.slope[-1]]),
        )


def rounded_line(q: Array, times: Array) -> RoundedLine:
    """Round the corners between configurations.

    `q` is in [rad], shape (n, 6), n >= 2; `times`, the wanted times of the moves in [s], are
    positive, shape (n - 1,).
    """
    nodes = np.concatenate([[0.0], np.cumsum(times)])
    speed = np.diff(q, axis=0) / times[:, None]
    change = np.abs(np.diff(speed, axis=0)).max(axis=1)
    half = np.minimum(times[:-1], times[1:]) / 2.0
    half = np.minimum(half, 4.0 * CORNER_CUT / np.maximum(change, 1e-9))
    inner = nodes[1:-1]
    knots = np.stack([inner - half, inner, inner + half], axis=1).ravel()
    slope = np.stack([speed[:-1], (speed[:-1] + speed[1:]) / 2.0, speed[1:]], axis=1)
    knots = np.concatenate([nodes[:1], knots, nodes[-1:]])
    slope = np.concatenate([speed[:1], slope.reshape(-1, q.shape[1]), speed[-1:]])
    # where two corners meet in the middle of a move, their knots are one
    kept = np.concatenate([np.diff(knots) > SAME_PLACE, [True]])
    knots, slope = knots[kept], slope[kept]
    steps = (slope[:-1] + slope[1:]) / 2.0 * np.diff(knots)[:, None]
    line = np.concatenate([q[:1], q[0] + np.cumsum(steps, axis=0)])
    return RoundedLine(nodes, knots, line, slope)
