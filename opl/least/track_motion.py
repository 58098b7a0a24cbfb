"""The whole motion of a track at contact positions of its own, or of one near it that is free."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.geometry.frames import Array
from opl.least.own_track import SAMPLES, OwnTrack, nodes_about
from opl.least.sinking import first_sunk, places_for
from opl.planning.costs import track_cost
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.plan import Found, Plan, Same, propose_and_check
from opl.planning.problem import GrindingProblem
from opl.planning.settings import CostWeights
from opl.planning.symmetry import everywhere, twins
from opl.planning.track_check import Collides
from opl.search.smooth import smoothest
from opl.walls.images import wrist_flips

MOST_CHECKS = 12
MOST_WORK = 4000.0  # units


def motion_of_track(problem: GrindingProblem, prices: CostWeights, track: OwnTrack) -> Plan | Array:
    """Return the motion of a track, or where that is not free, of the cheapest near to it that is.

    Any image of it: full turns and flips of the wrist that the whole motion has.

    Args:
        problem: What is to be planned.
        prices: What a track is charged for.
        track: Through all cutter points.

    Returns:
        The plan; the places of the track, and others between them where the part sinks too deep, if
        there is none.
    """
    t, q = nodes_about(problem, track)
    flips = enumerate(wrist_flips(problem.cell.robot.arm))
    moves = [(track.ik_branch ^ (4 * number), *flip) for number, flip in flips]
    nodes = everywhere(problem.cell, t, q, ~np.isnan(q[..., 0]), moves)
    if not nodes:
        return track.places
    points = problem.points.at_places(track.places)
    near = problem.over_nodes(track.places, points, t, nodes)
    matrices = open_matrices(near)
    proposals = _cheapest_first(near, matrices, prices)
    collided: dict[Same, Collides] = {}
    outcome = propose_and_check(near, matrices, proposals, 0, MOST_CHECKS, MOST_WORK, collided)
    if isinstance(outcome, Found):
        return outcome.plan.at_places(track.places)
    sunk, places = first_sunk(near, collided), track.places
    if sunk is not None:
        wanted = [
            np.linspace(one.first, one.last, one.parts + 1) for one in places_for(places, sunk)
        ]
        places = np.unique(np.concatenate([places, *wanted]))
    return places


def _cheapest_first(
    problem: GrindingProblem, matrices: list[OpenMatrix], prices: CostWeights
) -> Iterator[Track]:
    """Yield the track in the middle of the nodes, then the cheapest of what is left."""
    robot, middle = problem.cell.robot, np.full(len(problem.points), SAMPLES // 2)
    begun = (Track(k, middle) for k, matrix in enumerate(matrices) if matrix.allows(middle))
    track: Track | None = next(begun, None) or _cheapest(problem, matrices, prices)
    while track is not None:
        yield from twins(matrices, track, robot)
        track = _cheapest(problem, matrices, prices)


def _cheapest(
    problem: GrindingProblem, matrices: list[OpenMatrix], prices: CostWeights
) -> Track | None:
    """Return the cheapest track of the first matrix that has one, of those nearest to limits last.

    Moves between passes are charged for as well.
    """
    for index, matrix in enumerate(matrices):
        cost = track_cost(problem, matrix.nodes, prices, matrix.free)
        found = smoothest(matrix.ladder, matrix.blocked_edges, matrix.free, cost)
        if found is not None:
            return Track(index, found.rows)
    return None
