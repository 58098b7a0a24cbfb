"""More columns: places between two cutter points taken into the node matrix.

What a track does between two cutter points counts as much as what it does at them. A place between
them, taken in as a column, holds every track to a node there as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.workcell import WorkCell
from opl.field.layer import layer_at
from opl.field.nodes import NodeField, NodeMatrix
from opl.field.path import GrindingPath, cutter_frames
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion
from opl.planning.branch import Branch, branches_of
from opl.planning.problem import GrindingProblem


@dataclass(frozen=True)
class RefinedProblem:
    """A problem with columns between its cutter points.

    Attributes:
        problem: The problem, every column a cutter point of its own.
        places: Fractional cutter point, in the original numbering, of each column, shape (n,).
    """

    problem: GrindingProblem
    places: Array

    def original_path(self, path: GrindingPath) -> GrindingPath:
        """Return a path with its cutter points in the original numbering."""
        return replace(path, cutter_point=self._original_places(path.cutter_point))

    def original_motion(self, motion: Motion) -> Motion:
        """Return a motion with its cutter points in the original numbering."""
        return motion.renumbered(self._original_places(motion.cutter_point))

    def _original_places(self, columns: Array) -> Array:
        return np.interp(columns, np.arange(len(self.places)), self.places)


def refine(refined: RefinedProblem, places: Array) -> RefinedProblem:
    """Take in more columns.

    Args:
        refined: What there is.
        places: Fractional cutter points in the original numbering, within passes, shape (k,).
    """
    problem = refined.problem
    new = np.setdiff1d(places, refined.places)
    columns = np.interp(new, refined.places, np.arange(len(refined.places)))
    before = columns.astype(int)
    points = problem.points
    added = CutterPoints(
        cutter_frames(points, columns),
        np.zeros(len(new), dtype=np.int64),
        np.interp(columns, np.arange(len(points)), points.arc_length),
    )
    t = problem.field.contact_positions
    asked = problem.wheel_clearance > -np.inf
    asked = _between(asked[before] | asked[before + 1])
    layer = layer_at(problem.cell, problem.part, added, t, asked)
    q = np.full((*asked.shape, *problem.field.q.shape[2:]), np.nan)
    q[asked] = solve_at(problem.cell, added, t, asked)
    at = before + 1
    field = NodeField(
        t,
        problem.field.q[:0],  # nobody asks what lies beyond the limits between cutter points
        tuple(_insert(problem, nodes, q, before) for nodes in problem.field.branches),
    )
    return RefinedProblem(
        replace(
            problem,
            points=CutterPoints(
                np.insert(points.Ts_workpiece_cutter, at, added.Ts_workpiece_cutter, axis=0),
                np.insert(points.pass_index, at, points.pass_index[before]),
                np.insert(points.arc_length, at, added.arc_length),
            ),
            field=field,
            wheel_clearance=np.insert(problem.wheel_clearance, at, layer, axis=0),
        ),
        np.insert(refined.places, at, new),
    )


def postures_between(problem: GrindingProblem, nodes: NodeMatrix, places: Array) -> Array:
    """Return the postures of a branch between cutter points, NaN where there is none.

    Args:
        problem: What is to be planned.
        nodes: The branch.
        places: Fractional cutter points, shape (k,).

    Returns:
        Joint positions in [rad], shape (k, n_rows, 6).
    """
    q = _solutions(problem, cutter_frames(problem.points, places))
    return _on_branch(problem, nodes, q, places.astype(int))


def _solutions(problem: GrindingProblem, Ts_workpiece_cutter: Array) -> Array:
    """Return all inverse solutions of some cutter frames in [rad], shape (k, M, 8, 6)."""
    t = problem.field.contact_positions
    Ts_base_flange = problem.cell.Ts_base_flange(t[None, :], Ts_workpiece_cutter[:, None])
    return inverse_kinematics(problem.cell.robot.arm, Ts_base_flange)


def solve_at(
    cell: WorkCell, points: CutterPoints, contact_positions: Array, at: np.ndarray
) -> Array:
    """Return the inverse solutions of some nodes in [rad], NaN where there are none.

    Args:
        cell: The cell.
        points: N cutter points.
        contact_positions: M values of t.
        at: Which k nodes, shape (N, M).

    Returns:
        Shape (k, 8, 6), column by column.
    """
    columns, rows = np.nonzero(at)
    Ts_base_flange = cell.Ts_base_flange(
        contact_positions[rows], points.Ts_workpiece_cutter[columns]
    )
    return inverse_kinematics(cell.robot.arm, Ts_base_flange)


def _between(rows: np.ndarray) -> np.ndarray:
    """Fill in the rows between the first and the last of each column, shape (k, M) of bool."""
    return (
        np.logical_or.accumulate(rows, axis=1)
        & np.logical_or.accumulate(rows[:, ::-1], axis=1)[:, ::-1]
    )


def _insert(
    problem: GrindingProblem, nodes: NodeMatrix, q: Array, before: np.ndarray
) -> NodeMatrix:
    """Return a matrix with new columns, all their inverse solutions given."""
    added = _on_branch(problem, nodes, q, before)
    return replace(nodes, q=np.insert(nodes.q, before + 1, added, axis=0))


def _on_branch(problem: GrindingProblem, nodes: NodeMatrix, q: Array, before: np.ndarray) -> Array:
    """Return what a branch makes of inverse solutions, on the count of turns of its neighbours.

    Args:
        problem: For the limits.
        nodes: The branch.
        q: All inverse solutions in [rad], shape (k, M, 8, 6).
        before: Column of ``nodes`` that each follows, shape (k,).

    Returns:
        Joint positions in [rad], NaN beyond the limits, shape (k, n_rows, 6).
    """
    added = q[:, nodes.position_index, nodes.branch]
    near = nodes.q[before]
    near = np.where(np.isnan(near), nodes.q[before + 1], near)
    added = nearest_turn(added, near)
    within = problem.cell.within_limits(added)
    return np.where(within[..., None], added, np.nan)


def carried(branches: list[Branch], places: Array, refined: RefinedProblem) -> list[Branch]:
    """Return the branches of a refined problem, with what is known to be blocked.

    Args:
        branches: The branches before.
        places: Their columns in the original numbering, shape (n,).
        refined: The problem with more columns.
    """
    columns = np.searchsorted(refined.places, places)
    together = np.diff(columns) == 1
    result = branches_of(refined.problem)
    for before, after in zip(branches, result, strict=True):
        after.free[columns] &= before.free
        n_rows = before.free.shape[1]
        for key in before.blocked:
            column, rows = divmod(key, n_rows * n_rows)
            if together[column]:
                after.blocked.add(int(columns[column]) * n_rows * n_rows + rows)
    return result
