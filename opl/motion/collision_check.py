"""Is a whole motion free of collision, at its configurations and between them?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.robot import forward_kinematics
from opl.cell.wheel_distance import PartTree, signed_wheel_distance
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.geometry.frames import Array
from opl.motion.motion import Motion

RESOLUTION = np.deg2rad(1.0)  # largest joint change between two configurations that are checked


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


def densify(q: Array, resolution: float) -> tuple[Array, np.ndarray]:
    """Put configurations on the joint lines between configurations.

    `q` is in [rad], shape (n, 6); no joint changes by more than `resolution` in [rad] between two
    of the result.

    Returns:
        Configurations, shape (m, 6), ending with the last; and for each the index of the move that
        it belongs to (the configuration that the move ends at), shape (m,).
    """
    counts = np.maximum(np.ceil(np.abs(np.diff(q, axis=0)).max(axis=1) / resolution), 1).astype(int)
    move = np.repeat(np.arange(1, len(q)), counts)
    ends = np.cumsum(counts)
    fraction = (np.arange(len(move)) - np.repeat(ends - counts, counts) + 1) / counts[move - 1]
    dense = q[move - 1] + fraction[:, None] * (q[move] - q[move - 1])
    return np.concatenate([q[:1], dense]), np.concatenate([[0], move])


def colliding_moves(
    cell: WorkCell, scene: CollisionScene, part: PartTree, motion: Motion
) -> list[CollidingMove]:
    """Return every move of a motion that collides, once each, in order.

    The part may sink into the belt by its largest penetration while it is on the wheel, on
    approaches and on retracts; on free moves it keeps its clearance from the wheel.
    """
    q, move = densify(motion.q, RESOLUTION)
    Ts_base_flange = forward_kinematics(cell.robot, q)
    needed = np.where(motion.free[move], cell.part_from_wheel, -cell.planned_penetration)
    Ts_contact0_workpiece = cell.Ts_contact0_workpiece(Ts_base_flange)
    cuts = signed_wheel_distance(part, cell.wheel, Ts_contact0_workpiece, needed) < needed
    # a move that is refused for the wheel need not be checked further
    unrefused = ~np.isin(move, move[cuts])
    hits = np.zeros(len(q), dtype=bool)
    hits[unrefused] = scene.collides(q[unrefused])
    faults = []
    for index in np.unique(move[cuts | hits]):
        on_move = np.flatnonzero(move == index)
        first = on_move[(cuts | hits)[on_move]][0]
        pair = (PART, WHEEL) if cuts[first] else scene.colliding_pairs(q[first])[0]
        faults.append(CollidingMove(int(index), pair, bool((cuts | hits)[on_move[-1]])))
    return faults
