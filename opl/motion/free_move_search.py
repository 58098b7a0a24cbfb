"""Free moves around obstacles: from home, between passes, to home.

The straight joint move is taken where it is free. Where it is not, a path of several straight moves
is searched by sampling. A search that ends without one proves nothing, but costs seconds; so its
ends are remembered. Whatever is joined to an end by a free straight move cannot do better than that
end, and a configuration that could not be joined with several others is taken to be shut in.
"""

from __future__ import annotations

from collections import Counter
from functools import cached_property

import numpy as np

from opl.cell.collision import BodyPair, CollisionScene
from opl.cell.part_tree import PartTree
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.motion.straight_moves import StraightMoves

MOST_CHECKED = 60_000  # configurations, of one search
MOST_IN_VAIN = 4  # searches from one configuration before it is taken to be shut in
MOST_NAMED = 100  # refused moves whose first colliding pair is looked up
# [rad] that a path may lead beyond both of its ends; less than half a turn of a wrist axis never
# was seen to be too little, and the whole of its limits is much to search
BEYOND = np.pi

Blocker = tuple[str, ...]


class BlockedMoveError(Exception):
    """No free move between two configurations was found.

    Args:
        pair: The two bodies that collide, most often where there are several; or what else stops
            it.
        end: 0 or 1 if that is so at the start or at the goal itself, else None.
    """

    def __init__(self, pair: Blocker, end: int | None = None) -> None:
        super().__init__(" and ".join(pair))
        self.pair = pair
        self.end = end


class FreeMoveSearch:
    """The free moves of one cell that were found, and the searches that found none."""

    def __init__(self, cell: WorkCell, scene: CollisionScene, part: PartTree) -> None:
        self.cell, self.scene, self.part = cell, scene, part
        self._found: dict[tuple[bytes, bytes], Array] = {}
        # paths that had to be sampled, ends included; and ends between which that was in vain, with
        # what blocked it
        self._paths: list[Array] = []
        self._in_vain: list[tuple[Array, Array, Blocker]] = []

    @cached_property
    def _moves(self) -> StraightMoves:
        return StraightMoves(self.cell, self.scene, self.part)

    def find(self, start: Array, goal: Array) -> Array:
        """Return the configurations to visit between two, shape (n, 6); none if it is free.

        `start` and `goal` are in [rad], shape (6,).

        Raises:
            BlockedMoveError: If no free move is found, or an end is too near to something.
        """
        key = start.tobytes(), goal.tobytes()
        if key not in self._found:
            self._found[key] = self._find(start, goal)
        return self._found[key]

    def joined(self, first: Array, second: Array) -> bool:
        """Return whether the straight move between two configurations is free."""
        return self._moves.free(first, second)

    def blocked_at(self, q: Array) -> BodyPair | None:
        """Return a pair that keeps a free move from beginning at ``q``, shape (6,), or None."""
        return self._moves.pair_at(q)

    def _find(self, start: Array, goal: Array) -> Array:
        if self.joined(start, goal):
            return np.empty((0, len(start)))
        for end, q in enumerate((start, goal)):
            near = self._moves.pair_at(q)
            if near is not None:
                raise BlockedMoveError(near, end)
        path = self._like_a_known_one(start, goal)
        if path is None:
            pair = self._shut_in(start) or self._shut_in(goal) or self._hopeless(start, goal)
            if pair is not None:
                raise BlockedMoveError(pair)
            path = self._sample(start, goal)
            self._paths.append(path)
        return path[1:-1]

    def _like_a_known_one(self, start: Array, goal: Array) -> Array | None:
        """Return a path that shares one end with a known one and is joined to its other end."""
        if not self._paths:
            return None
        from opl.motion.sampling import fewest

        for known in self._paths:
            for path in (known, known[::-1]):
                if np.array_equal(path[0], start) and self.joined(path[-1], goal):
                    return fewest(np.concatenate([path, goal[None]]), self.joined)
                if np.array_equal(path[-1], goal) and self.joined(start, path[0]):
                    return fewest(np.concatenate([start[None], path]), self.joined)
        return None

    def _hopeless(self, start: Array, goal: Array) -> Blocker | None:
        """Return what blocks a move, if an end is joined to one that was searched in vain."""
        for one, other, pair in self._in_vain:
            for near, far in ((one, other), (other, one)):
                if np.array_equal(start, near) and self.joined(goal, far):
                    return pair
                if np.array_equal(goal, near) and self.joined(start, far):
                    return pair
        return None

    def _shut_in(self, q: Array) -> Blocker | None:
        """Return what shuts a configuration in, if enough searches from it were in vain."""
        pairs = [
            pair for one, other, pair in self._in_vain if (q == one).all() or (q == other).all()
        ]
        return Counter(pairs).most_common(1)[0][0] if len(pairs) >= MOST_IN_VAIN else None

    def _sample(self, start: Array, goal: Array) -> Array:
        """Search a path in coordinates in which a metre is the farthest that a point can move."""
        from opl.motion.sampling import sample_path  # with OMPL, which most jobs do without

        robot, moves = self.cell.robot, self._moves
        low = np.maximum(robot.lower, np.minimum(start, goal) - BEYOND)
        high = np.minimum(robot.upper, np.maximum(start, goal) + BEYOND)
        scale = moves.levers
        end = moves.checked + MOST_CHECKED
        found = sample_path(
            start * scale,
            goal * scale,
            low * scale,
            high * scale,
            lambda a, b: moves.free(a / scale, b / scale),
            lambda: moves.checked >= end,
        )
        if found.path is not None:
            return np.concatenate([start[None], found.path[1:-1] / scale, goal[None]])
        refused = found.refused[:MOST_NAMED] / scale
        pairs = [moves.first_pair(a, b) for a, b in refused]
        met = Counter(pair for pair in pairs if pair is not None)
        limits = " ".join(self.cell.broken_limits(refused[:, 1]))
        pair: Blocker = met.most_common(1)[0][0] if met else (f"limits of {limits}",)
        self._in_vain.append((start, goal, pair))
        raise BlockedMoveError(pair)
