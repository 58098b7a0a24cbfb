"""A whole motion of the robot: every posture from home over all passes back to home."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import Enum

import numpy as np
from numpy.typing import NDArray


class Stretch(str, Enum):
    """What the robot is doing on the way to a posture."""

    HOME = "home"  # free move from or to the home posture
    LINK = "link"  # free move between two passes
    APPROACH = "approach"  # along the contact normal or an arc, towards the wheel
    GRIND = "grind"  # on the wheel, at a cutter point
    BETWEEN = "between"  # on the wheel, at an intermediate node between two cutter points
    RETRACT = "retract"  # along the contact normal or an arc, away from the wheel


FREE_MOVES = (Stretch.HOME, Stretch.LINK)


@dataclass(frozen=True)
class Motion:
    """Postures in the order they are visited, joined by linear joint interpolation.

    Attributes:
        q: Joint positions in [rad], shape (n, 6).
        duration: Time of the move that ends at each posture in [s], shape (n,); 0 for the first.
        stretch: What each move is part of, n items.
        contact_position: t, shape (n,); NaN off the wheel.
        cutter_point: Index of the cutter point, fractional between two, shape (n,); NaN off the
            wheel.
        pass_index: The pass a posture grinds, or leads to or from, shape (n,); -1 at home.
        clearance: Smallest distance the planner found to anything, wheel contact aside, in [m],
            shape (n,); NaN where not computed.
    """

    q: NDArray[np.float64]
    duration: NDArray[np.float64]
    stretch: tuple[Stretch, ...]
    contact_position: NDArray[np.float64]
    cutter_point: NDArray[np.float64]
    pass_index: NDArray[np.int64]
    clearance: NDArray[np.float64]

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if len(value) != len(self.q):
                raise ValueError(f"{field.name} has {len(value)} items for {len(self.q)} postures")
            if isinstance(value, np.ndarray):
                copy = value.copy()
                copy.setflags(write=False)
                object.__setattr__(self, field.name, copy)

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True)
class VerifiedMotion:
    """A motion that passed every check of a replay.

    Only `opl.verification` makes one (a test reads the code for it), and a program is rendered from
    nothing else: an unverified motion cannot reach a file.
    """

    motion: Motion
