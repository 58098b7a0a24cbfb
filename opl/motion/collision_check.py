"""Is a whole motion free of collision, at its configurations and between them?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from opl.cell.collision import CollisionScene
from opl.cell.part_tree import PartTree
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.geometry.frames import Array
from opl.motion.joint_lines import RESOLUTION, densify
from opl.motion.motion import Motion
from opl.motion.wheel_check import too_near

# A robot that moves along what it must not come near to could be nearer between two of these: where
# it is nearer than this beyond its clearance, no point moves farther than FINE from one to the next
NEARBY = 4e-3  # [m]
FINE = 3e-3  # [m]


@dataclass(frozen=True)
class CollidingMove:
    """A move that collides.

    Attributes:
        move: Index of the configuration that the move ends at.
        pair: Names of the two bodies.
        at_end: Whether the configuration itself collides, not only the move to it.
    """

    move: int
    pair: tuple[str, str]
    at_end: bool


Faults = list[CollidingMove]


class MoveCheck:
    """`colliding_moves` of motions that share moves: those of the last one are not looked at again.

    What is found of a move depends on nothing but its configurations, those of the move before it,
    at whose end it begins, and whether the two are free moves.
    """

    def __init__(self, cell: WorkCell, scene: CollisionScene, part: PartTree) -> None:
        self._looked_at = cell, scene, part
        self._known: dict[bytes, CollidingMove | None] = {}

    def colliding(self, motion: Motion, chosen: NDArray[np.bool_] | None = None) -> Faults:
        """Return which moves of a motion collide, of those chosen, once each, in order.

        `chosen` are flags of the moves by the configurations that they end at, shape (n,).
        """
        moves = range(len(motion)) if chosen is None else np.flatnonzero(chosen).tolist()
        free = motion.free
        keys = {
            move: motion.q[max(move - 2, 0) : move + 1].tobytes()
            + free[max(move - 1, 0) : move + 1].tobytes()
            for move in moves
        }
        new = np.zeros(len(motion), dtype=bool)
        new[[move for move, key in keys.items() if key not in self._known]] = True
        found = {one.move: one for one in colliding_moves(*self._looked_at, motion, new)}
        self._known = {
            key: found.get(move) if new[move] else self._known[key] for move, key in keys.items()
        }
        faults = ((move, self._known[key]) for move, key in keys.items())
        return [replace(fault, move=move) for move, fault in faults if fault is not None]


def colliding_moves(
    cell: WorkCell,
    scene: CollisionScene,
    part: PartTree,
    motion: Motion,
    chosen: NDArray[np.bool_] | None = None,
) -> Faults:
    """Return every move of a motion that collides, once each, in order.

    The part may sink into the belt by its largest penetration while it is on the wheel, on
    approaches and on retracts; on free moves it keeps its clearance from the wheel. Only moves that
    are chosen are looked at, flags by the configurations that they end at, shape (n,).
    """
    if chosen is None:
        chosen = np.ones(len(motion), dtype=bool)
    sunk, sunk_at_end = too_near(cell, part, motion, chosen)
    q, move = densify(motion.q, RESOLUTION)
    # a move that is refused for the wheel need not be checked further
    unrefused = (chosen & ~sunk)[move]
    hits = np.zeros(len(q), dtype=bool)
    hits[unrefused] = scene.collides(q[unrefused])
    between = _between(scene, q, move, unrefused & ~hits & ~motion.free[move])
    faults = []
    for index in np.unique([*np.flatnonzero(sunk), *move[hits], *between]):
        if sunk[index]:
            faults.append(CollidingMove(int(index), (PART, WHEEL), bool(sunk_at_end[index])))
            continue
        on_move = np.flatnonzero(move == index)
        first = q[on_move[hits[on_move]][0]] if hits[on_move].any() else between[int(index)]
        pair = scene.colliding_pairs(first)[0]
        faults.append(CollidingMove(int(index), pair, bool(hits[on_move[-1]])))
    return faults


def _between(
    scene: CollisionScene, q: Array, move: np.ndarray, chosen: np.ndarray
) -> dict[int, Array]:
    """Return which moves collide between two configurations that are checked, and where first.

    Args:
        scene: The scene.
        q: The configurations in [rad], shape (m, 6).
        move: The move of each, shape (m,).
        chosen: Which are looked at, and the way to them from the one before, shape (m,).
    """
    near = np.zeros(len(q), dtype=bool)
    around = chosen.copy()
    around[:-1] |= chosen[1:]
    near[around] = scene.wider(NEARBY).collides(q[around])
    ends = np.flatnonzero(chosen[1:] & (near[1:] | near[:-1])) + 1
    parts = np.ceil(np.abs(q[ends] - q[ends - 1]) @ scene.levers / FINE).astype(int)
    ends, parts = ends[parts > 1], parts[parts > 1]
    if not len(ends):
        return {}
    end = np.repeat(ends, parts - 1)
    begin = np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1)
    share = (np.arange(len(end)) - begin + 1) / np.repeat(parts, parts - 1)
    finer = q[end - 1] + share[:, None] * (q[end] - q[end - 1])
    hits = np.flatnonzero(scene.collides(finer))
    return {int(move[end[k]]): finer[k] for k in hits[::-1].tolist()}
