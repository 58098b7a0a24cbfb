"""Is the whole motion of a track free of collision, and if not, what blocks it?"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.motion.collision_check import CollidingMove
from opl.motion.motion import Motion
from opl.motion.path import GrindingPath
from opl.motion.whole_motion import (
    BlockedMotionError,
    UnreachableApproachError,
    linked,
    whole_motion,
)
from opl.planning.filling import BrokenEdgesError, fill_in
from opl.planning.nodes import NodeMatrix
from opl.planning.problem import GrindingProblem


@dataclass(frozen=True)
class Free:
    """The whole motion of a track is free."""

    path: GrindingPath
    motion: Motion


@dataclass(frozen=True)
class NoMotion:
    """Edges of the track cannot be filled in, or an approach or retract does not exist."""

    error: BrokenEdgesError | UnreachableApproachError


@dataclass(frozen=True)
class Collides:
    """Moves of the motion collide; its free moves are straight."""

    motion: Motion
    faults: tuple[CollidingMove, ...]

    @property
    def of_part_and_wheel(self) -> Collides | None:
        """What is left of it without the robot: part and wheel while it grinds; None if nothing."""
        kind = self.motion.kind
        left = [f for f in self.faults if f.pair == (PART, WHEEL) and kind[f.move].on_wheel]
        return replace(self, faults=tuple(left)) if left else None


@dataclass(frozen=True)
class NoFreeMove:
    """Nothing but a free move that was not found stops the motion; its free moves are straight."""

    motion: Motion
    error: BlockedMotionError


Blocked = NoMotion | Collides | NoFreeMove


def check_track(problem: GrindingProblem, nodes: NodeMatrix, rows: np.ndarray) -> Free | Blocked:
    """Return the motion of a track if it is free, else what blocks it.

    `rows` are those of the track in each column, shape (N,).
    """
    cell, points = problem.cell, problem.points
    try:
        path = fill_in(cell, points, nodes, rows, problem.interpolation)
    except BrokenEdgesError as error:
        return NoMotion(error)
    return check_path(problem, path)


def check_path(problem: GrindingProblem, path: GrindingPath) -> Free | Blocked:
    """Return the motion of a path if it is free, else what blocks it."""
    scene = problem.scene
    cell, points, process = scene.cell, problem.points, problem.process
    try:
        leads = scene.free_leads.of_path(points, path, process)
        motion = whole_motion(cell, points, path, process, leads)
    except UnreachableApproachError as error:
        return NoMotion(error)
    faults = scene.moves.colliding(motion)
    # free moves are led around what blocks them, unless it is where an approach begins
    faults = [
        fault
        for fault in faults
        if not motion.kind[fault.move].is_free
        or (fault.at_end and motion.pass_index[fault.move] >= 0)
    ]
    if faults:
        return Collides(motion, tuple(faults))
    try:
        return Free(path, linked(motion, scene.free_moves))
    except BlockedMotionError as error:
        return NoFreeMove(motion, error)
