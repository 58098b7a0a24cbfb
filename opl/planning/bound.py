"""How small the joint range sum can be, ways between the cutter points included.

The certificate of the nodes lets t jump from one cutter point to the next. Where the motion on the
way must leave the box that the nodes span, no path comes near that bound. Here the steps where this
happens are given strips, which hold whatever a motion passes there, and the proof is made again:
its bound is that of all motions that pass each cutter point at one of its nodes, however t changes
between them, up to the curvature of the motion within a cell of a strip.
"""

from __future__ import annotations

import time

import numpy as np

from opl.geometry.frames import Array
from opl.planning.filling import BrokenEdgeError, fill_in
from opl.planning.open_matrix import OpenMatrix
from opl.planning.problem import GrindingProblem
from opl.planning.refine import configurations_between
from opl.search.bottleneck import tighten_strips
from opl.search.box import JointBox, size_of
from opl.search.certificate import BoxProof, least_box
from opl.search.ladder import Ladder
from opl.search.strips import Strips, strips_of

FIRST_CELLS = 8  # of a step that is looked at closely, twice as many each time it is again
MOST_CELLS = 32
NODES_GAP = 1e-6  # fraction to which the box of the nodes alone is solved
LEAST_GAIN = 1e-4  # of a bound that has begun to rise, in one round; less is not worth finer cells
MOST_SUBPROBLEMS = 1000  # of one round: what has not closed by then would take far longer


def raise_bound(
    problem: GrindingProblem,
    matrix: OpenMatrix,
    bound: float,
    wanted: float,
    deadline: float,
) -> float:
    """Return a lower bound on the joint range sum of one matrix, in [rad].

    Args:
        problem: What is to be planned.
        matrix: The matrix; its free nodes and blocked edges are taken for all there are.
        bound: What is already proven, in [rad].
        wanted: How large a bound is wanted, in [rad]; there the proof ends.
        deadline: When to stop with what is proven, by `time.monotonic`.
    """
    nodes = least_box(
        matrix.ladder,
        matrix.blocked_edges,
        bound=wanted,
        gap=NODES_GAP,
        seconds=deadline - time.monotonic(),
    )
    before = bound = max(bound, nodes.lower_bound)
    rows, box = nodes.rows, nodes.box
    cells: dict[int, int] = {}
    while bound < wanted and rows is not None and box is not None:
        outside = _steps_outside(problem, matrix, rows, box)
        finer = [step for step in outside if cells.get(step, 0) < MOST_CELLS]
        if not finer:
            break
        for step in finer:
            cells[step] = 2 * cells[step] if step in cells else FIRST_CELLS
        proof = StripProof(
            matrix.ladder, matrix.blocked_edges, wanted, _cut(problem, matrix, cells)
        )
        while proof.open_bound() < min(wanted, proof.held):
            if proof.subproblems >= MOST_SUBPROBLEMS or time.monotonic() >= deadline:
                break
            proof.take_next()
        last, bound = bound, max(bound, min(proof.open_bound(), proof.held))
        rows, box = proof.rows, proof.box
        if before < bound < last * (1.0 + LEAST_GAIN):
            break
    return min(bound, wanted)


class StripProof(BoxProof):
    """Branch and bound over tracks that are charged for what they pass on the way.

    No track is sought: the proof ends where a core holds all that its track passes, `held` in
    [rad], since nothing can be proven beyond it.
    """

    def __init__(self, ladder: Ladder, blocked: np.ndarray, bound: float, strips: Strips) -> None:
        super().__init__(ladder, blocked, bound, 0.0)
        self._strips = strips
        self.held = np.inf
        self.box = JointBox(np.zeros(6), np.zeros(6))

    def _tighten(
        self, first: np.ndarray, last: np.ndarray, low: Array, high: Array
    ) -> tuple[float, int]:
        while True:
            bound, column = super()._tighten(first, last, low, high)
            if not np.isfinite(bound):
                return bound, column
            if not tighten_strips(
                self._q,
                self._ladder.free,
                first,
                last,
                self.threshold(),
                low,
                high,
                *self._strips.arrays,
            ):
                return max(bound, size_of(low, high)), column

    def _settle(
        self, bound: float, first: np.ndarray, last: np.ndarray, low: Array, high: Array
    ) -> None:
        least, column, rows = self._bottleneck(first, last, low, high)
        if not np.isfinite(least):
            return
        bound = max(bound, least)
        size = size_of(low, high)
        held = least <= size + 1e-9
        if held and self.box_of(rows).size <= size + 1e-9:
            self._hold(bound, rows, low, high)
        elif not held and column not in self._columns:
            self._columns.append(column)
            self._push(bound, first, last, low, high)
        else:
            if held or first[column] == last[column]:
                column = int(np.argmax(last - first))
            if first[column] == last[column]:
                self._hold(bound, rows, low, high)
            else:
                self._halve(bound, column, first, last, low, high)

    def _improve(self, first: np.ndarray, last: np.ndarray, low: Array, high: Array) -> None:
        """Do nothing: a track is worth what it passes, which its nodes do not tell."""

    def _hold(self, bound: float, rows: np.ndarray, low: Array, high: Array) -> None:
        if bound < self.held:
            self.held, self.rows, self.box = bound, rows, JointBox(low, high)


def _cut(problem: GrindingProblem, matrix: OpenMatrix, cells: dict[int, int]) -> Strips:
    """Return strips with that many cells for each of some steps."""
    steps = np.array(sorted(cells), dtype=int)
    lines = [step + np.arange(1, cells[step]) / cells[step] for step in steps]
    places = np.concatenate([*lines, np.arange(len(problem.points))])
    order = np.argsort(places)
    between = np.concatenate([*lines, np.empty(0)])
    q_between = configurations_between(problem, matrix.nodes, between)
    q = np.concatenate([q_between, matrix.nodes.q])[order]
    in_order = bool((np.diff(matrix.nodes.position_index) == 1).all())
    return strips_of(q, places[order] % 1.0 == 0.0, in_order)


def _steps_outside(
    problem: GrindingProblem, matrix: OpenMatrix, rows: np.ndarray, box: JointBox
) -> list[int]:
    """Return the steps of a track that pass outside of a box if t changes evenly."""
    try:
        path = fill_in(problem.cell, problem.points, matrix.nodes, rows, problem.interpolation)
    except BrokenEdgeError as error:
        return [error.column]
    outside = path.cutter_point[~box.holds(path.q)]
    return sorted({int(place) for place in outside if place % 1.0})
