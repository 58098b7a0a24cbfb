"""Is the arm inside a solid without touching its surface?

Collisions with a mesh are collisions with its triangles. A motion that starts outside of a mesh
and never meets its surface stays outside, so one posture is enough to ask.
"""

from __future__ import annotations

import numpy as np

from opl.cell.robot import forward_kinematics
from opl.cell.workcell import PART, WorkCell
from opl.geometry.frames import Array, inverse, transform
from opl.geometry.mesh import TriangleMesh

FLANGE = "flange"


def enclosing_bodies(cell: WorkCell, q: Array) -> list[tuple[str, str]]:
    """Return flange or part with the mesh they are inside of, at one posture, shape (6,)."""
    T_base_flange = forward_kinematics(cell.robot, q)
    p_base_part = transform(T_base_flange @ cell.T_flange_workpiece, cell.part.vertices[0])
    points = {FLANGE: T_base_flange[:3, 3], PART: p_base_part}
    return [
        (name, body.name)
        for body in cell.obstacles
        if isinstance(body.shape, TriangleMesh) and body.shape.is_closed
        for name, p_base in points.items()
        if abs(winding_number(body.shape, transform(inverse(body.T_parent_body), p_base))) > 0.5
    ]


def winding_number(mesh: TriangleMesh, p: Array) -> float:
    """Return how often a surface goes around a point: 1 in a solid, 0 outside, a part if open.

    The sum of the solid angles of its triangles (Van Oosterom and Strackee, 1983).

    Args:
        mesh: The surface.
        p: The point in [m], shape (3,).
    """
    a, b, c = np.moveaxis(mesh.triangles - p, 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", one, other) for one, other in ((a, b), (b, c), (c, a))]
    angle = 2.0 * np.arctan2(volume, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb)
    return float(angle.sum() / (4.0 * np.pi))
