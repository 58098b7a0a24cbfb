"""More columns: places between two cutter points taken into the node matrix.

What a track does between two cutter points counts as much as what it does at them. A place between
them, taken in as a column, holds every track to a node there as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.motion.motion import Motion
from opl.motion.path import GrindingPath
from opl.planning.nodes import NodeField, NodeMatrix, inverse_solutions
from opl.planning.open_matrix import OpenMatrix, open_matrices
from opl.planning.problem import GrindingProblem, wheel_distances


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
        points.frames_at(columns),
        np.zeros(len(new), dtype=np.int64),
        np.interp(columns, np.arange(len(points)), points.arc_length),
    )
    t = problem.field.contact_positions
    known = problem.wheel_distance > -np.inf
    wanted = _between(known[before] | known[before + 1])
    layer = wheel_distances(problem.scene, added, t, wanted)
    q = np.full((*wanted.shape, *problem.field.q.shape[2:]), np.nan)
    column, row = np.nonzero(wanted)
    q[wanted] = inverse_solutions(problem.cell, added.Ts_workpiece_cutter[column], t[row])
    at = before + 1
    field = NodeField(
        t,
        problem.field.q[:0],  # what lies beyond the limits between cutter points is of no use
        tuple(
            replace(nodes, q=np.insert(nodes.q, at, _taken(problem, nodes, q, before), axis=0))
            for nodes in problem.field.matrices
        ),
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
            wheel_distance=np.insert(problem.wheel_distance, at, layer, axis=0),
        ),
        np.insert(refined.places, at, new),
    )


def configurations_between(problem: GrindingProblem, nodes: NodeMatrix, places: Array) -> Array:
    """Return the configurations of a matrix between cutter points, NaN where there is none.

    Args:
        problem: What is to be planned.
        nodes: The matrix.
        places: Fractional cutter points, shape (k,).

    Returns:
        Joint positions in [rad], shape (k, n_rows, 6).
    """
    frames = problem.points.frames_at(places)[:, None]
    q = inverse_solutions(problem.cell, frames, problem.field.contact_positions)
    return _taken(problem, nodes, q, places.astype(int))


def _between(rows: np.ndarray) -> np.ndarray:
    """Fill in the rows between the first and the last of each column, shape (k, M) of bool."""
    return (
        np.logical_or.accumulate(rows, axis=1)
        & np.logical_or.accumulate(rows[:, ::-1], axis=1)[:, ::-1]
    )


def _taken(problem: GrindingProblem, nodes: NodeMatrix, q: Array, before: np.ndarray) -> Array:
    """Return what a matrix takes of inverse solutions, on the count of turns of its neighbours.

    Args:
        problem: For the limits.
        nodes: The matrix.
        q: All inverse solutions in [rad], shape (k, M, 8, 6).
        before: Column of ``nodes`` that each follows, shape (k,).

    Returns:
        Joint positions in [rad], NaN beyond the limits, shape (k, n_rows, 6).
    """
    added = q[:, nodes.position_index, nodes.ik_branch]
    near = nodes.q[before]
    near = np.where(np.isnan(near), nodes.q[before + 1], near)
    added = nearest_turn(added, near)
    within = problem.cell.within_limits(added)
    return np.where(within[..., None], added, np.nan)


def carried(matrices: list[OpenMatrix], places: Array, refined: RefinedProblem) -> list[OpenMatrix]:
    """Return the matrices of a refined problem, with what is known to be blocked.

    Args:
        matrices: The matrices before.
        places: Their columns in the original numbering, shape (n,).
        refined: The problem with more columns.
    """
    columns = np.searchsorted(refined.places, places)
    together = np.diff(columns) == 1
    result = open_matrices(refined.problem)
    for before, after in zip(matrices, result, strict=True):
        after.free[columns] &= before.free
        n_rows = before.free.shape[1]
        for key in before.blocked:
            column, rows = divmod(key, n_rows * n_rows)
            if together[column]:
                after.blocked.add(int(columns[column]) * n_rows * n_rows + rows)
    return result
