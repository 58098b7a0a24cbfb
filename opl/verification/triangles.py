"""Whether bodies stay apart at every configuration of a triangle in joint space.

From the middle of a triangle to anywhere in it the joints turn no farther than to its corners, so
no pair is nearer anywhere than in the middle by more than those turns times their levers. Where
that does not show a pair to be far enough apart, the triangle is halved for this pair. In the same
way what was measured before bounds a distance: a pair that it shows to be far enough apart is not
measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.verification.world import World

# [m] that a pair can be nearer than measured where halving ends: what Bullet's distances are off
FINEST = 1e-4
AHEAD = 0.1  # [m] measured beyond what is needed: for that long a pair can be left alone after
MOST_POSES = 5000  # of one triangle: what is not shown by then is taken for too near


@dataclass(frozen=True)
class TooNear:
    """Two bodies that are too near.

    Attributes:
        names: Of the two.
        distance: How far they are apart in [m]; less than that where halving ended.
        needed: How far they must be.
    """

    names: str
    distance: float
    needed: float


class Triangles:
    """The pairs of a cell, to be held against triangles of configurations."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._pairs = [*world.pairs(), world.part_and_wheel()]
        self._needed = np.array([pair.clearance for pair in self._pairs])
        self._levers = world.levers(self._pairs)
        self.forget()

    def forget(self) -> None:
        """Forget how far apart pairs were: what is found does not depend on it, but for round-off.

        After that it is the same whatever was asked before.
        """
        self._apart = np.full(len(self._pairs), -np.inf)  # when last measured, at least, in [m]
        self._at = np.zeros(self._levers.shape)  # where that was, in [rad]

    def too_near(self, corners: Array, around: Array, free: bool) -> TooNear | None:
        """Return a pair that is too near somewhere in a triangle; None if there is none.

        Args:
            corners: Of the triangle, in [rad], shape (3, 6).
            around: What each joint may be off the triangle in [rad], shape (6,).
            free: Whether the part has to keep off the wheel as well.
        """
        everything = np.arange(len(self._pairs) if free else len(self._pairs) - 1)
        left = [(corners, everything)]
        poses = 0
        while left:
            poses += 1
            triangle, pairs = left.pop()
            middle = triangle.mean(axis=0)
            reach = self._levers[pairs] @ np.abs(triangle - middle).max(axis=0)
            needed = self._needed[pairs] + self._levers[pairs] @ around
            turned = np.abs(middle - self._at[pairs])
            least = self._apart[pairs] - (self._levers[pairs] * turned).sum(axis=1)
            asked = np.flatnonzero(least <= needed + reach)
            if not len(asked):
                continue
            pairs, needed, reach = pairs[asked], needed[asked], reach[asked]
            self._world.move_to(middle)
            still = []
            for k, apart, nearer in zip(
                pairs.tolist(), needed.tolist(), reach.tolist(), strict=True
            ):
                within = apart + nearer + AHEAD
                distance = self._distance(k, within)
                self._apart[k], self._at[k] = min(distance, within), middle
                if distance < apart or distance <= 0.0:
                    return TooNear(self._names(k), distance, float(self._needed[k]))
                if poses > MOST_POSES and distance < apart + nearer:
                    return TooNear(self._names(k), distance - nearer, float(self._needed[k]))
                if distance < apart + nearer and nearer > FINEST:
                    still.append(k)
            if still:
                left += [(half, np.array(still)) for half in self._halves(triangle)]
        return None

    def _distance(self, k: int, within: float) -> float:
        """Return the distance of a pair in [m] if it is within some."""
        pair = self._pairs[k]
        if k == len(self._pairs) - 1:
            return self._world.gap(within)
        distance = self._world.distance(pair.first, pair.second, within + pair.rounding)
        return distance - pair.rounding

    def _names(self, k: int) -> str:
        pair = self._pairs[k]
        return f"{pair.first.name} and {pair.second.name}"

    def _halves(self, triangle: Array) -> tuple[Array, Array]:
        """Halve a triangle across its longest side."""
        a, b, c = triangle
        sides = np.abs([b - a, c - b, a - c]) @ self._levers[-1]
        first, second, third = np.roll(triangle, -int(sides.argmax()), axis=0)
        middle = (first + second) / 2.0
        return np.stack([first, middle, third]), np.stack([middle, second, third])
