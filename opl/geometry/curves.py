"""Curves on a surface that passes run along, and longer ones made by joining them.

Faces that meet tangentially, and both sides of the seam of a closed surface, give curves that end
where the next begins. They are joined; where a trim curve ends a face, a curve is cut.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from opl.geometry.frames import Array

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline, PPoly

# ends nearer than this meet [m]: ten times what CAD systems take for the same point
MEETING = 1e-5
# tangents and normals that differ by less than this continue each other [rad]
TANGENT = np.deg2rad(1.0)

# curvatures on both sides of a place are the same if they differ by less than this fraction, or by
# less than that of a radius of ten kilometres [1/m]
_SAME_FRACTION, _SAME_CURVATURE = 0.01, 1e-4


class SurfaceCurve(Protocol):
    """A curve on a surface as a function of its arc length in [m], from 0.

    Attributes:
        arc_length: Where its polynomials begin and end, shape (k,).
        positions: Points in [m], (...,) to (..., 3).
        breaks: Inner arc lengths where the curvature jumps, shape (b,).
    """

    @property
    def arc_length(self) -> Array: ...  # noqa: D102
    @property
    def positions(self) -> PPoly: ...  # noqa: D102
    @property
    def breaks(self) -> Array: ...  # noqa: D102

    @property
    def length(self) -> float:
        """Return the length in [m]."""

    def frames(self, arc_length: Array) -> Array:
        """Return Ts_workpiece_cutter at arc lengths in [m], shape (k, 4, 4)."""

    def bending(self, arc_length: Array) -> Array:
        """Return the curvature of the surface in [1/m] in the frames' axes x and y.

        Positive where the surface bends away from its outward normal; shape (k, 2, 2).
        """


def curvature_jumps(before: Array, after: Array) -> NDArray[np.bool_]:
    """Return where curvatures in [1/m] on both sides of a place are not the same, shape (...)."""
    larger = np.maximum(np.abs(before), np.abs(after))
    return np.abs(after - before) > _SAME_FRACTION * larger + _SAME_CURVATURE


def hermite_through(points: Array, tangents: Array) -> tuple[CubicHermiteSpline, Array]:
    """Return a curve through nodes as a function of its arc length, and its turns between them.

    Each piece is as long as the circular arc with its chord and its turn. Points are in [m] and
    tangents of unit length, shape (k, 3); turns in [rad], shape (k - 1,).
    """
    from scipy.interpolate import CubicHermiteSpline

    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    turns = np.arccos(np.clip(np.sum(tangents[1:] * tangents[:-1], axis=1), -1.0, 1.0))
    arcs = chords / np.sinc(turns / (2.0 * np.pi))
    return CubicHermiteSpline(np.append(0.0, np.cumsum(arcs)), points, tangents), turns


@dataclass(frozen=True, eq=False)
class Piece:
    """A curve from one arc length to another, both in [m]."""

    curve: SurfaceCurve
    start: float
    end: float


@dataclass(frozen=True, eq=False)
class ChainedCurve:
    """Pieces of curves one after the other, each beginning where the last one ends."""

    pieces: tuple[Piece, ...]

    @cached_property
    def offsets(self) -> Array:
        """Arc length at the start of each piece, and the end, in [m], shape (n + 1,)."""
        return np.append(0.0, np.cumsum([piece.end - piece.start for piece in self.pieces]))

    @cached_property
    def positions(self) -> PPoly:
        """Points in [m], (...,) to (..., 3)."""
        from scipy.interpolate import PPoly

        coefficients, nodes = [], [np.zeros(1)]
        for piece, offset in zip(self.pieces, self.offsets, strict=False):
            x, c = piece.curve.positions.x, piece.curve.positions.c
            first = int(np.clip(x.searchsorted(piece.start, "right") - 1, 0, len(x) - 2))
            end = int(np.clip(x.searchsorted(piece.end, "left"), first + 1, len(x) - 1))
            c = c[:, first:end].copy()
            c[:, 0] = _shifted(c[:, 0], piece.start - x[first])
            coefficients.append(np.concatenate([np.zeros((4 - len(c), *c.shape[1:])), c]))
            nodes.append(offset + np.append(x[first + 1 : end], piece.end) - piece.start)
        return PPoly(np.concatenate(coefficients, axis=1), np.concatenate(nodes))

    @property
    def arc_length(self) -> Array:
        """Where its polynomials begin and end in [m], shape (k,)."""
        return np.asarray(self.positions.x)

    @property
    def length(self) -> float:
        """Return the length in [m]."""
        return float(self.offsets[-1])

    @cached_property
    def breaks(self) -> Array:
        """Inner arc lengths in [m] where the curvature jumps, shape (b,)."""
        found = []
        for piece, offset in zip(self.pieces, self.offsets, strict=False):
            breaks = piece.curve.breaks
            inside = breaks[(breaks > piece.start) & (breaks < piece.end)]
            found.append(offset + inside - piece.start)
        joints = self.offsets[1:-1]
        before = [_along(piece.curve, piece.end) for piece in self.pieces[:-1]]
        after = [_along(piece.curve, piece.start) for piece in self.pieces[1:]]
        found.append(joints[curvature_jumps(np.array(before), np.array(after))])
        return np.sort(np.concatenate(found))

    def frames(self, arc_length: Array) -> Array:
        """Return Ts_workpiece_cutter at arc lengths in [m], shape (k, 4, 4)."""
        return self._by_piece(arc_length, lambda curve, own: curve.frames(own), (4, 4))

    def bending(self, arc_length: Array) -> Array:
        """Return the curvature of the surface in [1/m] in axes x and y, shape (k, 2, 2)."""
        return self._by_piece(arc_length, lambda curve, own: curve.bending(own), (2, 2))

    def _by_piece(
        self,
        arc_length: Array,
        of: Callable[[SurfaceCurve, Array], Array],
        shape: tuple[int, int],
    ) -> Array:
        values = np.empty((len(arc_length), *shape))
        which = np.clip(self.offsets.searchsorted(arc_length, "right") - 1, 0, len(self.pieces) - 1)
        for index in np.unique(which):
            piece, here = self.pieces[index], which == index
            own = arc_length[here] - self.offsets[index] + piece.start
            values[here] = of(piece.curve, np.clip(own, piece.start, piece.end))
        return values


def _along(curve: SurfaceCurve, arc_length: float) -> float:
    """Return the normal curvature in [1/m] along a curve."""
    return float(curve.bending(np.array([arc_length]))[0, 0, 0])


def _shifted(c: Array, by: float) -> Array:
    """Return the coefficients of a polynomial, highest power first, begun further along."""
    shifted: Array = c.copy()
    for last in range(len(c) - 1, 0, -1):  # Horner's scheme, again and again
        for k in range(1, last + 1):
            shifted[k] += by * shifted[k - 1]
    return shifted


def clipped(curve: SurfaceCurve, start: float, end: float) -> SurfaceCurve:
    """Return a curve from one arc length to another, both in [m]."""
    if start <= 0.0 and end >= curve.length:
        return curve
    if isinstance(curve, ChainedCurve):
        pieces = []
        for piece, offset in zip(curve.pieces, curve.offsets, strict=False):
            own = Piece(
                piece.curve,
                max(piece.start, piece.start + start - float(offset)),
                min(piece.end, piece.start + end - float(offset)),
            )
            if own.end > own.start:
                pieces.append(own)
        return ChainedCurve(tuple(pieces))
    return ChainedCurve((Piece(curve, max(start, 0.0), min(end, curve.length)),))


def is_closed(curve: SurfaceCurve) -> bool:
    """Return whether a curve ends where it began, in the same direction and on the same side."""
    ends = curve.frames(np.array([0.0, curve.length]))
    return curve.length > 2.0 * MEETING and bool(_continues(ends[1:], ends[:1])[0])


def joined(curves: Sequence[SurfaceCurve]) -> list[SurfaceCurve]:
    """Join directed curves that continue each other; a closed chain begins with its first one."""
    if len(curves) < 2:
        return list(curves)
    ends = np.stack([curve.frames(np.array([0.0, curve.length])) for curve in curves])
    follower = _followers(ends)
    led = set(follower.values())
    starts = [i for i in range(len(curves)) if i not in led]
    done: set[int] = set()
    chains = []
    # what has no open start is a ring
    for start in [*starts, *range(len(curves))]:
        if start in done:
            continue
        chain, i = [], start
        while i not in done:
            done.add(i)
            chain.append(i)
            i = follower.get(i, i)
        chains.append(chain)
    return [
        curves[chain[0]]
        if len(chain) == 1
        else ChainedCurve(tuple(piece for i in chain for piece in _pieces(curves[i])))
        for chain in chains
    ]


def _pieces(curve: SurfaceCurve) -> tuple[Piece, ...]:
    if isinstance(curve, ChainedCurve):
        return curve.pieces
    return (Piece(curve, 0.0, curve.length),)


def _followers(ends: Array) -> dict[int, int]:
    """Return which curve continues which, at most one each; ends of shape (n, 2, 4, 4)."""
    from scipy.spatial import cKDTree

    starts = cKDTree(ends[:, 0, :3, 3])
    near = starts.query_ball_point(ends[:, 1, :3, 3], MEETING)
    pairs = []
    for i, candidates in enumerate(near):
        for j in sorted(candidates):
            if j != i and _continues(ends[i : i + 1, 1], ends[j : j + 1, 0])[0]:
                gap = float(np.linalg.norm(ends[i, 1, :3, 3] - ends[j, 0, :3, 3]))
                pairs.append((gap, i, j))
    follower: dict[int, int] = {}
    taken: set[int] = set()
    for _, i, j in sorted(pairs):
        if i not in follower and j not in taken:
            follower[i] = j
            taken.add(j)
    return follower


def _continues(Ts_end: Array, Ts_start: Array) -> Array:
    """Return where poses meet with the same axis z and axis x, shape (n,)."""
    near = np.linalg.norm(Ts_end[:, :3, 3] - Ts_start[:, :3, 3], axis=1) <= MEETING
    aligned = np.sum(Ts_end[:, :3, :3] * Ts_start[:, :3, :3], axis=1) >= np.cos(TANGENT)
    return np.asarray(near & aligned.all(axis=1))
