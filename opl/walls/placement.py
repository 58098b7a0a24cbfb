"""Which image of an inverse solution a pass uses, and on which side of barriers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array
from opl.walls.sides import ANY_SIDE, Side


@dataclass(frozen=True)
class Placement:
    """Which image of a family a pass uses.

    Attributes:
        family: The family.
        number: Which flip of the wrist.
        flip: Its sign and shift.
        shift: Full turns in [rad], shape (6,).
        loose: Joints whose full turns are counted anew at each node, shape (6,).
        center: Where those should be near to, in [rad], shape (6,).
        side: On which side of each barrier the pass stays.
    """

    family: int
    number: int
    flip: tuple[Array, Array]
    shift: Array
    loose: np.ndarray
    center: Array
    side: Side = ANY_SIDE

    @property
    def key(self) -> tuple[int, int, bytes, int]:
        """The same for those that place alike, but for loose joints."""
        return self.family, self.number, self.shift.tobytes(), self.side.number

    def slot(self, flip: int) -> int:
        """Return the slot of the inverse kinematics, with a flip of the whole motion."""
        return self.family + 4 * (self.number ^ flip)

    def of(self, q: Array) -> Array:
        """Return the placed joint positions, shape (..., 6)."""
        sign, shift = self.flip
        placed = q * sign + shift + self.shift
        if not self.loose.any():
            return np.asarray(placed)
        turns = 2.0 * np.pi * np.round((self.center - placed) / (2.0 * np.pi))
        return np.asarray(np.where(self.loose, placed + turns, placed))


def of_passes(
    pass_index: np.ndarray, placements: Sequence[Placement]
) -> Iterator[tuple[np.ndarray, Placement]]:
    """Yield which of some places are of a pass, as indices, and its placement.

    Args:
        pass_index: Pass of each place, shape (n,).
        placements: The placement of every pass.
    """
    for index in np.unique(pass_index).tolist():
        yield np.flatnonzero(pass_index == index), placements[index]
