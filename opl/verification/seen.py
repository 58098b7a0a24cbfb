"""What is seen of the configurations of a motion, whatever its times: where cutter points touch."""

from __future__ import annotations

from dataclasses import dataclass, replace

from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.verification.arm import Arm
from opl.verification.contact import Touches, find_touches
from opl.verification.passing import Samples, sample


@dataclass(frozen=True, eq=False)
class Seen:
    """What is seen of configurations.

    Attributes:
        q: The configurations, shape (n, 6).
        samples: Those on their moves.
        touches: Which cutter points are touched; their configurations are indices of the samples.
    """

    q: Array
    samples: Samples
    touches: Touches


def see(cell: WorkCell, points: CutterPoints, q: Array, allowed: float) -> Seen:
    """Return what is seen of configurations.

    Args:
        cell: The cell.
        points: The cutter points that may be ground.
        q: Joint positions in [rad], joined by linear joint interpolation, shape (n, 6).
        allowed: Farthest that a ground point may be from the contact model in [m].
    """
    with Arm(cell) as arm:
        samples = sample(arm, cell.wheel, points, cell.part.vertices, q, allowed)
    # of the configurations of a straight move only the last is written, and all lie near together
    near = samples.near
    touches = find_touches(cell.wheel, points, samples.Ts_contact0_workpiece[near], allowed)
    return Seen(q, samples, replace(touches, configuration=near[touches.configuration]))
