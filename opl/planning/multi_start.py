"""The recursive search of the paper from many start nodes, its tracks checked best first."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.planning.open_matrix import OpenMatrix, Track, open_matrices
from opl.planning.plan import Pause, Plan, SearchOutcome, first_free, propose_and_check
from opl.planning.problem import GrindingProblem
from opl.planning.settings import Start
from opl.planning.symmetry import twins
from opl.search.impasse import passable
from opl.search.recursive import Descent, add_dead_ends, descend

DESCENTS = 64  # of the recursive search between two pauses
NODES_OF_WORK = 20_000  # that a descent leads past, which cost a unit of work


def plan_recursive(problem: GrindingProblem, start: Start = Start.BEST) -> Plan:
    """Find a collision-free motion by the recursive search of the paper.

    Raises:
        NoPathError: If there is none, as in `first_free`.
    """
    matrices = open_matrices(problem)
    return first_free(problem, matrices, _tracks(problem, matrices, start))


def try_recursive(
    problem: GrindingProblem, start: Start, most_checks: int | None, most_work: float = np.inf
) -> SearchOutcome:
    """Return what the recursive search finds within a number of checked motions, and work.

    Args:
        problem: What is to be planned.
        start: From which start nodes.
        most_checks: None for no limit.
        most_work: In units.
    """
    matrices = open_matrices(problem)
    tracks = _tracks(problem, matrices, start)
    return propose_and_check(problem, matrices, tracks, 0, most_checks, most_work)


def held_back(problem: GrindingProblem, matrices: list[OpenMatrix]) -> bool:
    """Return whether it is the largest change of t alone that lets no track through any matrix.

    Then tracks at contact positions between those of the field may keep it.
    """
    if problem.interpolation.max_contact_change >= np.ptp(problem.field.contact_positions):
        return False
    last = len(problem.points) - 1
    free = (replace(matrix.ladder, max_contact_change=np.inf) for matrix in matrices)
    return any(
        passable(ladder, matrix.blocked_edges, 0, last)
        for ladder, matrix in zip(free, matrices, strict=True)
    )


def _tracks(
    problem: GrindingProblem, matrices: list[OpenMatrix], start: Start
) -> Iterator[Track | Pause]:
    """Yield tracks in the order in which the search wants them checked, and pauses."""
    if start is Start.NEAREST:
        yield from tracks_from_nearest_start(matrices, problem.process.home)
        return
    for track in _from_best_start(matrices):
        if isinstance(track, Pause):
            yield track
        else:
            yield from twins(matrices, track, problem.cell.robot)


def tracks_from_best_start(matrices: list[OpenMatrix]) -> Iterator[Track]:
    """Yield tracks by increasing joint range sum over all start nodes of all matrices."""
    return (track for track in _from_best_start(matrices) if isinstance(track, Track))


def _from_best_start(matrices: list[OpenMatrix]) -> Iterator[Track | Pause]:
    """Yield tracks by increasing joint range sum, and a pause after every few descents.

    A start node is given up as soon as its sum is more than the best known, and is looked at again
    when no other has less. One that full turns make of another is reckoned to have the same sum at
    first. What a check of a track blocks is noted in its matrix before the next is taken: only then
    a start node can yield again.
    """
    searches = [_Search(matrix) for matrix in matrices]
    # (joint range sum, matrix, start row, rows); None for rows where the sum is no less than that
    queue: list[tuple[float, int, int, np.ndarray | None]] = []
    known: list[float] = []  # sums of those with rows
    # of IK branches and contact position, whatever the full turns
    reckoned: dict[tuple[bytes, int], float] = {}
    for index, matrix in enumerate(matrices):
        queue += [(0.0, index, row, None) for row in np.flatnonzero(matrix.free[0]).tolist()]
    heapq.heapify(queue)
    descents, nodes = 0, matrices[0].free.size if matrices else 0
    while queue:
        total, index, row, rows = heapq.heappop(queue)
        matrix = matrices[index]
        if rows is not None:
            heapq.heappop(known)
            if matrix.allows(rows):
                yield Track(index, rows)
                if matrix.allows(rows):
                    continue  # nothing was blocked: the same search would find the same track
        same = matrix.nodes.ik_branch.tobytes(), int(matrix.nodes.position_index[row])
        if rows is None and reckoned.get(same, 0.0) > total:
            heapq.heappush(queue, (reckoned[same], index, row, None))
            continue
        total, rows = searches[index].descend_to(row, known)
        descents += 1
        if descents % DESCENTS == 0:
            yield Pause(DESCENTS * nodes / NODES_OF_WORK)
        if np.isfinite(total):
            reckoned[same] = total
            heapq.heappush(queue, (total, index, row, rows))


def tracks_from_nearest_start(matrices: list[OpenMatrix], home: Array) -> Iterator[Track]:
    """Yield tracks from the start node nearest to home in [rad], then from the next nearest."""
    starts = [
        (float(np.linalg.norm(matrix.nodes.at(0, row) - home)), index, row)
        for index, matrix in enumerate(matrices)
        for row in np.flatnonzero(matrix.free[0]).tolist()
    ]
    searches = [_Search(matrix) for matrix in matrices]
    for _, index, row in sorted(starts):
        while (rows := searches[index].descend(row, np.inf).rows) is not None:
            yield Track(index, rows)
            if matrices[index].allows(rows):
                break


class _Search:
    """The recursive search in one matrix; remembers its dead ends."""

    def __init__(self, matrix: OpenMatrix) -> None:
        self.matrix = matrix
        self._dead = np.zeros_like(matrix.free)
        self._dead_ends = np.zeros_like(matrix.free)
        self._left = (-1, -1)  # nodes and edges when all dead ends were known

    def descend_to(self, start: int, known: list[float]) -> tuple[float, np.ndarray | None]:
        """Return joint range sum and rows of the track from a start node; no rows if given up.

        It is given up where its sum is more than the least of some known, a heap to which that of
        the track is added.
        """
        descent = self.descend(start, float(np.nextafter(known[0], np.inf)) if known else np.inf)
        if descent.rows is not None:
            heapq.heappush(known, descent.joint_range_sum)
        return descent.joint_range_sum, descent.rows

    def descend(self, start: int, bound: float) -> Descent:
        """Search from a start node; give up at a bound on the joint range sum."""
        matrix = self.matrix
        if not matrix.free[0, start]:
            return Descent(None, np.inf, 0)
        blocked = matrix.blocked_edges
        dead = self._dead  # a search that finds them also finds how far it can come
        if np.isfinite(bound):
            # to stop at a bound is right only where the search would not have turned back
            left = int(matrix.free.sum()), len(blocked)
            if left != self._left:
                add_dead_ends(matrix.ladder, blocked, self._dead_ends)
                self._left = left
            dead = self._dead_ends
        descent = descend(matrix.ladder, start, blocked, dead, bound)
        matrix.reached = max(matrix.reached, descent.reached)
        return descent
