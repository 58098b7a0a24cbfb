"""Which image of an inverse solution a pass uses, and on which side of barriers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from opl.cell.full_turns import FULL_TURN
from opl.files.kernels import kernel
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


def placed(
    angles: Array, starts: Array, pass_index: np.ndarray, placements: Sequence[Placement]
) -> Array:
    """Return postures of places as the placements of their passes place them, shape (n, m, 6).

    Args:
        angles: Principal angles of the families of these in [rad], shape (n, m, 6).
        starts: Where the angles of each family are cut open in [rad], shape (8, 6).
        pass_index: Pass of each place, shape (n,).
        placements: The placement of every pass.
    """
    q = np.require(angles, requirements=["C", "W", "E"])
    start = starts[[one.family for one in placements]]
    sign, shift = (np.array([one.flip[k] for one in placements]) for k in (0, 1))
    turns = np.array([one.shift for one in placements])
    center = np.array([np.where(one.loose, one.center, np.nan) for one in placements])
    _place(q, np.require(pass_index, None, ["C", "W"]), start, sign, shift, turns, center)
    return q


@kernel(
    "void(float64[:,:,::1],int64[::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],"
    "float64[:,::1])",
    early=True,
)
def _place(q, pass_index, start, sign, shift, turns, center):  # type: ignore[no-untyped-def]
    """Place angles, shape (n, m, 6), as `Placement.of` does once they are unrolled.

    All but the pass of each place is by pass and joint; the center is NaN of joints not loose.
    """
    for column in range(len(q)):
        own = pass_index[column]
        for row in range(q.shape[1]):
            for joint in range(q.shape[2]):
                beyond = q[column, row, joint] - start[own, joint]
                if -FULL_TURN <= beyond < 0.0:  # what a remainder is, found sooner
                    beyond += FULL_TURN
                elif not beyond < FULL_TURN or beyond < 0.0:
                    beyond = np.remainder(beyond, FULL_TURN)
                at = (start[own, joint] + beyond) * sign[own, joint] + shift[own, joint]
                at += turns[own, joint]
                if not np.isnan(center[own, joint]):
                    at += FULL_TURN * np.rint((center[own, joint] - at) / FULL_TURN)
                q[column, row, joint] = at


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


def families_of(pass_index: np.ndarray, placements: Sequence[Placement]) -> np.ndarray:
    """Return the family of each of some places, shape (n,); arguments as of `of_passes`."""
    return np.asarray(np.array([placement.family for placement in placements])[pass_index])


def allowed(
    places: Array, pass_index: np.ndarray, placements: Sequence[Placement], t: Array
) -> np.ndarray:
    """Return which contact positions of places their passes may use, shape (n, m)."""
    may = np.empty(t.shape, dtype=bool)
    for own, placement in of_passes(pass_index, placements):
        may[own] = placement.side.holds(places[own], t[own])
    return may
