"""What tracks are charged for where the joint range sum does not care, and whole paths."""

from __future__ import annotations

import numpy as np

from opl.cell.collision import CollisionScene
from opl.cell.inverse_kinematics import singularity_margins
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.planning.nodes import NodeMatrix
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights
from opl.search.smooth import TrackCost

NEAR_LIMIT = np.deg2rad(10.0)  # from where on nearness to a joint limit is charged
NEAR_SINGULARITY = 0.2  # as in `singularity_margins`; for the wrist 11.5 degrees


class PushAway:
    """Charges nodes for little clearance.

    Args:
        cell: The cell.
        weights: What they are charged.
    """

    def __init__(self, cell: WorkCell, weights: CostWeights) -> None:
        self._weights = weights
        self._wider = CollisionScene(cell.widened(weights.push_away))

    @property
    def queries(self) -> float:
        """What was asked, as of `CollisionScene`."""
        return self._wider.queries

    def charge(self, q: Array) -> Array:
        """Return what nodes are charged, q in [rad], shape (n, 6)."""
        if self._weights.push_away == 0.0 or self._weights.push_weight == 0.0:
            return np.zeros(len(q))
        return self._weights.push_weight * self._wider.collides(q)


def track_cost(
    problem: GrindingProblem, nodes: NodeMatrix, weights: CostWeights, inside: np.ndarray
) -> TrackCost:
    """Return the cost of every edge and node of a matrix.

    Only the nodes `inside` matter, shape (n_columns, n_rows); the others cost nothing.
    """
    robot = problem.cell.robot
    node_cost = np.zeros(inside.shape)
    q = nodes.q[inside]
    margin = np.minimum(q - robot.lower, robot.upper - q) / NEAR_LIMIT
    charge = weights.limit_weight * np.square(np.maximum(1.0 - margin, 0.0)).sum(axis=-1)
    near = singularity_margins(robot.arm, q) / NEAR_SINGULARITY
    charge += weights.singularity_weight * np.square(np.maximum(1.0 - near, 0.0)).sum(axis=-1)
    if weights.push_away > 0.0 and weights.push_weight > 0.0:
        charge += PushAway(problem.cell, weights).charge(q)
    node_cost[inside] = charge
    arc_step = np.abs(np.diff(problem.points.arc_length))
    return TrackCost(
        joint_weights=weights.joint_weights,
        contact_weight=weights.contact_weight,
        time_weight=weights.time_weight,
        edge_seconds=np.where(problem.off_wheel, 0.0, arc_step / problem.process.feed),
        max_speed=robot.max_speed,
        contact_speed=problem.process.contact_speed,
        node_cost=node_cost,
    )
