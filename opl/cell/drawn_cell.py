"""A cell as viewers draw it: the joints of its arm, and every solid with the joint that moves it.

What is drawn is what collisions are checked with, piece by piece.
"""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from opl.cell.robot import N_JOINTS, Robot, link_names
from opl.cell.robot_shapes import collision_shapes
from opl.cell.workcell import PART, WorkCell
from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh
from opl.geometry.shapes import Body, Box, Cylinder

_ROUND = 24  # sides of a drawn sphere
BASE, FLANGE = 0, N_JOINTS  # what does not move, and what the last joint moves


@dataclass(frozen=True, eq=False)
class DrawnChain:
    """The joints of an arm.

    Attributes:
        Ts_parent_joint: Pose of each joint, where it is at zero, in that of the joint before; of
            the first in the base frame; shape (6, 4, 4).
        axes: Direction of each joint's axis in its own frame, shape (6, 3).
        T_joint_flange: The flange in the frame of the last joint, shape (4, 4).
    """

    Ts_parent_joint: Array
    axes: Array
    T_joint_flange: Array


@dataclass(frozen=True, eq=False)
class DrawnSolid:
    """A solid.

    Attributes:
        body: Its name, for a piece of the robot that of its link; ``body.T_parent_body`` is its
            pose in the frame of the joint.
        joint: How many joints move it: 0 for what stands in the base frame, 6 for what is held.
        of_robot: Whether it is a piece of the robot.
    """

    body: Body
    joint: int
    of_robot: bool


def drawn_chain(robot: Robot) -> DrawnChain:
    """Return the joints of a robot; each turns about one axis."""
    model, _ = collision_shapes(robot)
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    pin.updateFramePlacements(model, data)
    T_base_world = data.oMf[model.getFrameId("base")].inverse()
    placements = [T_base_world * model.jointPlacements[1], *list(model.jointPlacements)[2:]]
    axes = [data.oMi[k].rotation.T @ data.J[3:, k - 1] for k in range(1, N_JOINTS + 1)]
    flange = model.frames[model.getFrameId("tool0")].placement
    return DrawnChain(
        np.array([placement.homogeneous for placement in placements]),
        np.array(axes),
        np.asarray(flange.homogeneous),
    )


def drawn_solids(cell: WorkCell) -> tuple[DrawnSolid, ...]:
    """Return every solid of a cell: links, part, fixture, wheel, obstacles."""
    chain = drawn_chain(cell.robot)
    held = [Body(PART, cell.part, cell.T_flange_workpiece), *cell.fixture]
    return (
        *drawn_links(cell.robot),
        *(
            DrawnSolid(
                Body(body.name, body.shape, chain.T_joint_flange @ body.T_parent_body),
                FLANGE,
                False,
            )
            for body in held
        ),
        *(DrawnSolid(body, BASE, False) for body in (cell.wheel_body(), *cell.obstacles)),
    )


def drawn_links(robot: Robot) -> tuple[DrawnSolid, ...]:
    """Return the pieces of a robot."""
    model, geometry = collision_shapes(robot)
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    T_base_world = data.oMf[model.getFrameId("base")].inverse()
    names = link_names(robot)
    solids = []
    for piece in geometry.geometryObjects:
        joint = int(piece.parentJoint)
        placement = piece.placement if joint else T_base_world * piece.placement
        body = Body(names[joint], _shape(piece.geometry), placement.homogeneous)
        solids.append(DrawnSolid(body, joint, True))
    return tuple(solids)


def _shape(shape: coal.CollisionGeometry) -> Box | Cylinder | TriangleMesh:
    if isinstance(shape, coal.Box):
        x, y, z = 2.0 * np.asarray(shape.halfSide)
        return Box((float(x), float(y), float(z)))
    if isinstance(shape, coal.Cylinder):
        return Cylinder(float(shape.radius), 2.0 * float(shape.halfLength))
    if isinstance(shape, coal.Sphere):
        return _hull(shape.radius * _ball())
    return _hull(np.asarray(shape.vertices()))  # links that are meshes count as their hulls


def _ball() -> Array:
    """Return points on a sphere of radius 1, shape (n, 3)."""
    around = np.linspace(0.0, 2.0 * np.pi, _ROUND, endpoint=False)
    over = np.linspace(0.0, np.pi, _ROUND // 2 + 1)[:, None]
    x, y = np.cos(around) * np.sin(over), np.sin(around) * np.sin(over)
    return np.stack([x, y, np.broadcast_to(np.cos(over), x.shape)], axis=-1).reshape(-1, 3)


def _hull(points: Array) -> TriangleMesh:
    """Return the convex hull of points, shape (n, 3)."""
    from scipy.spatial import ConvexHull  # longer to load than to draw with

    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return TriangleMesh(points, faces)
