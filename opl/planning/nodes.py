"""The node matrix: every posture that can grind each cutter point.

A column is a cutter point, a row is a contact position together with a full turn of the wrist axes:
a ladder graph whose rungs are the columns. Each branch of the inverse kinematics has its own
matrix, because a track never changes branch (a change passes a singularity).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.cell.inverse import inverse, turns
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints


@dataclass(frozen=True)
class NodeMatrix:
    """The nodes of one branch.

    Attributes:
        branch: Slot of the inverse kinematics, 0 to 7.
        q: Joint positions in [rad], NaN where there is no posture within the limits, shape
            (n_columns, n_rows, 6).
        contact_position: t of each row, shape (n_rows,).
        position_index: Which of the contact positions each row stands for, shape (n_rows,).
    """

    branch: int
    q: Array
    contact_position: Array
    position_index: np.ndarray

    @cached_property
    def exists(self) -> np.ndarray:
        """Which nodes there are, shape (n_columns, n_rows)."""
        return ~np.isnan(self.q[..., 0])


@dataclass(frozen=True)
class NodeField:
    """What every branch shares, and the branches.

    Attributes:
        contact_positions: The values of t, shape (M,).
        q: All inverse solutions as principal angles in [rad], NaN out of reach, shape
            (n_columns, M, 8, 6). Kept to tell reach from limits when nothing is left.
        branches: One matrix per branch that has a node within the limits, in slot order.
    """

    contact_positions: Array
    q: Array
    branches: tuple[NodeMatrix, ...]


def build_nodes(cell: WorkCell, points: CutterPoints, contact_positions: Array) -> NodeField:
    """Solve the inverse kinematics of every cutter point at every contact position.

    Args:
        cell: The cell.
        points: N cutter points.
        contact_positions: M values of t.
    """
    robot = cell.robot
    Ts_base_flange = cell.Ts_base_flange(
        contact_positions[None, :], points.Ts_workpiece_cutter[:, None]
    )
    q = inverse(robot.arm, Ts_base_flange)  # (N, M, 8, 6)
    branches = []
    for branch in range(q.shape[2]):
        columns, rows = [], []
        for turn in turns(robot.lower, robot.upper):
            turned = q[:, :, branch] + turn
            within = ((turned >= robot.lower) & (turned <= robot.upper)).all(axis=-1)
            turned = np.where(within[..., None], turned, np.nan)
            used = np.flatnonzero(within.any(axis=0))
            columns.append(turned[:, used])
            rows.append(used)
        position_index = np.concatenate(rows)
        if len(position_index):
            q_branch = np.ascontiguousarray(np.concatenate(columns, axis=1))
            t = contact_positions[position_index]
            branches.append(NodeMatrix(branch, q_branch, t, position_index))
    return NodeField(contact_positions, q, tuple(branches))
