"""What is to be planned: the cell, the points and the free nodes, as one value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.wheel_distance import PartTree
from opl.cell.workcell import WorkCell
from opl.field.nodes import NodeField, NodeMatrix
from opl.field.path import Interpolation
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.links import Links
from opl.motion.process import ProcessSettings
from opl.search.ladder import Ladder


@dataclass(frozen=True)
class GrindingProblem:
    """Everything a search needs.

    Attributes:
        cell: The cell.
        scene: Its collision geometry.
        part: The triangles of the part.
        points: N cutter points.
        field: The nodes of every branch.
        wheel_clearance: Signed distance of the part to the wheel in [m], exact where it is less
            than the largest belt penetration allows, shape (N, M).
        interpolation: How the path between nodes is filled in.
        process: Speeds, approach and home.
        links: Ways through the air, found so far; not to be given, and kept as long as the cell is
            the same.
    """

    cell: WorkCell
    scene: CollisionScene
    part: PartTree
    points: CutterPoints
    field: NodeField
    wheel_clearance: Array
    interpolation: Interpolation
    process: ProcessSettings
    links: Links = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        known = self.links
        if (
            not isinstance(known, Links)
            or known.scene is not self.scene
            or known.cell is not self.cell
        ):
            object.__setattr__(self, "links", Links(self.cell, self.scene, self.part))

    @property
    def off_wheel(self) -> np.ndarray:
        """Which steps from a cutter point to the next leave the wheel, shape (N - 1,)."""
        return np.diff(self.points.pass_index) != 0

    def free_nodes(self, nodes: NodeMatrix) -> np.ndarray:
        """Return which nodes exist and do not cut into the wheel, shape (N, n_rows)."""
        free = self.wheel_clearance >= -self.cell.planned_penetration
        return np.ascontiguousarray(nodes.exists & free[:, nodes.position_index])

    def ladder(self, nodes: NodeMatrix, free: np.ndarray) -> Ladder:
        """Return a branch as the search sees it."""
        return Ladder(
            nodes.q,
            free,
            nodes.contact_position,
            self.off_wheel,
            self.interpolation.max_contact_step,
            self.interpolation.max_joint_step,
        )
