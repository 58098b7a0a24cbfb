"""Every node of the passes, each on one IK branch: what it is, what it hits, how it is reached.

For pictures: the search looks only at what it proposes.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from opl.cell.collision import BodyPair
from opl.cell.inverse_kinematics import N_IK_BRANCHES, singularity_margins
from opl.cell.nearest import Nearest, nearest_pairs
from opl.cell.robot import Robot
from opl.cell.workcell import PART, WHEEL
from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem
from opl.planning.turned import blocks_of

# clearances are measured at about so many cutter points and contact positions, evenly
_COLUMNS, _POSITIONS = 40, 24
_TURN = 2.0 * np.pi


class NodeState(str, Enum):
    """The states, in the order of their codes 0, 1, ..."""

    FREE = "free"
    REACH = "out of reach"
    LIMITS = "beyond joint limits"
    WHEEL = f"{PART} cuts into {WHEEL}"
    ROBOT = "robot or what it holds collides"
    SCENE = "collides with what stands around"


CODES = {state: code for code, state in enumerate(NodeState)}


@dataclass(frozen=True, eq=False)
class NodeSurvey:
    """What each of N x M nodes is, of one IK branch at each cutter point.

    Attributes:
        states: Code of each node, shape (N, M) of uint8.
        q: The configuration of each in [rad], within the limits where there is such a one; NaN out
            of reach; shape (N, M, 6).
        hit: Which pair collides first, -1 where none does, shape (N, M).
        pairs: The names of these pairs.
        singularity: The least of `singularity_margins` at each, NaN out of reach, shape (N, M).
        columns: The cutter points at which clearance was measured.
        positions: And the contact positions, by their indices.
        clearance: At free nodes of both, cutter points first.
        measured: Which nodes of both these are, shape (columns, positions).
    """

    states: np.ndarray
    q: Array
    hit: np.ndarray
    pairs: tuple[BodyPair, ...]
    singularity: Array
    columns: np.ndarray
    positions: np.ndarray
    clearance: Nearest
    measured: np.ndarray


def survey_nodes(problem: GrindingProblem, ik_branch: np.ndarray | int, near: Array) -> NodeSurvey:
    """Look at every node of an IK branch, of that at each cutter point, shape (N,), or of one.

    Of configurations that differ by full turns, the one is taken that is nearest to `near` in
    [rad], shape (N, 6) or (6,), joint by joint.
    """
    robot, collision = problem.cell.robot, problem.scene.collision
    branches = np.broadcast_to(ik_branch, len(problem.points))
    q = _turned(_angles(problem, branches), near, robot)
    reached = ~np.isnan(q[..., 0])
    states: np.ndarray = np.full(problem.cuts.shape, CODES[NodeState.LIMITS], dtype=np.uint8)
    for nodes in problem.field.matrices:
        column, row = np.nonzero(nodes.exists & (nodes.ik_branch == branches)[:, None])
        states[column, nodes.position_index[row]] = CODES[NodeState.FREE]
    hit, pairs = np.full(states.shape, -1), dict[BodyPair, int]()
    states[problem.cuts] = CODES[NodeState.WHEEL]
    states[~reached] = CODES[NodeState.REACH]
    # full turns do not matter for collisions: one configuration of each node is checked
    column, position = np.nonzero(states == CODES[NodeState.FREE])
    struck = collision.collides(q[column, position])
    around = {body.name for body in problem.cell.obstacles}
    for i, j in zip(column[struck], position[struck], strict=True):
        first = collision.colliding_pairs(q[i, j])[0]
        state = NodeState.ROBOT if around.isdisjoint(first) else NodeState.SCENE
        states[i, j], hit[i, j] = CODES[state], pairs.setdefault(first, len(pairs))
    n_columns, n_positions = problem.cuts.shape
    columns, positions = _some(n_columns, _COLUMNS), _some(n_positions, _POSITIONS)
    grid = np.ix_(columns, positions)
    measured = states[grid] == CODES[NodeState.FREE]
    return NodeSurvey(
        states,
        q,
        hit,
        tuple(pairs),
        singularity_margins(robot.arm, q).min(axis=-1),
        columns,
        positions,
        nearest_pairs(collision, q[grid][measured]),
        measured,
    )


def widest_branch(problem: GrindingProblem) -> int:
    """Return the IK branch with free nodes, collisions of the robot aside, at most cutter points.

    Of those the one with most free nodes; without any, the one that reaches most nodes.
    """
    free = np.zeros((N_IK_BRANCHES, *problem.cuts.shape), dtype=bool)
    for nodes in problem.field.matrices:
        column, row = np.nonzero(problem.free_nodes(nodes))
        free[nodes.ik_branch[column], column, nodes.position_index[row]] = True
    reached = problem.field.reached.sum(axis=0)
    ranks = [
        (int(free[k].any(axis=1).sum()), int(free[k].sum()), int(reached[k]))
        for k in range(N_IK_BRANCHES)
    ]
    return ranks.index(max(ranks))


def _angles(problem: GrindingProblem, ik_branch: np.ndarray) -> Array:
    """Return principal angles of the IK branch at each cutter point, shape (N, M, 6)."""
    angles = np.empty((*problem.cuts.shape, 6))
    for branch in np.unique(ik_branch).tolist():
        own = np.flatnonzero(ik_branch == branch)
        angles[own] = problem.angles(branch, own)
    return angles


def _turned(q: Array, near: Array, robot: Robot) -> Array:
    """Return angles (N, M, 6) full turns away, near to others but within the joints' ranges.

    Angles that no full turn brings within the range of their joint stay near.
    """
    turned = np.empty(q.shape)
    near = np.broadcast_to(near, (len(q), 6))[:, None]
    for block in blocks_of(*q.shape[:2]):
        own = q[block]
        wanted = np.round((near[block] - own) / _TURN)
        least, most = np.ceil((robot.lower - own) / _TURN), np.floor((robot.upper - own) / _TURN)
        turns = np.where(least <= most, np.clip(wanted, least, most), wanted)
        turned[block] = own + _TURN * turns
    return turned


def _some(count: int, most: int) -> np.ndarray:
    """Return so many of ``count`` indices at the most, evenly from the first to the last."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int))
