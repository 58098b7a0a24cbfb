"""Where along a wall the robot surely collides, whatever the posture within the pads of a cell.

A cell counts as forbidden only if at its middle bodies are nearer than allowed by more than they
can come apart within the cell.
"""

from __future__ import annotations

import numpy as np

from opl.cell.collision import CollisionScene
from opl.geometry.frames import Array
from opl.planning.cut_cells import halved
from opl.planning.images import Images
from opl.search.walls import Piece

MOST_WITHIN = 2  # halvings of a cell all in collision, but not deep enough to be sure


class Obstructions:
    """Leaves out of walls where the robot collides.

    Args:
        collision: The scene; motions that come nearer than its clearances do not count.
        images: The images of each posture: those with the wrist flipped are looked at as well.
    """

    def __init__(self, collision: CollisionScene, images: Images) -> None:
        self._collision = collision
        self._flips = images.flips
        self._known: dict[int, tuple[Piece, dict[tuple[float, float], list[bool]]]] = {}

    def clear(self, piece: Piece, first: int, end: int) -> list[Piece] | None:
        """Return what is left of the cells from ``first`` to before ``end``, None if all is."""
        pads = np.maximum(piece.pad_high, -piece.pad_low)
        step = np.diff(piece.corners, axis=0)
        # by the piece itself: while it is kept here, no other one has its place in memory
        _, known = self._known.setdefault(id(piece), (piece, {}))

        def surely(_: np.ndarray, low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
            asked = list(zip(low.tolist(), high.tolist(), strict=True))
            new = np.array([k for k, cell in enumerate(asked) if cell not in known], dtype=int)
            if len(new):
                middle = (low + high)[new] / 2.0
                cell = middle.astype(int)
                q = piece.corners[cell] + step[cell] * (middle - cell)[:, None]
                turned = np.abs(step[cell]) * (high - low)[new, None] / 2.0 + pads[cell]
                hit, near = self._collide(q, turned)
                for k, *found in zip(new.tolist(), hit.tolist(), near.tolist(), strict=True):
                    known[asked[k]] = found
            both = np.array([known[cell] for cell in asked], dtype=bool)
            return both[:, 0], both[:, 1]

        # the cells beside tell where collisions begin
        cells = np.arange(max(first - 1, 0), min(end + 1, len(pads)), dtype=float)
        run = np.zeros(len(cells), dtype=int)
        _, low, high, hit = halved(run, cells, cells + 1.0, surely, MOST_WITHIN)
        own = (low >= first) & (high <= end)
        low, high, hit = low[own], high[own], hit[own]
        if not hit.any():
            return None
        cell = ((low + high) / 2.0).astype(int)
        ends = np.append(low, high[-1])
        places = np.arange(len(pads) + 1)
        corners = np.stack([np.interp(ends, places, joint) for joint in piece.corners.T], axis=1)
        at = np.interp(ends, places, piece.at)
        finer = Piece(
            piece.family, piece.line, at, corners, piece.pad_low[cell], piece.pad_high[cell]
        )
        breaks = np.flatnonzero(np.diff(hit)) + 1
        starts = [0, *breaks.tolist()]
        return [
            finer.part(start, end)
            for start, end in zip(starts, [*starts[1:], len(hit)], strict=True)
            if not hit[start]
        ]

    def _collide(self, q: Array, turned: Array) -> tuple[np.ndarray, np.ndarray]:
        """Return where postures collide however they turn, and where they do as they are.

        Args:
            q: In [rad], shape (n, 6).
            turned: How far each joint can turn from there in [rad], shape (n, 6).
        """
        surely, near = np.ones(len(q), dtype=bool), np.ones(len(q), dtype=bool)
        for sign, shift in self._flips:
            flipped = q * sign + shift
            now = np.flatnonzero(near)
            near[now] = self._collision.collides(flipped[now])
            surely &= near
            now = np.flatnonzero(surely)
            surely[now] = self._collision.collides_throughout(flipped[now], turned[now])
        return surely, near
