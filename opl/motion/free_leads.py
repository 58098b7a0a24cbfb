"""Leads as long as they are free: as far as the job says, or less.

Beyond the end of a pass the surface may rise, or the part may end in a corner. There the run along
the pass is halved, twice at the most; the least leaves the wheel as steeply as a lead ever does.
Where no run makes the whole lead free, because the robot folds up or comes to a limit on its way
off the wheel, or no free move may begin at its end, the lead ends before: at the last configuration
from which one may.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.part_tree import PartTree
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.collision_check import colliding_moves
from opl.motion.free_move_search import FreeMoveSearch
from opl.motion.motion import Motion
from opl.motion.path import GrindingPath, PassEnd
from opl.motion.process_settings import ProcessSettings
from opl.motion.whole_motion import lead, reachable_lead

SHARES = (1.0, 0.5, 0.25)  # of the run that the process sets


class FreeLeads:
    """The leads of one cell, and those that were found.

    Args:
        cell: The cell.
        scene: Its collision geometry.
        part: The triangles of the part.
        free_moves: Tells where a free move may begin.
    """

    def __init__(
        self, cell: WorkCell, scene: CollisionScene, part: PartTree, free_moves: FreeMoveSearch
    ) -> None:
        self._cell, self._scene, self._part = cell, scene, part
        self._free_moves = free_moves
        self._known: dict[tuple[object, ...], Array] = {}

    def of_path(
        self, points: CutterPoints, path: GrindingPath, process: ProcessSettings
    ) -> list[tuple[Array, Array]]:
        """Return approach and retract of each pass of a path, as `find` does.

        Raises:
            UnreachableApproachError: As `find` does.
        """
        ends = [end for both in path.pass_ends() for end in both]
        leads = self._found(points, process, ends)
        return list(zip(leads[::2], leads[1::2], strict=True))

    def find(self, points: CutterPoints, process: ProcessSettings, end: PassEnd) -> Array:
        """Return configurations from just off the wheel to the far end of a lead, shape (k, 6).

        The lead with the longest run that is free as a whole, with a free move that may begin at
        its end; where none is, as much of the one that comes farthest; where none comes anywhere,
        that of the shortest run.

        Args:
            points: The cutter points.
            process: How far leads should lead.
            end: The end of a pass where it leads to or from.

        Raises:
            UnreachableApproachError: If nothing of it is free and it leaves reach or limits.
        """
        return self._found(points, process, [end])[0]

    def _found(
        self, points: CutterPoints, process: ProcessSettings, ends: Sequence[PassEnd]
    ) -> list[Array]:
        """Return the leads of some ends of passes, as `find` does, all checked at once."""
        keys = [_key(points, process, end) for end in ends]
        left = {key: end for key, end in zip(keys, ends, strict=True) if key not in self._known}
        parts: dict[object, tuple[float, Array]] = {}  # how far it comes, and as much of the lead
        for run in np.array(SHARES) * process.approach_run:
            places = process.lead_shape(run).places()
            tried = {
                key: reachable_lead(self._cell, points, process, end, run)
                for key, end in left.items()
            }
            free_moves = self._free_moves_of(list(left.values()), [q for q, _ in tried.values()])
            for (key, (q, cause)), free in zip(tried.items(), free_moves, strict=True):
                while free and self._free_moves.blocked_at(q[free - 1]) is not None:
                    free -= 1
                if cause is None and free == len(q):
                    self._known[key] = q
                    del left[key]
                elif free and places[free - 1] > parts.get(key, (0.0, q))[0]:
                    parts[key] = float(places[free - 1]), q[:free]
        for key, end in left.items():
            shortest = SHARES[-1] * process.approach_run
            part = parts.get(key)
            self._known[key] = part[1] if part else lead(self._cell, points, process, end, shortest)
        return [self._known[key] for key in keys]

    def _free_moves_of(self, ends: Sequence[PassEnd], leads: Sequence[Array]) -> list[int]:
        """Return how many moves of each lead from its end of a pass are free before one is not."""
        if not ends:
            return []
        # the same configurations either way round
        motion = Motion.joined(
            [
                Motion.off_wheel(np.vstack([end.q, q]), end.kind, index)
                for index, (end, q) in enumerate(zip(ends, leads, strict=True))
            ]
        )
        first = np.cumsum([0, *(1 + len(q) for q in leads[:-1])])
        chosen = np.ones(len(motion), dtype=bool)
        chosen[first] = False  # no move leads from lead to lead
        free = np.array([len(q) for q in leads])
        free[self._scene.collides(motion.q[first])] = 0
        for fault in colliding_moves(self._cell, self._scene, self._part, motion, chosen):
            index = int(motion.pass_index[fault.move])
            free[index] = min(free[index], fault.move - int(first[index]) - 1)
        return [int(count) for count in free]


def _key(points: CutterPoints, process: ProcessSettings, end: PassEnd) -> tuple[object, ...]:
    """Return what tells the lead of an end of a pass from others."""
    return (
        process.lead_shape(), end.kind, end.ik_branch,
        points.Ts_workpiece_cutter[end.cutter_point].tobytes(),
        points.direction_at(end.cutter_point), end.cutter_point, end.contact_position,
        end.q.tobytes(),
    )  # fmt: skip
