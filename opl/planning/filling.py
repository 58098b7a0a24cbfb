"""Filling in a track: intermediate nodes between its nodes, until the contact error is small."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.robot import forward_kinematics
from opl.cell.workcell import WorkCell
from opl.geometry.frames import Array, transform
from opl.geometry.toolpath import CutterPoints
from opl.motion.path import GrindingPath
from opl.planning.nodes import NodeMatrix
from opl.planning.settings import Interpolation
from opl.search.ladder import middle_count


class BrokenEdgesError(Exception):
    """Edges between nodes of a track cannot be made on the wheel.

    Args:
        causes: ``reach``, ``limits of`` those by name, or ``continuity``, by the cutter point that
            an edge starts from: of all that are broken for the first of these that any is.
    """

    def __init__(self, causes: Mapping[int, str]) -> None:
        super().__init__(
            ", ".join(f"edge from cutter point {column}: {why}" for column, why in causes.items())
        )
        self.causes = causes


MOST_HALVINGS = 6  # of a move between intermediate nodes
SAME_PLACE = 1e-6  # cutter points: places this close are one


def fill_in(
    cell: WorkCell, points: CutterPoints, nodes: NodeMatrix, rows: np.ndarray, rule: Interpolation
) -> GrindingPath:
    """Put intermediate nodes between the nodes of a track.

    Contact position, origin, axis z and axis x of the cutter frame are interpolated linearly, and
    the inverse kinematics is solved on the same IK branch, nearest to the joint interpolation. Near
    a singularity joints turn far from place to place: there as well nodes are put in, until no step
    is larger than that from node to node may be. Where the contact passes an end of the flat is one
    in any case.

    `rows` are those of the track in each column, one for each cutter point, shape (N,).

    Raises:
        BrokenEdgesError: If edges leave reach, limits or IK branch between their ends.
    """
    columns = np.arange(len(rows))
    q_node, t_node = nodes.along(rows), nodes.t_along(rows)
    same_pass = np.diff(points.pass_index) == 0
    counts = [
        middle_count(change, rule.max_contact_step) if joined else 0
        for change, joined in zip(np.diff(t_node), same_pass, strict=True)
    ]
    places = [k + np.arange(n + 1) / (n + 1) for k, n in enumerate(counts)]
    place = np.concatenate([*places, columns[-1:].astype(float)])
    place = np.sort(np.append(place, _at_flat_end(cell, t_node, same_pass, place)))
    for _ in range(MOST_HALVINGS):
        t = np.interp(place, columns, t_node)
        ik_branch = nodes.ik_branch[place.astype(int)]
        q = _solve(cell, points, ik_branch, q_node, t, place)
        pass_index = points.pass_index[place.astype(int)]
        on_wheel = np.diff(pass_index) == 0
        jumps = on_wheel & (np.abs(np.diff(q, axis=0)).max(axis=1) > rule.max_joint_step)
        error = _contact_error_between(cell, points, t_node, place, q, on_wheel)
        coarse = np.flatnonzero((error > rule.max_contact_error) | jumps)
        if not len(coarse):
            first = np.unique(points.pass_index, return_index=True)[1]
            return GrindingPath(nodes.ik_branch[first], q, t, place, pass_index)
        halves = (place[coarse] + place[coarse + 1]) / 2.0
        place = np.insert(place, coarse + 1, halves)
    raise BrokenEdgesError(
        dict.fromkeys(np.unique(place[coarse].astype(int)).tolist(), "continuity")
    )


def _at_flat_end(cell: WorkCell, t_node: Array, same_pass: np.ndarray, place: Array) -> Array:
    """Return at which places a track passes an end of the wheel's flat, shape (k,).

    There the contact begins or ends to roll, and joints change their direction all at once: halving
    a move across such a place halves the contact error, of any other it leaves a quarter.

    Args:
        cell: The cell.
        t_node: Contact position of each node in belt units, shape (N,).
        same_pass: Whether a node and the next are of one pass, shape (N - 1,).
        place: Fractional cutter points that are known, ascending: none of them is returned.
    """
    ends = np.array([[-cell.wheel.flat_end], [cell.wheel.flat_end]])
    passed = same_pass & ((t_node[:-1] - ends) * (t_node[1:] - ends) < 0.0)
    which, before = np.nonzero(passed)
    share = (ends[which, 0] - t_node[before]) / (t_node[before + 1] - t_node[before])
    there = before + share
    after = np.searchsorted(place, there)
    apart = np.minimum(there - place[after - 1], place[after] - there)
    return np.asarray(there[apart > SAME_PLACE])


def _solve(
    cell: WorkCell,
    points: CutterPoints,
    ik_branch: np.ndarray,
    q_node: Array,
    t: Array,
    place: Array,
) -> Array:
    """Return the configuration at each place, (n, 6); those of the nodes are kept to the bit."""
    columns = np.arange(len(q_node))
    q_guess = np.stack([np.interp(place, columns, joint) for joint in q_node.T], axis=-1)
    Ts_base_flange = cell.Ts_base_flange(t, points.frames_at(place))
    q = inverse_kinematics(cell.robot.arm, Ts_base_flange, q_guess)[
        np.arange(len(place)), ik_branch
    ]
    q = nearest_turn(q, q_guess)
    at_node = place == np.floor(place)
    q[at_node] = q_node[place[at_node].astype(int)]
    lost, edge = np.isnan(q).any(axis=1), np.minimum(place.astype(int), len(q_node) - 2)
    if lost.any():
        raise BrokenEdgesError(dict.fromkeys(np.unique(edge[lost]).tolist(), "reach"))
    beyond = ~cell.within_limits(q)
    if beyond.any():
        raise BrokenEdgesError(
            {
                column: f"limits of {' '.join(cell.broken_limits(q[edge == column]))}"
                for column in np.unique(edge[beyond]).tolist()
            }
        )
    return q


def _contact_error_between(
    cell: WorkCell,
    points: CutterPoints,
    t_node: Array,
    place: Array,
    q: Array,
    on_wheel: np.ndarray,
) -> Array:
    """Return how far the ground point is from its place on the wheel in the middle of each move.

    Distances in [m], shape (n - 1,), 0 where the move is not ``on_wheel``: between passes there is
    no frame, as normals may be opposite; of n configurations at fractional cutter points, and the
    contact position at each of N cutter points.
    """
    middle = ((place[:-1] + place[1:]) / 2.0)[on_wheel]
    T_base_flange = forward_kinematics(cell.robot, ((q[:-1] + q[1:]) / 2.0)[on_wheel])
    p_workpiece = points.frames_at(middle)[:, :3, 3]
    p_base = transform(T_base_flange @ cell.T_flange_workpiece, p_workpiece)
    t = np.interp(middle, np.arange(len(t_node)), t_node)
    error = np.zeros(len(on_wheel))
    error[on_wheel] = np.linalg.norm(p_base - cell.wheel.T_base_contact(t)[:, :3, 3], axis=1)
    return error
