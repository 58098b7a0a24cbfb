"""How a part comes to the wheel and leaves it: in feed along the pass, on a quarter of a circle.

The belt never sees a stop. Where a pass ends the part goes on along the pass, in the tangent plane
of the surface, and lifts off meanwhile: how far it has moved on and how far it has lifted make a
quarter of a circle, whose radius is the run of the lead. From there it leads on off the wheel
without moving on. Off the wheel means along the contact normal, or on an arc in the plane of normal
and belt direction that touches the belt at the contact. The part comes the same way, in the other
order. It is only moved, not turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.motion.gradual import SPEED_RATIO
from opl.motion.motion import MoveKind

LEAD_TIME = 0.05  # [s] that a move of a lead takes, were it not for the limits below
LEAD_SPACING = 0.01  # [m] between configurations of a lead at the most: joint lines stay near it
RUN_TURN = np.deg2rad(30.0)  # between configurations of a run: chords stay within 4 % of its radius
LEAD_TURN = np.deg2rad(5.0)  # between those of an arc: chords stay within 0.06 mm of it


@dataclass(frozen=True)
class LeadShape:
    """The shape of approaches and retracts, and how finely they are cut.

    Attributes:
        length: How far they lead off the wheel at the most, in [m].
        turn: What their way off the wheel turns by in [rad], a quarter of a circle at most; 0 is
            straight along the normal.
        run: How far the part moves on along the pass in [m].
        slow: How far from the contact they are slow, in [m] along the way.
        feed: Speed of the move onto the wheel or off it in [m/s].
        speed: Largest speed where they are slow in [m/s].
    """

    length: float
    turn: float
    run: float
    slow: float
    feed: float
    speed: float

    @property
    def radius(self) -> float:
        """Radius of the quarter of a circle in [m]."""
        return min(self.run, self.length)

    @property
    def farthest(self) -> float:
        """Distance of the far end from the contact in [m]: no lead gets farther off the wheel."""
        return float(np.linalg.norm(self.offsets(MoveKind.RETRACT, 1.0)[-1]))

    def places(self) -> Array:
        """Return how far along the way the configurations are, off the wheel first, in [m]."""
        quarter = self.radius * np.pi / 2.0
        whole = quarter + self.length - self.radius
        finest = LEAD_TURN / self.turn * self.length if self.turn > 0.0 else np.inf
        places, speed = [0.0], self.feed
        while places[-1] < whole:
            step = min(speed * LEAD_TIME, LEAD_SPACING, finest)
            if places[-1] < quarter:
                step = min(step, self.radius * RUN_TURN)
            places.append(places[-1] + step)
            slow = places[-1] < self.slow
            speed = min(SPEED_RATIO * speed, max(self.feed, self.speed) if slow else np.inf)
        # what is left at the end is no move of its own if it is short
        if len(places) > 2 and whole - places[-2] < (places[-2] - places[-3]) / 2.0:
            places.pop()
        places[-1] = whole
        return np.array(places[1:])

    def offsets(self, kind: MoveKind, direction: float) -> Array:
        """Return where the part is moved to in the contact frame, from the wheel on, shape (k, 3).

        Args:
            kind: Whether it is the approach or the retract.
            direction: 1 if the pass runs along x of the cutter frame, -1 if backwards.
        """
        places, radius = self.places(), self.radius
        angle = np.minimum(places / radius, np.pi / 2.0)
        off = radius * 2.0 * np.square(np.sin(angle / 2.0))  # 1 - cos, small angles too
        off += np.maximum(places - radius * np.pi / 2.0, 0.0)
        side = -1.0 if kind is MoveKind.APPROACH else 1.0
        offsets = np.zeros((len(places), 3))
        # a point farther along the pass comes to the wheel when the part moves back by as much
        offsets[:, 0] = -side * direction * radius * np.sin(angle)
        offsets[:, 1:] = self._off_wheel(off, side)
        return offsets

    def _off_wheel(self, off: Array, side: float) -> Array:
        """Return y and z of the contact frame after a way off the wheel in [m], shape (k, 2)."""
        # z of the contact frame points into the wheel
        if self.turn == 0.0:
            return np.stack([np.zeros_like(off), -off], axis=1)
        radius = self.length / self.turn
        angle = off / radius
        return np.stack(
            [side * radius * np.sin(angle), -radius * 2.0 * np.square(np.sin(angle / 2.0))], axis=1
        )
