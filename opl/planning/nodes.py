"""The node matrix: every configuration that can grind each cutter point.

A column is a cutter point, a row a contact position: a ladder graph whose rungs are the columns.
Each IK branch has its own matrices, because a track never changes it on the wheel (a change passes
a singularity); from pass to pass it may. Joints that turn more than once give a configuration
several counts of full turns; where the angles of an IK branch leave a gap that no edge could cross,
each count is a matrix of its own, elsewhere the counts are more rows of one matrix. Where nearly
every joint turns twice, that would be hundreds of matrices that make the same motions: then the one
in the middle of the limits stands for all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from opl.cell.full_turns import full_turns
from opl.cell.inverse_kinematics import N_IK_BRANCHES, inverse_kinematics
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.turned import Configurations, Turned, blocks_of, unroll


@dataclass(frozen=True)
class NodeMatrix:
    """The nodes of one IK branch in each pass, or of one count of full turns in it.

    Attributes:
        ik_branch: Slot of the inverse kinematics of each column, 0 to 7, shape (n_columns,).
        configurations: Joint positions of the nodes.
        contact_position: t of each node, shape (n_columns, n_rows).
        position_index: Which contact position of its column each row stands for, shape (n_rows,).
    """

    ik_branch: np.ndarray
    configurations: Configurations
    contact_position: Array
    position_index: np.ndarray

    @property
    def exists(self) -> np.ndarray:
        """Which nodes there are, shape (n_columns, n_rows)."""
        return self.configurations.exists

    @property
    def q(self) -> Array:
        """All configurations in [rad], NaN where there is no node, shape (n_columns, n_rows, 6).

        They may have to be made: for a few there is `at`.
        """
        return self.configurations.whole()

    def at(self, columns: np.ndarray | int, rows: np.ndarray | int) -> Array:
        """Return the configurations of some nodes in [rad], shape (..., 6)."""
        return self.configurations.at(columns, rows)

    def along(self, rows: np.ndarray) -> Array:
        """Return the configurations of a track in [rad], its row in each column given."""
        return self.at(np.arange(len(rows)), rows)

    def t_along(self, rows: np.ndarray) -> Array:
        """Return the contact positions of a track, its row in each column given."""
        return np.asarray(self.contact_position[np.arange(len(rows)), rows])

    def range_sum(self, rows: np.ndarray) -> float:
        """Return the joint range sum of a track at its nodes in [rad]."""
        return float(np.ptp(self.along(rows), axis=0).sum())


@dataclass(frozen=True)
class NodeField:
    """All nodes: the contact positions, what reaches them, and the matrices.

    Attributes:
        contact_positions: The values of t, shape (M,).
        reached: At how many of them each IK branch reaches each cutter point, limits not regarded,
            shape (n_columns, 8); without columns where nobody needs to know.
        angles: The IK branches of which there are matrices, as principal angles in [rad], NaN out
            of reach, shape (n_columns, M, 6).
        matrices: The matrices that have a node within the limits, in slot order.
    """

    contact_positions: Array
    reached: np.ndarray
    angles: Mapping[int, Array]
    matrices: tuple[NodeMatrix, ...]


# [rad] a gap in the angles of a joint that is wider than this is crossed by no edge of a track
SEAM_GAP = np.deg2rad(45.0)
# three turns each of two wrist axes
MOST_SHEETS = 9


def build_nodes(cell: WorkCell, points: CutterPoints, contact_positions: Array) -> NodeField:
    """Solve the inverse kinematics of every cutter point at every contact position."""
    shape = len(points), 6, len(contact_positions)
    by_joint = [np.empty(shape) for _ in range(N_IK_BRANCHES)]
    for block in blocks_of(shape[0], shape[2]):
        frames = points.Ts_workpiece_cutter[block, None]
        q = inverse_solutions(cell, frames, contact_positions)
        for ik_branch, angles in enumerate(by_joint):
            angles[block] = np.moveaxis(q[:, :, ik_branch], 1, 2)
    reached = np.stack([(~np.isnan(angles[:, 0])).sum(axis=1) for angles in by_joint], axis=1)
    matrices: list[NodeMatrix] = []
    kept = {}
    for ik_branch in np.flatnonzero(reached.any(axis=0)).tolist():
        found = _matrices(cell, by_joint[ik_branch], contact_positions, ik_branch)
        if found:
            matrices += found
            kept[ik_branch] = np.moveaxis(by_joint[ik_branch], 1, 2)
    return NodeField(contact_positions, reached, kept, tuple(matrices))


def _matrices(
    cell: WorkCell, by_joint: Array, contact_positions: Array, ik_branch: int
) -> list[NodeMatrix]:
    """Return the matrices of a branch that have a node within the limits.

    Args:
        cell: The cell.
        by_joint: Principal angles of the branch in [rad], shape (N, 6, M).
        contact_positions: Shape (M,).
        ik_branch: The branch.
    """
    q = np.moveaxis(by_joint, 1, 2)
    start, sheets, copies = _unrolled(q, cell.robot.lower, cell.robot.upper)
    all_turns = sheets[:, None] + copies
    all_within = [np.empty((len(q), len(copies), q.shape[1]), dtype=bool) for _ in sheets]
    for block in blocks_of(len(q), q.shape[1] * len(copies)):
        lifted = q[block].copy()
        unroll(lifted, start)
        for turns, within in zip(all_turns, all_within, strict=True):
            within[block] = cell.within_limits(lifted[:, None] + turns[:, None])
    found = []
    for turns, within in zip(all_turns, all_within, strict=True):
        copy, position_index = np.nonzero(within.any(axis=0))
        if not len(position_index):
            continue
        exists = np.ascontiguousarray(within[:, copy, position_index])
        turned = Turned(by_joint, start, turns[copy], position_index, exists)
        t = np.broadcast_to(contact_positions[position_index], exists.shape)
        branch = np.full(len(q), ik_branch)
        found.append(NodeMatrix(branch, turned, t, position_index))
    return found


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


def _unrolled(q: Array, lower: Array, upper: Array) -> tuple[Array, Array, Array]:
    """Find where the angles of one IK branch leave a gap, and the full turns that are added then.

    `q` are principal angles in [rad], NaN where there are none, shape (N, M, 6); limits are in
    [rad], shape (6,).

    Returns:
        Where the angles of each joint begin after its gap, NaN without one, shape (6,): from there
        they are continuous over the whole field; the full turns that make sheets of them, shape
        (n_sheets, 6); the full turns by which the nodes of one sheet are repeated, shape
        (n_copies, 6); all in [rad].
    """
    starts = np.full(6, np.nan)
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
        starts[joint] = start
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
    return starts, _products(sheet_turns), _products(copy_turns)


def _products(values: list[Array]) -> Array:
    """Return every combination of one value per joint, shape (k, 6)."""
    return np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, len(values))
