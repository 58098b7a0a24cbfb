"""Is a whole motion free of collision, at its configurations and between them?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from opl.cell.collision import CollisionScene
from opl.cell.part_tree import PartTree
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import signed_wheel_distance
from opl.cell.wheel_triangle import TOLERANCE
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.geometry.frames import Array, transform
from opl.geometry.mesh import box_corners
from opl.motion.motion import Motion

RESOLUTION = np.deg2rad(1.0)  # largest joint change between two configurations that are checked
# A robot that moves along what it must not come near to could be nearer between two of these: where
# it is nearer than this beyond its clearance, no point moves farther than FINE from one to the next
NEARBY = 4e-3  # [m]
FINE = 3e-3  # [m]
# Where the part may touch the wheel it turns and slides by many times what it may sink in: no
# corner of its box moves farther than this between two places that are looked at
STEP = 1e-3  # [m]
FINER = 16  # parts of a step, where the part could be too deep on the way; a power of two
CERTAIN = 0.75  # of the allowed depth: that a place is no deeper than the rest is soon found out
LONGER = 1.02  # times the straight way from place to place: what the part goes, as it turns


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


def densify(q: Array, resolution: float) -> tuple[Array, np.ndarray]:
    """Put configurations on the joint lines between configurations.

    `q` is in [rad], shape (n, 6); no joint changes by more than `resolution` in [rad] between two
    of the result.

    Returns:
        Configurations, shape (m, 6), ending with the last; and for each the index of the move that
        it belongs to (the configuration that the move ends at), shape (m,).
    """
    counts = np.ceil(np.abs(np.diff(q, axis=0)).max(axis=1) / resolution)
    return _in_parts(q, np.maximum(counts, 1).astype(int))


def _in_parts(q: Array, counts: np.ndarray) -> tuple[Array, np.ndarray]:
    """Divide the joint lines between configurations into so many parts each, as `densify` does."""
    move = np.repeat(np.arange(1, len(q)), counts)
    ends = np.cumsum(counts)
    fraction = (np.arange(len(move)) - np.repeat(ends - counts, counts) + 1) / counts[move - 1]
    dense = q[move - 1] + fraction[:, None] * (q[move] - q[move - 1])
    return np.concatenate([q[:1], dense]), np.concatenate([[0], move])


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
    sunk, sunk_at_end = _at_wheel(cell, part, motion, chosen)
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


def _at_wheel(
    cell: WorkCell, part: PartTree, motion: Motion, chosen: NDArray[np.bool_]
) -> tuple[np.ndarray, np.ndarray]:
    """Return which moves bring the part too near to the wheel, and which of them end there.

    Where it may touch the wheel, a place between two that are looked at is nearer than half of both
    distances by half the way between them at the most. Where that could matter, the way is halved.

    Returns:
        Two flags for each move, by the configuration that it ends at, each of shape (n,).
    """
    corners = box_corners(part.triangles.reshape(-1, 3))

    def distance(q: Array, kept: Array, enough: Array) -> Array:
        Ts = cell.Ts_contact0_workpiece(forward_kinematics(cell.robot, q))
        return signed_wheel_distance(part, cell.wheel, Ts, kept, enough)

    Ts_base_workpiece = forward_kinematics(cell.robot, motion.q) @ cell.T_flange_workpiece
    placed = transform(Ts_base_workpiece[:, None], corners)
    moved = np.linalg.norm(np.diff(placed, axis=0), axis=-1).max(axis=1)
    moved[motion.free[1:]] = 0.0
    turned = np.abs(np.diff(motion.q, axis=0)).max(axis=1)
    counts = np.ceil(np.maximum(turned / RESOLUTION, moved / STEP))
    counts = np.maximum(counts, 1).astype(int)
    q, move = _in_parts(motion.q, counts)
    needed = np.where(motion.free, cell.part_from_wheel, -cell.planned_penetration)[move]
    way = LONGER * np.concatenate([[0.0], moved / counts])[move]
    # a move begins where the one before it ends
    looked_at = chosen[move]
    looked_at[:-1] |= looked_at[1:]
    most = CERTAIN * cell.planned_penetration
    kept = needed + np.where(way > 0.0, np.minimum(way / 2.0 + TOLERANCE, most), 0.0)
    found = np.full(len(q), np.inf)
    # how deep it sinks matters no longer; but the next move may sink where this one may not
    enough = np.where(motion.free[move], -np.inf, needed)
    found[looked_at] = distance(q[looked_at], kept[looked_at], enough[looked_at])
    sunk = np.zeros(len(motion), dtype=bool)
    sunk[move[found < needed]] = True
    sunk &= chosen
    at_end = (found < needed)[np.concatenate([[0], np.cumsum(counts)])]
    # what keeps its distance is not measured further
    at_least = np.minimum(found, kept)
    end = np.flatnonzero((way > 0.0) & (chosen & ~sunk)[move])
    apart = np.full((len(end), FINER + 1), np.inf)
    apart[:, 0], apart[:, -1] = at_least[end - 1], at_least[end]
    step = FINER
    while step > 1:
        before = np.arange(0, FINER, step)
        too_little = 2.0 * (needed[end] + TOLERANCE) + way[end] * step / FINER
        one, k = np.nonzero(apart[:, before] + apart[:, before + step] < too_little[:, None])
        at = end[one]
        middle = before[k] + step // 2
        between = q[at - 1] + (middle / FINER)[:, None] * (q[at] - q[at - 1])
        kept = needed[at] + np.minimum(way[at] * step / FINER / 4.0 + TOLERANCE, most)
        there = distance(between, kept, needed[at])
        sunk[move[at[there < needed[at]]]] = True
        apart[one, middle] = np.minimum(there, kept)
        step //= 2
    return sunk, at_end
