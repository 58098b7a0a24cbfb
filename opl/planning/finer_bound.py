"""The lower bound of a field with more contact positions, of which few nodes are looked at.

What is proven for M contact positions does not hold for a path that uses others. The bound of the
finer field does; and since a path is known, only nodes count that a smaller box than the path's can
hold. The joints alone rule out most of the others, before the part is held against the wheel.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.planning.box_search import BoxSearch, OptimalSettings
from opl.planning.nodes import NodeMatrix, build_nodes
from opl.planning.problem import GrindingProblem, wheel_distances
from opl.planning.refine import RefinedProblem
from opl.search.box import tighten
from opl.search.smooth import Travel


def finer_bound(
    problem: GrindingProblem,
    contact_positions: Array,
    settings: OptimalSettings,
    found: float,
    deadline: float,
) -> float:
    """Return the least joint range sum of all free paths at these contact positions, in [rad].

    Args:
        problem: What was planned.
        contact_positions: The finer ones, shape (M,).
        settings: What is wanted.
        found: The joint range sum of a path at these positions in [rad].
        deadline: When to stop with what is proven, by `time.monotonic`.
    """
    points = problem.points
    field = build_nodes(problem.cell, points, contact_positions)
    near = np.zeros((len(points), len(contact_positions)), dtype=bool)
    matrices = []
    for nodes in field.matrices:
        counts = _small_enough(nodes, found)
        if counts.any(axis=1).all():
            matrices.append(replace(nodes, q=np.where(counts[..., None], nodes.q, np.nan)))
            for row, position in enumerate(nodes.position_index):
                near[:, position] |= counts[:, row]
    finer = replace(
        problem,
        field=replace(field, matrices=tuple(matrices)),
        wheel_distance=wheel_distances(problem.scene, points, contact_positions, near),
    )
    whole = RefinedProblem(finer, np.arange(len(points), dtype=float))
    nowhere = Travel(0.0, 0.0)  # no track is sought
    return BoxSearch(whole, settings, nowhere, found, deadline).prove(found)


def _small_enough(nodes: NodeMatrix, size: float) -> np.ndarray:
    """Return which nodes a box of less than a size in [rad] can hold, shape (N, n_rows)."""
    n_columns, n_rows = nodes.exists.shape
    q = np.ascontiguousarray(np.moveaxis(nodes.q, 1, 2))
    first = np.zeros(n_columns, dtype=np.int64)
    last = np.full(n_columns, n_rows - 1, dtype=np.int64)
    low, high = np.full(6, np.inf), np.full(6, -np.inf)
    if not nodes.exists.any(axis=1).all():
        return np.zeros_like(nodes.exists)
    columns = np.arange(n_columns)
    bound, _ = tighten(q, nodes.exists, columns, first, last, size, low, high)
    if not np.isfinite(bound):
        return np.zeros_like(nodes.exists)
    grown = np.maximum(nodes.q, high) - np.minimum(nodes.q, low)
    return np.asarray(nodes.exists & (grown.sum(axis=-1) < size))
