"""Where no motion along a pass gets past: the barriers of each pass, and its sides.

A concave part may cut into the wheel at some contact position at many cutter points of a pass, and
all the way between them: then the pass stays on one side of it there. That is certain where the
part is deeper in the wheel, at places along the pass, than any point of it can move on the way to
the next.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from opl.cell.wheel_cuts import shut_along
from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem
from opl.walls.cut_cells import cells_of
from opl.walls.sides import Barrier, Side, sides_of

MOST_LOOKED_AT = 8  # runs of cutter points of a pass, those that part most first
MOST_SIDES = 8  # of a pass
WITHIN = 7  # halvings of the way between cutter points that is too deep in the wheel, but hardly
SHORTEST = 3  # cutter points
NEARLY = 0.8  # of the run that parts most: the deepest of those is taken


def all_sides(problem: GrindingProblem) -> list[list[Side]]:
    """Return the sides of each pass; one that excludes nothing where there are no barriers."""
    cell, part, points = problem.cell, problem.scene.part, problem.points

    @cache
    def shut(place: float, low: float, high: float) -> bool:
        Ts = points.frames_at(np.array([place]))
        return bool(cells_of(cell, part, Ts, np.array([low]), np.array([high]))[1][0].all())

    every = (barriers(problem, index) for index in range(points.n_passes))
    return [sides_of(found, shut, MOST_SIDES) for found in every]


def barriers(problem: GrindingProblem, index: int) -> list[Barrier]:
    """Return the barriers of a pass, the longest first.

    Runs of cutter points at which the part cuts into the wheel on one contact position of the
    field, as far as it surely does between them as well: those that part contact positions at which
    it does not, on either side.
    """
    own = np.flatnonzero(problem.points.pass_index == index)
    depth = np.where(problem.cuts[own], -problem.wheel_distance[own], 0.0)
    left, found = _parting(depth > 0.0), []
    for _ in range(MOST_LOOKED_AT):
        row, first, last = _deepest(depth, left)
        if last - first + 1 < SHORTEST:
            break
        t = float(problem.field.contact_positions[row])
        places = own[first : last + 1].astype(float)
        at = places[:-1], places[1:], np.full(last - first, t)
        shut = shut_along(problem.cell, problem.scene.part, problem.points, *at, WITHIN)
        parts = left[first : last + 1, row]
        runs = [(a, b) for a, b in _runs(shut) if parts[a : b + 1].any()]
        found += [Barrier(places[a], places[b], t) for a, b in runs]
        # of what is shut around a run no more is looked at
        for column in range(first, last + 1):
            left[column] &= ~_around(depth[column] > 0.0, row)
    return sorted(found, key=lambda one: one.first - one.last)


def _parting(shut: np.ndarray) -> np.ndarray:
    """Return which shut nodes have free ones on either side, there or at a neighbouring column."""
    free = ~shut
    free[1:] |= ~shut[:-1]
    free[:-1] |= ~shut[1:]
    below = np.logical_or.accumulate(free, axis=1)
    above = np.logical_or.accumulate(free[:, ::-1], axis=1)[:, ::-1]
    return np.asarray(shut & below & above)


def _deepest(depth: Array, left: np.ndarray) -> tuple[int, int, int]:
    """Return contact position, first and last column of a run in which most columns are left.

    Of these runs that where the part is deepest in the wheel all along.
    """
    runs = [(row, a, b - 1) for row, now in enumerate(depth.T) for a, b in _runs(now > 0.0)]
    parted = [int(left[a : b + 1, row].sum()) for row, a, b in runs]
    most = max(parted, default=0)
    some = [run for run, n in zip(runs, parted, strict=True) if n > 0 and n >= NEARLY * most]
    return max(some, key=lambda run: depth[run[1] : run[2] + 1, run[0]].min(), default=(0, 0, -1))


def _around(flags: np.ndarray, row: int) -> np.ndarray:
    """Return which flags are in the run of those set that a row is in."""
    number = np.cumsum(~flags)
    return np.asarray(flags & (number == number[row]))


def _runs(flags: np.ndarray) -> list[tuple[int, int]]:
    """Return first and end of every run of flags that are set."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in ends.reshape(-1, 2)]
