"""What a controller may make of a corner: the moves on both sides of it, and how much is cut off.

Between two moves a controller need not come to the written position: it may leave the first move
where its tool point is nearer than the zone, and join the second likewise, on either no earlier
than half-way. In between it makes what is left of the one and what is begun of the other together:

    q = written position + what is left of the first move + what is begun of the second

The one falls, the other grows, and as fractions of what may be cut off their sum is one at the
most: corners are rounded inside the triangle of both cuts, not overshot. That controllers do so is
assumed; none was asked. The chord from cut to cut, arcs and parabolas are all of this kind, and
cutter points keep their order on each of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from opl.cell.robot import forward_kinematics
from opl.geometry.frames import Array
from opl.job.values import Job
from opl.motion.motion import Motion, Phase
from opl.program.played import ReadMove

DEPTHS = np.array([0.25, 0.5, 0.75, 1.0])  # of the triangle, at which chords are looked at
ACROSS = np.linspace(0.0, 1.0, 33)  # places on each chord
MOST_CUT = 0.5  # of a move
_TRIED = np.linspace(0.0, MOST_CUT, 33)  # places of a move whose distance from its end is asked


@dataclass(frozen=True, eq=False)
class Side:
    """A move as seen from the corner at one of its ends; straight lines between its configurations.

    Attributes:
        q: Configurations from the corner on in [rad], shape (m, 6).
        place: Fractional cutter points there, shape (m,); NaN off the wheel.
        length: What the joints turn, in [rad].
        share: Of the move at each configuration, from 0 to 1, shape (m,).
    """

    q: Array
    place: Array
    length: float
    share: Array

    @classmethod
    def of(cls, motion: Motion, rows: NDArray[np.intp]) -> Side:
        """Return the side through the configurations of a motion at some indices, in order."""
        q = motion.q[rows]
        turned = np.cumsum(np.linalg.norm(np.diff(q, axis=0, prepend=q[:1]), axis=1))
        length = float(turned[-1])
        share = turned / length if length > 0.0 else turned
        return cls(q, motion.cutter_point[rows], length, share)

    def q_at(self, share: Array) -> Array:
        """Return the configurations at shares, shape (..., 6)."""
        return np.stack([np.interp(share, self.share, joint) for joint in self.q.T], axis=-1)

    def place_at(self, share: Array) -> Array:
        """Return the fractional cutter points at shares, shape (...)."""
        return np.interp(share, self.share, self.place)

    def cut(self, zone: float, tool_points: Callable[[Array], Array]) -> float:
        """Return which share may be cut off for a zone in [m]; `tool_points` see `roundings`."""
        if np.isinf(zone):
            return MOST_CUT
        points = tool_points(self.q_at(_TRIED))
        away = np.linalg.norm(points - points[0], axis=1)
        last = int(np.flatnonzero(away <= zone)[-1])
        if last == len(_TRIED) - 1:
            return MOST_CUT
        part = (zone - away[last]) / (away[last + 1] - away[last])
        return float(_TRIED[last] + part * _TRIED[1])


@dataclass(frozen=True, eq=False)
class Rounding:
    """A corner, and what may be made of it.

    Attributes:
        k: Number of its written position.
        before: The move that leads to it.
        after: The move that leads on.
        cuts: Share of each that may be cut off.
        phases: What happens during each.
    """

    k: int
    before: Side
    after: Side
    cuts: tuple[float, float]
    phases: tuple[Phase, Phase]

    @property
    def grinds(self) -> tuple[bool, bool]:
        """Which of the two moves grind."""
        return self.phases[0] is Phase.GRINDING, self.phases[1] is Phase.GRINDING

    @property
    def free(self) -> bool:
        """Whether the part has to keep off the wheel."""
        return self.phases == (Phase.FREE, Phase.FREE)

    def configurations(self) -> Array:
        """Return the configurations on the chords, shape (DEPTHS, ACROSS, 6)."""
        left, begun = self._shares()
        return np.asarray(self.before.q_at(left) + self.after.q_at(begun) - self.before.q[0])

    def places(self, points_per_lead: float) -> Array:
        """Return the fractional cutter points there, NaN off the pass, shape (DEPTHS, ACROSS).

        A lead goes on along the pass, by `points_per_lead` cutter points in all of its move.
        """
        left, begun = self._shares()
        here = self.before.place[0]
        if all(self.grinds):
            return np.asarray(self.before.place_at(left) + self.after.place_at(begun) - here)
        if self.grinds[1]:
            place = self.after.place_at(begun) - left * points_per_lead
            return np.where(place >= here, place, np.nan)
        if self.grinds[0]:
            place = self.before.place_at(left) + begun * points_per_lead
            return np.where(place <= here, place, np.nan)
        return np.full(left.shape, np.nan)

    def triangle(self) -> tuple[Array, Array]:
        """Return the corners of the triangle, (3, 6), and how far off it joints can be, (6,)."""
        ends = [side.q_at(np.array(cut)) for side, cut in self._sides]
        off = np.zeros(6)
        for (side, cut), end in zip(self._sides, ends, strict=True):
            inside = side.share <= cut
            on_chord = side.q[0] + side.share[inside, None] / cut * (end - side.q[0])
            off += np.abs(side.q[inside] - on_chord).max(axis=0)
        return np.stack([ends[0], self.before.q[0], ends[1]]), off

    def reach(self, tool_points: Callable[[Array], Array]) -> float:
        """Return how far from the corner the nearer of the cuts is, in [m] of the tool point."""
        q = np.stack([self.before.q[0], *(side.q_at(np.array(cut)) for side, cut in self._sides)])
        here, *cuts = tool_points(q)
        return float(min(np.linalg.norm(cut - here) for cut in cuts))

    @property
    def _sides(self) -> tuple[tuple[Side, float], tuple[Side, float]]:
        return (self.before, self.cuts[0]), (self.after, self.cuts[1])

    def _shares(self) -> tuple[Array, Array]:
        """Return what is left of one move and begun of the other, shape (DEPTHS, ACROSS)."""
        left = DEPTHS[:, None] * (1.0 - ACROSS) * self.cuts[0]
        return left, DEPTHS[:, None] * ACROSS * self.cuts[1]


def zones_of(moves: Sequence[ReadMove], q: Array, tool_points: Callable[[Array], Array]) -> Array:
    """Return how far from each written position in [m] its moves may be left, see `roundings`.

    An arc touches two straight moves its radius times the tangent of half their turn from the
    corner. Whether controllers count radii so is not settled: the radius itself is taken where that
    is more. Next to other moves nobody knows.

    Args:
        moves: The moves to the positions.
        q: The positions in [rad], shape (written, 6).
        tool_points: See `roundings`.
    """
    zones = np.array([move.corner.zone for move in moves])
    for k, move in enumerate(moves[:-1]):
        if not move.corner.arc or k == 0:
            continue
        ways = np.diff(tool_points(q[k - 1 : k + 2]), axis=0)
        lengths = np.linalg.norm(ways, axis=1)
        if not moves[k + 1].straight or lengths.min() == 0.0:
            zones[k] = np.inf
            continue
        (x, y), (back, on) = lengths, ways
        turn = 2.0 * np.arctan2(
            np.linalg.norm(on / y - back / x), np.linalg.norm(on / y + back / x)
        )
        zones[k] *= max(1.0, float(np.tan(turn / 2.0)))
    return zones


def tool_points_of(job: Job) -> Callable[[Array], Array]:
    """Return what gives the tool point, of which zones count, see `roundings`."""
    return partial(_tool_points, job)


def _tool_points(job: Job, q: Array) -> Array:
    Ts_base_flange = forward_kinematics(job.cell.robot, q)
    return np.asarray(job.program.led.frames(Ts_base_flange)[..., :3, 3])


def roundings(
    motion: Motion, zones: Array, tool_points: Callable[[Array], Array]
) -> Iterator[Rounding]:
    """Yield the corners of a motion that may be rounded.

    Args:
        motion: The motion.
        zones: Of each written position in [m], 0 where the robot stops, infinite where nobody knows
            them, shape (written,).
        tool_points: Gives the tool point, of which zones count, at configurations (n, 6) in [m],
            shape (n, 3).
    """
    positions, phase = motion.positions, motion.phase
    for k in (np.flatnonzero(zones[1:-1] > 0.0) + 1).tolist():
        first, here, last = (int(at) for at in positions[k - 1 : k + 2])
        before = Side.of(motion, np.arange(here, first - 1, -1))
        after = Side.of(motion, np.arange(here, last + 1))
        if min(before.length, after.length) > 0.0:
            cuts = before.cut(zones[k], tool_points), after.cut(zones[k], tool_points)
            yield Rounding(k, before, after, cuts, (phase[here], phase[last]))
