"""The track with the least cost over the whole field: least travel, or least time."""

from __future__ import annotations

from collections.abc import Iterator

from opl.planning.costs import track_cost
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.plan import Plan, first_free
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights
from opl.planning.symmetry import twins
from opl.search.smooth import smoothest


def plan_cheapest(problem: GrindingProblem, weights: CostWeights) -> Plan:
    """Find the collision-free motion whose track costs least.

    Exact over the field and all its matrices: what a proposed motion collides with is taken out,
    and the least of what is left is proposed next.

    Raises:
        NoPathError: If there is none, as in `first_free`.
    """
    matrices = open_matrices(problem)
    return first_free(problem, matrices, _cheapest_first(problem, matrices, weights))


def _cheapest_first(
    problem: GrindingProblem, matrices: list[OpenMatrix], weights: CostWeights
) -> Iterator[Track]:
    costs = [track_cost(problem, one.nodes, weights, one.free.copy()) for one in matrices]
    while True:
        found = []
        for index, matrix in enumerate(matrices):
            track = smoothest(matrix.ladder, matrix.blocked_edges, matrix.free, costs[index])
            if track is not None:
                matrix.reached = len(track.rows)
                found.append((track.cost, index, track.rows))
        if not found:
            return
        _, index, rows = min(found, key=lambda entry: entry[:2])
        yield from twins(matrices, Track(index, rows), problem.cell.robot)
