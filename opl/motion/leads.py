"""How a part comes to the wheel and leaves it: straight along the contact normal, or on an arc.

The arc lies in the plane of contact normal and belt direction and touches the belt's surface at the
contact: the part comes from -y of the contact frame and leaves to +y, and is only moved, not
turned. The wheel curves away on either side, so the ground point is farther from it with every
step.
"""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array
from opl.motion.motion import MoveKind

LEAD_SPACING = 0.005  # [m] between configurations of a lead: joint lines stay near it
LEAD_TURN = np.deg2rad(5.0)  # between configurations of an arc: chords stay within 0.06 mm of it


def lead_count(length: float, turn: float) -> int:
    """Return into how many moves an approach or retract is cut.

    `length` is in [m]; `turn` is the angle in [rad] by which its direction turns, 0 if it is
    straight.
    """
    # a whole number of steps is not to become one more by rounding
    turns = int(np.ceil(turn / LEAD_TURN - 1e-9))
    return max(int(np.ceil(length / LEAD_SPACING)), turns, 1)


def lead_offsets(length: float, turn: float, kind: MoveKind) -> Array:
    """Return where the part is moved to in the contact frame, from the wheel on, shape (k, 3).

    Args:
        length: Of the approach or retract in [m].
        turn: What its direction turns by in [rad], a quarter of a circle at most. 0 is straight
            along the normal; else it is along the belt at the contact, this much off it at the far
            end.
        kind: Whether it is the approach or the retract.
    """
    count = lead_count(length, turn)
    offsets = np.zeros((count, 3))
    # z of the contact frame points into the wheel
    if turn == 0.0:
        offsets[:, 2] = -length * np.arange(1, count + 1) / count
        return offsets
    radius, angle = length / turn, turn * np.arange(1, count + 1) / count
    side = -1.0 if kind is MoveKind.APPROACH else 1.0
    offsets[:, 1] = side * radius * np.sin(angle)
    offsets[:, 2] = -radius * 2.0 * np.square(np.sin(angle / 2.0))  # 1 - cos, small angles too
    return offsets
