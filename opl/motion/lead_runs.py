"""How far the part moves on along each pass in its leads: as far as the job says, or less.

Beyond the end of a pass the surface may rise, or the part may end in a corner. There the run is
halved, twice at the most; the least leaves the wheel as steeply as a lead ever does.
"""

from __future__ import annotations

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.wheel_distance import PartTree
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.collision_check import colliding_moves
from opl.motion.motion import Motion, MoveKind
from opl.motion.path import GrindingPath
from opl.motion.process_settings import ProcessSettings
from opl.motion.whole_motion import UnreachableApproachError, lead_at

SHARES = (1.0, 0.5, 0.25)  # of the run that the process sets


def free_runs(
    cell: WorkCell,
    scene: CollisionScene,
    part: PartTree,
    points: CutterPoints,
    path: GrindingPath,
    process: ProcessSettings,
) -> Array:
    """Return the run of each approach and retract in [m], shape (n_passes, 2).

    The longest with which the lead collides with nothing; the shortest where it does with any.
    """

    def is_free(index: int, kind: MoveKind, run: float) -> bool:
        on_pass = path.q[path.pass_index == index]
        at_contact = on_pass[0 if kind is MoveKind.APPROACH else -1]
        try:
            away = lead_at(cell, points, path, process, kind, index, run)
        except UnreachableApproachError:
            return False
        # the same configurations either way round
        motion = Motion.off_wheel(np.vstack([at_contact, away]), kind, index)
        return not colliding_moves(cell, scene, part, motion)

    runs = np.full((points.n_passes, 2), SHARES[-1] * process.approach_run)
    for index in range(points.n_passes):
        for side, kind in enumerate((MoveKind.APPROACH, MoveKind.RETRACT)):
            for share in SHARES[:-1]:
                if is_free(index, kind, share * process.approach_run):
                    runs[index, side] = share * process.approach_run
                    break
    return runs
