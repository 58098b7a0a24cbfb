"""More contact positions around a path: the field, finer where the path runs, gone elsewhere.

The contact positions of a field are a choice of M values; between two of them there may be a
smaller box. Around a path the values are halved, and the best track of this tube is at least as
good as the path, because the path is in it. Done again and again this refines t continuously.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.cell.full_turns import nearest_turn
from opl.geometry.frames import Array
from opl.motion.path import GrindingPath
from opl.planning.nodes import NodeField, NodeMatrix, inverse_solutions
from opl.planning.problem import wheel_distances
from opl.planning.refine import RefinedProblem

REACH = 8  # finer contact positions on either side of the path's own


def tube(refined: RefinedProblem, path: GrindingPath, finer: Array) -> RefinedProblem:
    """Return a problem with finer contact positions around a path, and only there.

    Args:
        refined: The problem, with a column wherever the path has a node.
        path: A path through these columns, its cutter points in the original numbering.
        finer: The contact positions, those of the path among them, increasing, shape (M,).
    """
    problem, points = refined.problem, refined.problem.points
    at_column = np.searchsorted(path.cutter_point, refined.places)
    q_path, t_path = path.q[at_column], path.contact_position[at_column]
    own = np.abs(finer - t_path[:, None]).argmin(axis=1)
    rows = np.arange(len(finer))
    near = np.abs(rows - own[:, None]) <= REACH
    used = near.any(axis=0)
    near, t = np.ascontiguousarray(near[:, used]), finer[used]
    layer = wheel_distances(problem.scene, points, t, near)
    columns, at = np.nonzero(near)
    q = np.full((*near.shape, 6), np.nan)
    q[near] = inverse_solutions(problem.cell, points.Ts_workpiece_cutter[columns], t[at])[
        :, path.ik_branch
    ]
    # on the same count of turns as the path
    q = nearest_turn(q, q_path[:, None])
    q = np.where(problem.cell.within_limits(q)[..., None], q, np.nan)
    # to the bit what is known to be free
    q[np.arange(len(q)), np.searchsorted(np.flatnonzero(used), own)] = q_path
    nodes = NodeMatrix(path.ik_branch, np.ascontiguousarray(q), t, np.arange(len(t)))
    field = NodeField(t, problem.field.q[:0], (nodes,))
    return RefinedProblem(replace(problem, field=field, wheel_distance=layer), refined.places)


def halved(contact_positions: Array) -> Array:
    """Return contact positions with one more between each two, shape (2 M - 1,)."""
    middles = (contact_positions[:-1] + contact_positions[1:]) / 2.0
    return np.sort(np.concatenate([contact_positions, middles]))
