"""Walls: curves in joint space of which every motion must pass some point.

A cutter point at every contact position is a wall: the motion grinds the point somewhere. So is any
chain of places and contact positions from the least contact position to the greatest, for motions
that go on along the pass and never back. A wall is
known as cells: over each, the curve lies within pads of its chord, joint by joint. Cells where
nothing may be ground are left out, so a wall is several pieces. Each posture of the inverse
kinematics has pieces of its own, and its images: the same postures after full turns, or with the
wrist flipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from opl.geometry.frames import Array

# corners in the rectangle of fractional cutter points and contact positions, along one of the two
# from each to the next; what leads to lesser contact positions is no part of the wall
Chain = tuple[tuple[float, float], ...]
FLIPS = 2  # of the wrist that there may be
UNKNOWN = 50.0  # [rad] pad where nothing is known; beyond what any joint turns


@dataclass(frozen=True)
class Line:
    """Along what a piece of a wall runs: a place at all contact positions, or the other way about.

    Attributes:
        T_workpiece_cutter: The place, shape (4, 4); None along the path at one contact position.
        contact_position: That contact position.
    """

    T_workpiece_cutter: Array | None
    contact_position: float = 0.0


@dataclass(frozen=True)
class Piece:
    """An unbroken part of a wall in one posture.

    Attributes:
        family: Which posture.
        line: Along what it runs.
        at: Place of each corner along the wall, increasing, shape (n + 1,).
        corners: Joint positions at the ends of the cells in [rad], shape (n + 1, 6).
        pad_low: How far below the chord of each cell the curve can be, not positive, shape (n, 6).
        pad_high: How far above, not negative, shape (n, 6).
        bends: Whether the pads hold because the curve bends little over a cell: they are h^2 / 8
            times its second derivative, shape (n,); None where they hold for other reasons.
        side: Number of the side of barriers it is on, one for a pass as a whole.
    """

    family: int
    line: Line
    at: Array
    corners: Array
    pad_low: Array
    pad_high: Array
    bends: np.ndarray | None = None
    side: int = 0

    @property
    def low(self) -> Array:
        """Lower faces of a box around each cell in [rad], shape (n, 6)."""
        return np.minimum(self.corners[:-1], self.corners[1:]) + self.pad_low

    @property
    def high(self) -> Array:
        """Upper faces of it."""
        return np.maximum(self.corners[:-1], self.corners[1:]) + self.pad_high

    @cached_property
    def ends(self) -> Array:
        """Least and greatest postures in [rad], shape (2, 6)."""
        return np.stack([self.low.min(axis=0), self.high.max(axis=0)])

    def part(self, first: int, end: int) -> Piece:
        """Return the cells from ``first`` to before ``end`` alone."""
        corners = slice(first, end + 1)
        cells = slice(first, end)
        return replace(
            self,
            at=self.at[corners],
            corners=self.corners[corners],
            pad_low=self.pad_low[cells],
            pad_high=self.pad_high[cells],
            bends=None if self.bends is None else self.bends[cells],
        )


@dataclass(frozen=True)
class Image:
    """The same postures elsewhere in joint space: sign * q + shift.

    Attributes:
        sign: 1 or -1 for each joint, shape (6,).
        shift: In [rad], shape (6,).
        key: The same for images between which a pass can not change; the first number is that of
            the flip of the wrist.
    """

    sign: Array
    shift: Array
    key: tuple[int, ...]

    @property
    def flip(self) -> int:
        """Which flip of the wrist it is."""
        return self.key[0]

    def of(self, piece: Piece) -> Piece:
        """Return a piece moved there."""
        mirrored = self.sign < 0.0
        return replace(
            piece,
            corners=piece.corners * self.sign + self.shift,
            pad_low=np.where(mirrored, -piece.pad_high, piece.pad_low),
            pad_high=np.where(mirrored, -piece.pad_low, piece.pad_high),
        )


class Moves(NamedTuple):
    """Images of a family as arrays.

    Attributes:
        sign: Of each, shape (n, 6).
        shift: Of each in [rad], shape (n, 6).
        flip: Which flip of the wrist each is, shape (n,).
        first: The number of the first with each flip, shape (2,).
        of_joints: For each joint, signs and shifts that differ, and which each image has, shapes
            (m,), (m,) and (n,): few, as images are made of the turns of single joints.
    """

    sign: Array
    shift: Array
    flip: np.ndarray
    first: np.ndarray
    of_joints: tuple[tuple[Array, Array, np.ndarray], ...]

    @classmethod
    def of(cls, images: Sequence[Image]) -> Moves:
        """Return those of some images."""
        flip = [image.flip for image in images]
        first = np.array([flip.index(one) if one in flip else 0 for one in range(FLIPS)])
        sign, shift = (
            np.array([getattr(image, name) for image in images]) for name in ("sign", "shift")
        )
        of_joints = []
        for one in (sign + 1j * shift).T:
            both, which = np.unique(one, return_inverse=True)
            of_joints.append((both.real, both.imag, which))
        return cls(sign, shift, np.array(flip), first, tuple(of_joints))


@dataclass(frozen=True)
class Wall:
    """One wall.

    Attributes:
        pass_index: The pass that crosses it.
        place: Where: the cutter point, fractional between two, the middle of a chain.
        pieces: Where it can be crossed; none if it cannot.
        chain: Along what it runs, from the least contact position to the greatest.
    """

    pass_index: int
    place: float
    pieces: tuple[Piece, ...]
    chain: Chain = ()

    @property
    def is_chain(self) -> bool:
        """Whether it runs along contact positions as well, not at one place alone."""
        return len(self.chain) > 2
