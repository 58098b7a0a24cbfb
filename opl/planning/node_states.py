"""What each node of an IK branch is: free, or what rules it out."""

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


def node_states(problem: GrindingProblem, ik_branch: int) -> np.ndarray:
    """Return the code of every cutter point and contact position, shape (N, M) of uint8."""
    code = {state: number for number, state in enumerate(NodeState)}
    states = np.full(problem.cuts.shape, code[NodeState.LIMITS], dtype=np.uint8)
    for nodes in problem.field.matrices:
        if nodes.ik_branch != ik_branch:
            continue
        free = problem.free_nodes(nodes)
        # full turns of the wrist do not matter for collisions: one row for each t is checked
        for position in np.unique(nodes.position_index):
            rows = np.flatnonzero(nodes.position_index == position)
            states[nodes.exists[:, rows].any(axis=1), position] = code[NodeState.FREE]
            columns = np.flatnonzero(free[:, rows].any(axis=1))
            last = rows[-1 - free[columns][:, rows[::-1]].argmax(axis=1)]
            hit = problem.scene.collision.collides(nodes.q[columns, last])
            states[columns[hit], position] = code[NodeState.COLLISION]
    states[problem.cuts] = code[NodeState.WHEEL]
    states[np.isnan(problem.field.q[:, :, ik_branch, 0])] = code[NodeState.REACH]
    return states
