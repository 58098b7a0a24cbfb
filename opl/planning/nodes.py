"""The node matrix: every configuration that can grind each cutter point.

A column is a cutter point, a row a contact position: a ladder graph whose rungs are the columns.
Each IK branch has its own matrices, because a track never changes it (a change passes a
singularity). Joints that turn more than once give a configuration several counts of
full turns; where the angles of an IK branch leave a gap that no edge could cross, each count is a
matrix of its own, elsewhere the counts are more rows of one matrix. Where nearly every joint turns
twice, that would be hundreds of matrices that make the same motions: then the one in the middle of
the limits stands for all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.cell.full_turns import full_turns
from opl.cell.inverse_kinematics import N_IK_BRANCHES, inverse_kinematics
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints


@dataclass(frozen=True)
class NodeMatrix:
    """The nodes of one IK branch, or of one count of full turns in it.

    Attributes:
        ik_branch: Slot of the inverse kinematics, 0 to 7.
        q: Joint positions in [rad], NaN where there is no configuration within the limits, shape
            (n_columns, n_rows, 6).
        contact_position: t of each node, shape (n_columns, n_rows).
        position_index: Which contact position of its column each row stands for, shape (n_rows,).
    """

    ik_branch: int
    q: Array
    contact_position: Array
    position_index: np.ndarray

    @cached_property
    def exists(self) -> np.ndarray:
        """Which nodes there are, shape (n_columns, n_rows)."""
        return np.ascontiguousarray(~np.isnan(self.q[..., 0]))

    def along(self, rows: np.ndarray) -> Array:
        """Return the configurations of a track in [rad], its row in each column given."""
        return np.asarray(self.q[np.arange(len(rows)), rows])

    def t_along(self, rows: np.ndarray) -> Array:
        """Return the contact positions of a track, its row in each column given."""
        return np.asarray(self.contact_position[np.arange(len(rows)), rows])

    def range_sum(self, rows: np.ndarray) -> float:
        """Return the joint range sum of a track at its nodes in [rad]."""
        return float(np.ptp(self.along(rows), axis=0).sum())


@dataclass(frozen=True)
class NodeField:
    """All nodes: the contact positions, the inverse solutions and the matrices made of them.

    Attributes:
        contact_positions: The values of t, shape (M,).
        q: All inverse solutions as principal angles in [rad], NaN out of reach, shape
            (n_columns, M, 8, 6). Kept to tell reach from limits when nothing is left; without
            columns where nobody needs to know.
        matrices: The matrices that have a node within the limits, in slot order.
    """

    contact_positions: Array
    q: Array
    matrices: tuple[NodeMatrix, ...]


# [rad] a gap in the angles of a joint that is wider than this is crossed by no edge of a track
SEAM_GAP = np.deg2rad(45.0)
# three turns each of two wrist axes
MOST_SHEETS = 9
AT_ONCE = 20_000  # nodes: what is worked on at a time stays small beside what is kept


def build_nodes(cell: WorkCell, points: CutterPoints, contact_positions: Array) -> NodeField:
    """Solve the inverse kinematics of every cutter point at every contact position."""
    robot = cell.robot
    frames = points.Ts_workpiece_cutter[:, None]
    q = inverse_solutions(cell, frames, contact_positions)  # (N, M, 8, 6)
    matrices = []
    for ik_branch in range(q.shape[2]):
        if np.isnan(q[:, :, ik_branch, 0]).all():
            continue
        lifted, sheets, copies = _lift(q[:, :, ik_branch], robot.lower, robot.upper)
        for turns in sheets[:, None] + copies:
            nodes = _sheet(cell, lifted, turns, contact_positions, ik_branch)
            if nodes is not None:
                matrices.append(nodes)
    return NodeField(contact_positions, q, tuple(matrices))


def _sheet(
    cell: WorkCell, lifted: Array, turns: Array, contact_positions: Array, ik_branch: int
) -> NodeMatrix | None:
    """Return the nodes of one sheet, None if there are none within the limits.

    Args:
        cell: The cell.
        lifted: Angles of the branch in [rad], shape (N, M, 6).
        turns: Full turns of the copies of the nodes in [rad], shape (n_copies, 6).
        contact_positions: Shape (M,).
        ik_branch: The branch.
    """
    blocks = blocks_of(lifted.shape[0], lifted.shape[1] * len(turns))
    within = np.concatenate(
        [cell.within_limits(lifted[block, None] + turns[:, None]) for block in blocks]
    )  # (N, copies, M)
    copy, position_index = np.nonzero(within.any(axis=0))
    if not len(position_index):
        return None
    # as the searches read them, who need no copy then
    by_joint = np.empty((len(lifted), 6, len(position_index)))
    for block in blocks:
        q = lifted[block][:, position_index] + turns[copy]
        q[~within[block][:, copy, position_index]] = np.nan
        by_joint[block] = np.moveaxis(q, 1, 2)
    t = np.broadcast_to(contact_positions[position_index], (len(lifted), len(position_index)))
    return NodeMatrix(ik_branch, np.moveaxis(by_joint, 1, 2), t, position_index)


def blocks_of(n_columns: int, n_rows: int) -> list[slice]:
    """Return slices of columns with about as many nodes as are worked on at once."""
    size = max(AT_ONCE // max(n_rows, 1), 1)
    return [slice(first, first + size) for first in range(0, n_columns, size)]


def inverse_solutions(
    cell: WorkCell, Ts_workpiece_cutter: Array, contact_positions: Array
) -> Array:
    """Return every inverse solution in [rad], NaN where there is none, shape (N, M, 8, 6).

    Cutter frames have shape (N, 1, 4, 4), the contact positions at which each is ground (M,) or
    (N, M).
    """
    t = np.asarray(contact_positions, dtype=float)
    q = np.empty((len(Ts_workpiece_cutter), t.shape[-1], N_IK_BRANCHES, 6))
    for block in blocks_of(*q.shape[:2]):
        Ts = cell.Ts_base_flange(t if t.ndim == 1 else t[block], Ts_workpiece_cutter[block])
        q[block] = inverse_kinematics(cell.robot.arm, Ts)
    return q


def _lift(q: Array, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
    """Unroll the angles of one IK branch where they leave a gap.

    `q` are principal angles in [rad], NaN where there are none, shape (N, M, 6); limits are in
    [rad], shape (6,).

    Returns:
        Angles that are continuous over the whole field wherever there is a gap, shape (N, M, 6);
        the full turns that make sheets of them, shape (n_sheets, 6); the full turns by which the
        nodes of one sheet are repeated, shape (n_copies, 6); both in [rad].
    """
    lifted = q.copy()
    sheet_turns, copy_turns, central = ([np.zeros(1)] * 6 for _ in range(3))
    all_turns = full_turns(lower, upper)
    for joint in range(6):
        counts = np.unique(all_turns[:, joint])
        if len(counts) == 1:
            continue
        angles = np.sort(q[..., joint], axis=None)
        angles = angles[~np.isnan(angles)]
        gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
        widest = int(np.argmax(gaps))
        if gaps[widest] <= SEAM_GAP:
            copy_turns[joint] = counts
            continue
        start = angles[(widest + 1) % len(angles)]
        lifted[..., joint] = start + np.remainder(q[..., joint] - start, 2.0 * np.pi)
        end = start + 2.0 * np.pi - gaps[widest]
        first = np.ceil((lower[joint] - end) / (2.0 * np.pi))
        last = np.floor((upper[joint] - start) / (2.0 * np.pi))
        counts = 2.0 * np.pi * np.arange(first, last + 1)
        sheet_turns[joint] = counts
        whole = counts[(start + counts >= lower[joint]) & (end + counts <= upper[joint])]
        middle = (lower[joint] + upper[joint] - start - end) / 2.0
        central[joint] = whole[[np.argmin(np.abs(whole - middle))]] if len(whole) else counts
    if np.prod([len(counts) for counts in sheet_turns]) > MOST_SHEETS:
        sheet_turns = central
    return lifted, _products(sheet_turns), _products(copy_turns)


def _products(values: list[Array]) -> Array:
    """Return every combination of one value per joint, shape (k, 6)."""
    return np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, len(values))
