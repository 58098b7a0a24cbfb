"""The chosen track with its intermediate nodes, and the figures it is judged by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.cell.workcell import WorkCell
from opl.field.nodes import NodeMatrix
from opl.geometry.frames import Array, interpolate, transform
from opl.geometry.toolpath import CutterPoints
from opl.search.ladder import middle_count


@dataclass(frozen=True)
class GrindingPath:
    """Postures on the wheel, in order, joined by linear joint interpolation within a pass.

    Attributes:
        branch: Slot of the inverse kinematics that all postures share.
        q: Joint positions in [rad], shape (n, 6).
        contact_position: t of each posture, shape (n,).
        cutter_point: Index of the cutter point, fractional at intermediate nodes, shape (n,).
        pass_index: The pass of each posture, shape (n,).
    """

    branch: int
    q: Array
    contact_position: Array
    cutter_point: Array
    pass_index: np.ndarray

    @property
    def n_intermediate(self) -> int:
        """Number of postures between cutter points."""
        return int(np.count_nonzero(self.cutter_point % 1.0))

    @property
    def joint_ranges(self) -> Array:
        """Largest minus smallest value of each joint in [rad], shape (6,)."""
        return np.ptp(self.q, axis=0)

    @property
    def joint_range_sum(self) -> float:
        """Sum of the joint ranges in [rad]: what the search keeps small (equation 14)."""
        return float(self.joint_ranges.sum())

    @property
    def joint_travel(self) -> float:
        """Sum over all steps and joints of the absolute change in [rad], on the wheel only."""
        return float(np.abs(np.diff(self.q, axis=0)[self._on_wheel]).sum())

    @property
    def contact_travel(self) -> float:
        """Sum over all steps of the absolute change of t in belt units, on the wheel only."""
        return float(np.abs(np.diff(self.contact_position)[self._on_wheel]).sum())

    @property
    def _on_wheel(self) -> np.ndarray:
        """Which steps stay on the wheel, shape (n - 1,)."""
        return np.diff(self.pass_index) == 0


class BrokenStepError(Exception):
    """A step between two nodes cannot be made on the wheel.

    Args:
        column: The cutter point the step starts from.
        cause: ``reach``, ``limits of`` those by name, or ``continuity``.
    """

    def __init__(self, column: int, cause: str) -> None:
        super().__init__(f"step from cutter point {column}: {cause}")
        self.column = column
        self.cause = cause


@dataclass(frozen=True)
class Interpolation:
    """How the path between nodes is filled in.

    Attributes:
        max_contact_step: Largest difference of t between adjacent postures, delta T.
        max_contact_error: Largest distance, half-way between two postures, of the ground point from
            where it should touch the wheel, in [m]. More postures are put in to keep it.
        max_joint_step: Largest change of a joint between adjacent postures in [rad].
    """

    max_contact_step: float
    max_contact_error: float
    max_joint_step: float


MOST_HALVINGS = 6  # of a step between intermediate nodes; 64 times denser always was enough


def fill_in(
    cell: WorkCell, points: CutterPoints, nodes: NodeMatrix, rows: np.ndarray, rule: Interpolation
) -> GrindingPath:
    """Put intermediate nodes between the nodes of a track.

    Contact position, origin, axis z and axis x of the cutter frame are interpolated linearly, and
    the inverse kinematics is solved on the same branch, nearest to the joint interpolation.

    Args:
        cell: The cell.
        points: N cutter points, the columns.
        nodes: The branch.
        rows: The row chosen in each column, shape (N,).
        rule: How dense.

    Raises:
        BrokenStepError: If a step leaves the reach, the limits or the branch on its way.
    """
    columns = np.arange(len(rows))
    q_node, t_node = nodes.q[columns, rows], nodes.contact_position[rows]
    on_wheel = np.diff(points.pass_index) == 0
    counts = [
        middle_count(step, rule.max_contact_step) if grinding else 0
        for step, grinding in zip(np.diff(t_node), on_wheel, strict=True)
    ]
    places = [k + np.arange(n + 1) / (n + 1) for k, n in enumerate(counts)]
    place = np.concatenate([*places, columns[-1:].astype(float)])
    for _ in range(MOST_HALVINGS):
        q = _solve(cell, points, nodes, rows, q_node, t_node, place)
        _refuse_jumps(q, place, points, rule.max_joint_step)
        error = _contact_error_between(cell, points, t_node, place, q)
        coarse = np.flatnonzero(error > rule.max_contact_error)
        if not len(coarse):
            t = np.interp(place, columns, t_node)
            pass_index = points.pass_index[place.astype(int)]
            return GrindingPath(nodes.branch, q, t, place, pass_index)
        halves = (place[coarse] + place[coarse + 1]) / 2.0
        place = np.insert(place, coarse + 1, halves)
    raise BrokenStepError(int(place[coarse[0]]), "continuity")


def cutter_frames(points: CutterPoints, place: Array) -> Array:
    """Return cutter frames at fractional cutter points, shape (n, 4, 4)."""
    before = np.minimum(place.astype(int), len(points) - 1)
    after = np.minimum(before + 1, len(points) - 1)
    Ts = points.Ts_workpiece_cutter
    return interpolate(Ts[before], Ts[after], place - before)


def _solve(
    cell: WorkCell,
    points: CutterPoints,
    nodes: NodeMatrix,
    rows: np.ndarray,
    q_node: Array,
    t_node: Array,
    place: Array,
) -> Array:
    """Return the posture at each place, shape (n, 6); those of the nodes are kept to the bit."""
    columns = np.arange(len(rows))
    t = np.interp(place, columns, t_node)
    q_guess = np.stack([np.interp(place, columns, joint) for joint in q_node.T], axis=-1)
    Ts_base_flange = cell.Ts_base_flange(t, cutter_frames(points, place))
    q = inverse_kinematics(cell.robot.arm, Ts_base_flange, q_guess)[:, nodes.branch]
    q = nearest_turn(q, q_guess)
    at_node = place == np.floor(place)
    q[at_node] = q_node[place[at_node].astype(int)]
    lost = np.isnan(q).any(axis=1)
    if lost.any():
        raise BrokenStepError(int(place[lost][0]), "reach")
    beyond = ~cell.within_limits(q)
    if beyond.any():
        names = " ".join(cell.broken_limits(q))
        raise BrokenStepError(int(place[beyond][0]), f"limits of {names}")
    return q


def _refuse_jumps(q: Array, place: Array, points: CutterPoints, max_joint_step: float) -> None:
    on_wheel = np.diff(points.pass_index[place.astype(int)]) == 0
    jumps = (np.abs(np.diff(q, axis=0)).max(axis=1) > max_joint_step) & on_wheel
    if jumps.any():
        raise BrokenStepError(int(place[:-1][jumps][0]), "continuity")


def _contact_error_between(
    cell: WorkCell, points: CutterPoints, t_node: Array, place: Array, q: Array
) -> Array:
    """Return how far the ground point is from its place on the wheel half-way to the next posture.

    Args:
        cell: The cell.
        points: The cutter points.
        t_node: Contact position at each cutter point, shape (N,).
        place: Fractional cutter point of each posture, shape (n,).
        q: The postures in [rad], shape (n, 6).

    Returns:
        Distances in [m], shape (n - 1,); 0 where the step leaves the wheel.
    """
    middle = (place[:-1] + place[1:]) / 2.0
    T_base_flange = forward_kinematics(cell.robot, (q[:-1] + q[1:]) / 2.0)
    p_workpiece = cutter_frames(points, middle)[:, :3, 3]
    p_base = transform(T_base_flange @ cell.T_flange_workpiece, p_workpiece)
    t = np.interp(middle, np.arange(len(t_node)), t_node)
    error = np.linalg.norm(p_base - cell.wheel.T_base_contact(t)[:, :3, 3], axis=1)
    on_wheel = np.diff(points.pass_index[place.astype(int)]) == 0
    return np.where(on_wheel, error, 0.0)
