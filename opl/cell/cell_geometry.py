"""Robot, held bodies and what stands around as shapes of coal, and the pairs that could meet."""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np
import pinocchio as pin

from opl.cell.coal_shapes import coal_mesh, coal_solid
from opl.cell.robot_shapes import collision_shapes
from opl.cell.workcell import PART, WHEEL, WorkCell
from opl.geometry.frames import Array

BodyPair = tuple[str, str]


@dataclass(frozen=True)
class CellGeometry:
    """A cell as geometry.

    Attributes:
        model: The joints.
        geometry: The solids: the links first, then all others; and the pairs that are checked.
        n_links: How many solids are links.
        pairs: Names of the bodies of each pair.
        needed: How far apart each pair has to be in [m], shape (p,).
        T_base_world: What turns places of pinocchio into places in the base frame, (4, 4).
    """

    model: pin.Model
    geometry: pin.GeometryModel
    n_links: int
    pairs: list[BodyPair]
    needed: Array
    T_base_world: Array


def cell_geometry(cell: WorkCell) -> CellGeometry:
    """Return a cell as geometry.

    Checked is every pair that could meet: links that are not neighbours, held bodies against all
    links but the flange's, and links and held bodies against wheel and obstacles. Pairs with
    something that is not the robot must keep the required clearance of the cell; links of the robot
    must not touch each other (their primitives already enclose the real castings). Meshes of links
    count as their convex hulls. The cell may have other rules for single pairs.
    """
    model, geometry = collision_shapes(cell.robot)
    for link in geometry.geometryObjects:
        if isinstance(link.geometry, coal.BVHModelBase):
            # as in the replay, which otherwise would refuse what is planned
            link.geometry.buildConvexHull(False, "Qt")
            link.geometry = link.geometry.convex
    names = [str(model.frames[link.parentFrame].name) for link in geometry.geometryObjects]
    n_links = len(names)
    names += _add_bodies(cell, model, geometry)
    pairs, needed = _choose_pairs(cell, geometry, names, n_links)
    base = model.frames[model.getFrameId("base")]  # base does not move
    T_base_world = base.placement.inverse().homogeneous
    return CellGeometry(model, geometry, n_links, pairs, np.array(needed), T_base_world)


def _add_bodies(cell: WorkCell, model: pin.Model, geometry: pin.GeometryModel) -> list[str]:
    """Add held bodies at the flange, wheel and obstacles at the base frame; return their names."""
    flange = model.frames[model.getFrameId("tool0")]
    base = model.frames[model.getFrameId("base")]
    added = [(PART, coal_mesh(cell.part), flange, cell.T_flange_workpiece)]
    for body in cell.fixture:
        added.append((body.name, coal_solid(body), flange, body.T_parent_body))
    for body in (cell.wheel_body(), *cell.obstacles):
        added.append((body.name, coal_solid(body), base, body.T_parent_body))
    for name, shape, frame, T_frame_body in added:
        placement = frame.placement * pin.SE3(T_frame_body)
        geometry.addGeometryObject(pin.GeometryObject(name, frame.parentJoint, placement, shape))
    return [name for name, *_ in added]


def _choose_pairs(
    cell: WorkCell, geometry: pin.GeometryModel, names: list[str], n_links: int
) -> tuple[list[BodyPair], list[float]]:
    """Enter the pairs to be checked and return their names and the margin of each in [m]."""
    joints = [solid.parentJoint for solid in geometry.geometryObjects]
    pairs, margins = [], []
    for second in range(len(joints)):
        for first in range(second):
            both_links = second < n_links
            apart = abs(joints[first] - joints[second])
            pair = names[first], names[second]
            # nothing moves within one joint; neighbouring links share a bearing
            if apart == 0 or (both_links and apart == 1) or pair == (PART, WHEEL):
                continue
            # joint 0 is what does not move: next to the first link, but not its neighbour
            held_at_wrist = apart == 1 and min(joints[first], joints[second]) > 0
            usual = 0.0 if both_links or held_at_wrist else cell.required_clearance
            margin = cell.pairs.between(*pair, otherwise=usual)
            if margin is None:
                continue
            geometry.addCollisionPair(pin.CollisionPair(first, second))
            pairs.append(pair)
            margins.append(margin)
    return pairs, margins
