"""An arm as it is drawn: outlines of its links, its axes, and where its wrist can be."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import coal
import numpy as np
import pinocchio as pin

from opl.cell.full_turns import full_turns, principal
from opl.cell.parallel_axes import ParallelAxesArm
from opl.cell.robot import Robot
from opl.cell.robot_shapes import collision_shapes
from opl.cell.triangle import bend_to
from opl.geometry.frames import Array, transform

_CIRCLE = 48  # corners of a drawn circle


@dataclass(frozen=True, eq=False)
class DrawnArm:
    """An arm at its zero configuration, in the base frame.

    Attributes:
        outlines: Of each collision shape the joint that moves it, 0 for the foot, and points whose
            convex hull it is in [m], shape (n, 3).
        axis_points: A point on each joint axis in [m], shape (6, 3); that of the wrist axes is the
            wrist, as far as they meet.
        axes: Directions of the axes, shape (6, 3).
        flange: Origin of the flange frame in [m], shape (3,).
    """

    outlines: tuple[tuple[int, Array], ...]
    axis_points: Array
    axes: Array
    flange: Array


def drawn_arm(robot: Robot) -> DrawnArm:
    """Return what there is to draw of a robot at its zero configuration."""
    model, geometry = collision_shapes(robot)
    data, shapes = model.createData(), geometry.createData()
    pin.computeJointJacobians(model, data, np.zeros(6))
    pin.updateGeometryPlacements(model, data, geometry, shapes)
    pin.updateFramePlacements(model, data)
    base_from = data.oMf[model.getFrameId("base")].inverse()
    outlines = [
        (
            int(shape.parentJoint),
            transform((base_from * placed).homogeneous, _corners(shape.geometry)),
        )
        for shape, placed in zip(geometry.geometryObjects, shapes.oMg, strict=True)
    ]
    T_base_world = base_from.homogeneous
    origins = np.array([data.oMi[joint].translation for joint in range(1, 7)])
    flange = data.oMf[model.getFrameId("tool0")].translation
    return DrawnArm(
        tuple(outlines),
        transform(T_base_world, origins),
        data.J[3:].T @ T_base_world[:3, :3].T,
        transform(T_base_world, flange),
    )


def wrist_reach(robot: Robot, ahead: Array, up: Array) -> Array:
    """Return how far joints 2 and 3 are inside their limits with the wrist at places.

    Joint 1 is at zero. The wrist is the wrist centre, or axis 4 of an arm with parallel axes.

    Args:
        robot: The arm.
        ahead: Places ahead of axis 1 in [m], shape (...).
        up: And above the base frame.

    Returns:
        In [rad], shape (...): negative beyond a limit. Next to the end of the reach it is the
        distance from there in [m], negative out of reach.
    """
    arm = robot.arm
    if isinstance(arm, ParallelAxesArm):
        forearm, tilt = arm.c3, 0.0
    else:
        forearm, tilt = float(np.hypot(arm.a2, arm.c3)), float(np.arctan2(arm.a2, arm.c3))
    shape = np.shape(ahead)
    forward, above = (np.reshape(v, (1, -1)) for v in (ahead - arm.a1, up - arm.c1))
    angles = bend_to(forward, above, arm.c2, forearm)
    theta = np.stack([angles[0], angles[1] - tilt], axis=-1)  # (2 elbows, n, 2)
    q = principal((theta + np.array(arm.offsets[1:3])) * np.array(arm.signs[1:3]))
    lower, upper = robot.lower[1:3], robot.upper[1:3]
    beyond = np.unique(full_turns(robot.lower, robot.upper)[:, 1:3], axis=0)
    margins = [np.minimum(q + turn - lower, upper - q - turn).min(axis=-1) for turn in beyond]
    away = np.hypot(forward, above)[0]
    to_end = np.minimum(arm.c2 + forearm - away, away - abs(arm.c2 - forearm))
    return np.asarray(np.fmin(np.max(margins, axis=0).max(axis=0), to_end).reshape(shape))


def _corners(shape: coal.CollisionGeometry) -> Array:
    """Return points whose convex hull is a shape, in its own frame in [m], shape (n, 3)."""
    if isinstance(shape, coal.Box):
        return np.asarray(np.array(list(product((-1.0, 1.0), repeat=3))) * shape.halfSide)
    if isinstance(shape, coal.Sphere):
        around, over = np.meshgrid(*[np.linspace(0.0, 2.0 * np.pi, _CIRCLE)] * 2)
        sides = [np.cos(around) * np.sin(over), np.sin(around) * np.sin(over), np.cos(over)]
        return np.asarray(shape.radius * np.stack(sides, axis=-1).reshape(-1, 3))
    if isinstance(shape, coal.Cylinder):
        angle = np.linspace(0.0, 2.0 * np.pi, _CIRCLE, endpoint=False)
        circle = shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        ends = np.repeat([-shape.halfLength, shape.halfLength], _CIRCLE)
        return np.column_stack([np.tile(circle, (2, 1)), ends])
    return np.asarray(shape.vertices())  # a mesh
