"""The shapes of a robot and the joints that move them, as pinocchio and coal take them."""

from __future__ import annotations

import pinocchio as pin

from opl.cell.robot import Robot


def collision_shapes(robot: Robot) -> tuple[pin.Model, pin.GeometryModel]:
    """Return the joints of a robot and the shapes they move, new ones at each call."""
    model = pin.buildModelFromUrdf(str(robot.urdf))
    shapes = pin.GeometryModel()  # one that pinocchio makes itself is never let go of
    places = [str(robot.urdf.parent)]  # where relative names of meshes start
    pin.buildGeomFromUrdf(model, str(robot.urdf), pin.GeometryType.COLLISION, shapes, places)
    return model, shapes
