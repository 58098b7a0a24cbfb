"""Contact positions that no motion along a pass gets past.

A concave part may cut into the wheel at some contact position all along a pass, between its cutter
points too: then the pass is ground on one side of it as a whole. That is certain where the part is
deeper in the wheel, at places along the pass, than any point of it can move on the way to the next.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from opl.geometry.frames import Array
from opl.planning.cut_cells import MOST_WITHIN, halved, surely_cuts_along
from opl.planning.problem import GrindingProblem
from opl.search.walls import Piece


def barriers(problem: GrindingProblem) -> list[Array]:
    """Return the contact positions in belt units that each pass stays on one side of, in order.

    Of each run of contact positions of the field at which the part cuts into the wheel at all
    cutter points of a pass, the one where it is deepest, if it is certain between them as well.
    """
    points, cuts = problem.points, problem.cuts
    found = []
    for index in range(points.n_passes):
        own = np.flatnonzero(points.pass_index == index)
        shut = np.concatenate([[False], cuts[own].all(axis=0), [False]])
        ends = np.flatnonzero(np.diff(shut.astype(int))).reshape(-1, 2)
        least_depth = -problem.wheel_distance[own].max(axis=0)
        rows = [first + int(np.argmax(least_depth[first:end])) for first, end in ends.tolist()]
        t = problem.field.contact_positions[rows]
        found.append(np.array([one for one in t.tolist() if _is_shut(problem, own, one)]))
    return found


def on_sides(piece: Piece, barriers: Array) -> Iterator[Piece]:
    """Yield the parts of a piece on either side of each barrier; a cell with one is of both."""
    if piece.line.T_workpiece_cutter is None:
        side = int(np.searchsorted(barriers, piece.line.contact_position))
        yield replace(piece, side=side)
        return
    ends = np.concatenate([[-np.inf], barriers, [np.inf]])
    for side, (low, high) in enumerate(pairwise(ends.tolist())):
        inside = np.flatnonzero((piece.at[1:] > low) & (piece.at[:-1] < high))
        if len(inside):
            yield replace(piece.part(int(inside[0]), int(inside[-1]) + 1), side=side)


def _is_shut(problem: GrindingProblem, columns: np.ndarray, contact_position: float) -> bool:
    """Return whether the part surely cuts into the wheel there all along a pass."""
    if len(columns) < 2:
        return False

    def surely(_: np.ndarray, low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
        t = np.full(len(low), contact_position)
        part = problem.scene.part
        return surely_cuts_along(problem.cell, part, problem.points, t, low, high)

    low = columns[:-1].astype(float)
    _, _, _, shut = halved(np.zeros(len(low), int), low, low + 1.0, surely, MOST_WITHIN)
    return bool(shut.all())
