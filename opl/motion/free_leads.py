"""Leads as long as they are free: as far as the job says, or less.

Beyond the end of a pass the surface may rise, or the part may end in a corner. There the run along
the pass is halved, twice at the most; the least leaves the wheel as steeply as a lead ever does.
Where no run makes the whole lead free, because the robot folds up or comes to a limit on its way
off the wheel, or no free move may begin at its end, the lead ends before: at the last configuration
from which one may.
"""

from __future__ import annotations

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
        return [
            (self.find(points, process, first), self.find(points, process, last))
            for first, last in path.pass_ends()
        ]

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
        key = (
            process.lead_shape(), end.kind, end.ik_branch,
            points.Ts_workpiece_cutter[end.cutter_point].tobytes(),
            points.direction_at(end.cutter_point), end.cutter_point, end.contact_position,
            end.q.tobytes(),
        )  # fmt: skip
        if key not in self._known:
            best, farthest = None, 0.0
            for run in np.array(SHARES) * process.approach_run:
                q, cause = reachable_lead(self._cell, points, process, end, run)
                free = self._free_moves_of(end, q)
                while free and self._free_moves.blocked_at(q[free - 1]) is not None:
                    free -= 1
                if cause is None and free == len(q):
                    best = q
                    break
                away = process.lead_shape(run).places()[free - 1] if free else 0.0
                if away > farthest:
                    best, farthest = q[:free], float(away)
            if best is None:
                shortest = SHARES[-1] * process.approach_run
                best = lead(self._cell, points, process, end, shortest)
            self._known[key] = best
        return self._known[key]

    def _free_moves_of(self, end: PassEnd, q: Array) -> int:
        """Return how many moves of a lead are free before one is not."""
        if not len(q):
            return 0
        # the same configurations either way round
        motion = Motion.off_wheel(np.vstack([end.q, q]), end.kind, 0)
        faults = colliding_moves(self._cell, self._scene, self._part, motion)
        return max(faults[0].move - 1, 0) if faults else len(q)
