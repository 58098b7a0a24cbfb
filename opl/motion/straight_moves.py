"""Is a straight joint move free of collision all along, and not only where one looks?

No point of the robot or the part moves farther than the joints turn times their levers. So a
configuration that keeps a distance d beyond its clearance from all that stands still frees every
configuration that no point moves d away from. A move is cut into pieces that their middle frees,
long ones first; where a piece is too near for that, it is cut again.
"""

from __future__ import annotations

import numpy as np

from opl.cell.collision import BodyPair, CollisionScene
from opl.cell.part_tree import PartTree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.workcell import PART, SECOND_OPINION, WHEEL, WorkCell
from opl.geometry.frames import Array
from opl.motion.joint_lines import RESOLUTION, densify

# [m] a piece may be as long as to move no point farther than this from its middle; what would need
# a distance beyond the clearance smaller than the last is taken to be too near
RESERVES = (0.064, 0.016, 0.004, 0.001, 0.00025, 0.00005)
WHERE_BEGUN = SECOND_OPINION + RESERVES[-1]  # [m] beyond the clearance: there free moves begin


class StraightMoves:
    """Are straight joint moves off the wheel free?

    Robot and part against all that stands still, wheel included, is proven along the whole move, at
    the clearance and what the second opinion may differ by. Links and held bodies against each
    other are checked every `RESOLUTION`, as everywhere in the planner.
    """

    def __init__(self, cell: WorkCell, scene: CollisionScene, part: PartTree) -> None:
        self.checked = 0  # configurations
        self.levers = scene.levers
        self._cell = cell
        self._scene = scene
        self._part = part
        self._wider = {
            reserve: scene.against_surroundings(SECOND_OPINION + reserve) for reserve in RESERVES
        }

    def free(self, start: Array, end: Array) -> bool:
        """Return whether the move between two ``q``, shape (6,), is free and within limits."""
        if not self._cell.within_limits(np.stack([start, end])).all():
            return False  # limits are linear in the joints: what both ends keep, the move keeps
        dense, _ = densify(np.stack([start, end]), RESOLUTION)
        # the middle first, then the quarters: a move that is not free is mostly known so sooner
        first = self._scene.first_colliding(dense[_halving(len(dense))])
        self.checked += min(first + 1, len(dense))
        if first < len(dense):
            return False
        if self._too_near_wheel(dense, 0.0).any():
            return False
        pieces = np.array([[0.0, 1.0]])
        longest = float(np.abs(end - start) @ self.levers)
        for reserve in RESERVES:
            pieces = _cut(pieces, 2.0 * reserve / max(longest, reserve))
            pieces = pieces[self._near(start, end, pieces, reserve)]
            if not len(pieces):
                return True
        return False

    def pair_at(self, q: Array) -> BodyPair | None:
        """Return the first pair that is too near at a configuration, shape (6,), or None."""
        if self._too_near_wheel(q[None], RESERVES[-1])[0]:
            return PART, WHEEL
        pairs = self._scene.colliding_pairs(q) or self._wider[RESERVES[-1]].colliding_pairs(q)
        return pairs[0] if pairs else None

    def first_pair(self, start: Array, end: Array) -> BodyPair | None:
        """Return the first pair that collides on the move between two configurations, or None."""
        dense, _ = densify(np.stack([start, end]), RESOLUTION)
        pairs = (self.pair_at(configuration) for configuration in dense)
        return next((pair for pair in pairs if pair is not None), None)

    def _near(self, start: Array, end: Array, pieces: Array, reserve: float) -> np.ndarray:
        """Return which pieces, shape (n, 2) in fractions, their middle does not free."""
        q = start + pieces.mean(axis=1)[:, None] * (end - start)
        self.checked += len(q)
        near = self._wider[reserve].collides(q)
        near[~near] = self._too_near_wheel(q[~near], reserve)
        return near

    def _too_near_wheel(self, q: Array, reserve: float) -> np.ndarray:
        """Return at which ``q``, shape (n, 6), the part does not keep away from the wheel."""
        needed = self._cell.part_from_wheel + SECOND_OPINION + reserve
        Ts = self._cell.Ts_contact0_workpiece(forward_kinematics(self._cell.robot, q))
        clearance = signed_wheel_distance(self._part, self._cell.wheel, Ts, needed, enough=needed)
        return np.asarray(clearance < needed)


def _cut(pieces: Array, longest: float) -> Array:
    """Cut pieces, shape (n, 2), into equal ones none of which is longer than allowed."""
    length = pieces[:, 1] - pieces[:, 0]
    counts = np.maximum(np.ceil(length / longest), 1).astype(int)
    begin = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(counts.sum()) - begin) / np.repeat(counts, counts)
    width = np.repeat(length / counts, counts)
    low = np.repeat(pieces[:, 0], counts) + share * np.repeat(length, counts)
    return np.stack([low, low + width], axis=1)


def _halving(n: int) -> np.ndarray:
    """Return 0 ... n - 1 in an order that halves the gaps: the middle before the quarters."""
    bits = max(n - 1, 1).bit_length()
    numbers = np.arange(1 << bits)
    reversed_bits = sum(((numbers >> bit) & 1) << (bits - 1 - bit) for bit in range(bits))
    return reversed_bits[reversed_bits < n]  # type: ignore[index]
