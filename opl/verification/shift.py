"""Whether one shift of the wheel explains why a program does not grind where it should.

A wheel that was touched anew, a new belt or another tool moves all contacts alike. What a person
wants to know then is that shift, not how far each of a hundred contacts is off.
"""

from __future__ import annotations

import numpy as np

from opl.cell.workcell import WorkCell
from opl.findings import Finding, Level
from opl.geometry.frames import Array, inverse, transform
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import ContactWheel
from opl.verification.align import align
from opl.verification.contact import find_touches
from opl.verification.world import World

FARTHEST = 1e-3  # [m] that contacts are looked for away from the contact model
LEAST = 6  # contacts: fewer are explained by too many shifts
STEP = 1e-6  # [m] for the slope of the distance to the wheel
# Slopes that differ by less than this in all contacts tell nothing of that direction.
ALIKE = 0.05


def common_shift(
    cell: WorkCell, points: CutterPoints, q: Array, max_contact_step: float, allowed: float
) -> Finding | None:
    """Return the shift of the wheel by which all contacts fit, None if there is no such one.

    Args:
        cell: The cell.
        points: The cutter points.
        q: The written configurations in [rad], shape (n, 6).
        max_contact_step: Largest change of t between neighbouring configurations on the wheel.
        allowed: Farthest that a contact may be off after the shift in [m].
    """
    with World(cell) as world:
        Ts_base_workpiece = np.array([world.move_to(configuration) for configuration in q])
    Ts_contact0_workpiece = inverse(cell.wheel.T_base_contact0) @ Ts_base_workpiece
    touches = find_touches(cell.wheel, points, Ts_contact0_workpiece, FARTHEST)
    chosen = align(touches, points.pass_index, FARTHEST, max_contact_step)
    if len(chosen) < max(LEAST, len(points) // 2):
        return None
    at, point = touches.configuration[chosen], touches.point[chosen]
    p_workpiece = points.Ts_workpiece_cutter[point, :3, 3]
    p_contact0 = transform(Ts_contact0_workpiece[at][:, None], p_workpiece[:, None])[:, 0]
    distance = cell.wheel.signed_distance(p_contact0)
    shift, *_ = np.linalg.lstsq(_slopes(cell.wheel, p_contact0), distance, rcond=ALIKE)
    left = cell.wheel.signed_distance(p_contact0 - shift)
    before, after = np.abs(distance).max(), np.abs(left).max()
    if before <= allowed or after > min(allowed, 0.3 * before):
        return None
    # where it is instead of where it was planned; z of contact frame 0 points into the wheel
    x, y, z = -1e3 * shift
    side = "nearer" if z < 0.0 else "farther"
    message = (
        f"the wheel seems {1e3 * np.linalg.norm(shift):.2f} mm {side} than planned, by x {x:.2f}, "
        f"y {y:.2f}, z {z:.2f} mm of contact frame 0: then {len(chosen)} of {len(points)} contacts "
        f"fit within {1e3 * after:.3f} mm, {1e3 * before:.3f} mm now"
    )
    return Finding(Level.ERROR, "contact", "wheel", message)


def _slopes(wheel: ContactWheel, p_contact0: Array) -> Array:
    """Return how the distance of points from the wheel changes with their place, shape (n, 3)."""
    ends = [
        wheel.signed_distance(p_contact0 + STEP * side * np.eye(3)[axis])
        for axis in range(3)
        for side in (1.0, -1.0)
    ]
    found: Array = np.stack([ends[2 * k] - ends[2 * k + 1] for k in range(3)], axis=-1)
    return found / (2.0 * STEP)
