"""Is the arm inside a solid? Collisions with a mesh are only those with its surface."""

from __future__ import annotations

from opl.cell.robot import forward_kinematics
from opl.cell.workcell import PART, WorkCell
from opl.geometry.frames import Array, inverse, transform
from opl.geometry.mesh import TriangleMesh, winding_number


def enclosing_bodies(cell: WorkCell, q: Array) -> list[tuple[str, str]]:
    """Return flange or part with each obstacle they are inside of, at ``q``, shape (6,).

    Collisions with a mesh are collisions with its triangles: whoever is wholly inside touches none
    of them. A motion that starts outside of a mesh and never meets its surface stays outside, so it
    is enough to look at one configuration.
    """
    T_base_flange = forward_kinematics(cell.robot, q)
    p_base_part = transform(T_base_flange @ cell.T_flange_workpiece, cell.part.vertices[0])
    points = {"flange": T_base_flange[:3, 3], PART: p_base_part}
    return [
        (name, body.name)
        for body in cell.obstacles
        if isinstance(body.shape, TriangleMesh) and body.shape.is_closed
        for name, p_base in points.items()
        if abs(winding_number(body.shape, transform(inverse(body.T_parent_body), p_base))) > 0.5
    ]
