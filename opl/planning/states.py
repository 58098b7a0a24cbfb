"""What each node of a branch is: free, or what rules it out."""

from __future__ import annotations

from enum import Enum

import numpy as np

from opl.cell.workcell import PART, WHEEL
from opl.planning.problem import GrindingProblem


class NodeState(str, Enum):
    """The states, in the order of their codes 0, 1, ..."""

    FREE = "free"
    REACH = "out of reach"
    LIMITS = "beyond joint limits"
    WHEEL = f"{PART} cuts into {WHEEL}"
    COLLISION = "robot or fixture collides"


def node_states(problem: GrindingProblem, branch: int) -> np.ndarray:
    """Return the code of every cutter point and contact position, shape (N, M) of uint8.

    Args:
        problem: The nodes and what they are checked against.
        branch: Slot of the inverse kinematics.
    """
    codes = list(NodeState)
    shape = problem.wheel_clearance.shape
    states = np.full(shape, codes.index(NodeState.LIMITS), dtype=np.uint8)
    for nodes in problem.field.branches:
        if nodes.branch != branch:
            continue
        free = problem.free_nodes(nodes)
        # the turn of the wrist axes does not matter for collisions: one row for each t is asked
        for position in range(shape[1]):
            rows = np.flatnonzero(nodes.position_index == position)
            for row in rows:
                column = nodes.exists[:, row]
                states[column, position] = codes.index(NodeState.FREE)
            asked = np.full(len(states), -1)
            for row in rows:
                asked[free[:, row]] = row
            columns = np.flatnonzero(asked >= 0)
            hit = problem.scene.collides(nodes.q[columns, asked[columns]])
            states[columns[hit], position] = codes.index(NodeState.COLLISION)
    states[problem.wheel_clearance < -problem.cell.planned_penetration] = codes.index(
        NodeState.WHEEL
    )
    states[np.isnan(problem.field.q[:, :, branch, 0])] = codes.index(NodeState.REACH)
    return states
