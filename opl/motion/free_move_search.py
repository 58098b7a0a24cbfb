"""Free moves around obstacles: from home, between passes, to home.

The straight joint move is taken where it is free. Where it is not, a path of several straight moves
is searched by sampling. A search that ends without one proves nothing, but costs seconds; so its
ends are remembered. Whatever is joined to an end by a free straight move cannot do better than that
end, and a configuration that could not be joined with several others is taken to be shut in.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from opl.cell.collision import BodyPair, CollisionScene
from opl.cell.part_tree import PartTree
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.motion.straight_moves import StraightMoves

MOST_CHECKED = 60_000  # configurations, of one search
MOST_IN_VAIN = 4  # searches from one configuration before it is taken to be shut in
MOST_LIKE = 4  # searches, by the nearest ends, that a move is held against before it is searched
# a search that was in vain is begun anew, with other random numbers, when it has stood for so many
# others beside it: what sampling finds is chance
ANEW = (8, 64, 512)
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
        self._stood_for = Counter[int]()  # by their index: how many others were given up for them

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
            pair, seed = self._shut_in(start) or self._shut_in(goal), 0
            if pair is None and (like := self._like_one_in_vain(start, goal)) is not None:
                self._stood_for[like] += 1
                seed = self._stood_for[like]
                pair = None if seed in ANEW else self._in_vain[like][2]
            if pair is not None:
                raise BlockedMoveError(pair)
            path = self._sample(start, goal, seed)
            self._paths.append(path)
        return path[1:-1]

    def _like_a_known_one(self, start: Array, goal: Array) -> Array | None:
        """Return a path that leads on from one that is known, whose ends are joined to these."""
        if not self._paths:
            return None
        from opl.motion.sampling import fewest

        ways = [way for path in self._paths for way in (path, path[::-1])]
        for k in _nearest([(way[0], way[-1]) for way in ways], start, goal):
            if self._beside(start, ways[k][0]) and self._beside(ways[k][-1], goal):
                before = start[None] if (start != ways[k][0]).any() else ways[k][:0]
                after = goal[None] if (goal != ways[k][-1]).any() else ways[k][:0]
                return fewest(np.concatenate([before, ways[k], after]), self.joined)
        return None

    def _like_one_in_vain(self, start: Array, goal: Array) -> int | None:
        """Return which search was in vain between two ends that those of a move are joined to."""
        ends = [way for a, b, _ in self._in_vain for way in ((a, b), (b, a))]
        for k in _nearest(ends, start, goal):
            if self._beside(start, ends[k][0]) and self._beside(ends[k][1], goal):
                return int(k) // 2
        return None

    def _beside(self, first: Array, second: Array) -> bool:
        """Return whether two configurations are the same or joined."""
        return bool((first == second).all()) or self.joined(first, second)

    def _shut_in(self, q: Array) -> Blocker | None:
        """Return what shuts a configuration in, if enough searches from it were in vain."""
        pairs = [
            pair for one, other, pair in self._in_vain if (q == one).all() or (q == other).all()
        ]
        return Counter(pairs).most_common(1)[0][0] if len(pairs) >= MOST_IN_VAIN else None

    def _sample(self, start: Array, goal: Array, seed: int) -> Array:
        """Search a path in coordinates in which a metre is the farthest that a point can move.

        With random numbers of a seed; one that is not 0 begins what was in vain anew.
        """
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
            seed,
        )
        if found.path is not None:
            return np.concatenate([start[None], found.path[1:-1] / scale, goal[None]])
        refused = found.refused[:MOST_NAMED] / scale
        pairs = [moves.first_pair(a, b) for a, b in refused]
        met = Counter(pair for pair in pairs if pair is not None)
        limits = " ".join(self.cell.broken_limits(refused[:, 1]))
        pair: Blocker = met.most_common(1)[0][0] if met else (f"limits of {limits}",)
        if not seed:
            self._in_vain.append((start, goal, pair))
        raise BlockedMoveError(pair)


def _nearest(ways: Sequence[tuple[Array, Array]], start: Array, goal: Array) -> list[int]:
    """Return which ways, by their ends, are nearest to a move, and no more than a few of them."""
    away = [np.abs(a - start).max() + np.abs(b - goal).max() for a, b in ways]
    return list(np.argsort(away, kind="stable")[:MOST_LIKE])
