"""A path through joint space by sampling: OMPL's RRTConnect, repeatable.

OMPL draws its random numbers from one seed, set anew for every search, and a search ends after a
number of checked moves, never after a time. So the result depends on the arguments only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from ompl import base, geometric, util

from opl.geometry.frames import Array

SEED = 1  # any number but 0, which OMPL takes for none
STRIDE = 0.1  # longest move that is added to a tree, as a fraction of the diagonal of the box
# rounds of replacing a piece of a path by a straight move; that many in vain in a row end it
SHORTCUTS = 100


@dataclass(frozen=True)
class Sampled:
    """What a search found.

    Attributes:
        path: Start, intermediate places and goal, shape (n, d); None if none was found.
        refused: Where there is none, the moves that were refused, each from a place that was
            reached to where it would have led, shape (m, 2, d): those of the end whose tree grew
            less, which tells which end is shut in.
    """

    path: Array | None
    refused: Array


class _RecordingValidator(base.MotionValidator):  # type: ignore[misc]
    """Tells OMPL whether moves are free, and records what each tree has reached."""

    def __init__(
        self,
        information: base.SpaceInformation,
        free: Callable[[Array, Array], bool],
        give_up: Callable[[], bool],
        ends: tuple[Array, Array],
    ) -> None:
        super().__init__(information)
        self._free = free
        self._give_up = give_up
        self._tree = {end.tobytes(): side for side, end in enumerate(ends)}
        self._dimension = len(ends[0])
        self.reached = [0, 0]
        self.refused: tuple[list[tuple[Array, Array]], ...] = ([], [])

    def checkMotion(self, first: base.State, second: base.State) -> bool:
        """Check a move; OMPL gives those of the tree that starts at the goal backwards."""
        if self._give_up():
            return False
        a, b = (np.array([state[k] for k in range(self._dimension)]) for state in (first, second))
        free = bool(self._free(a, b))  # OMPL takes no bool of numpy
        reached, new = (a, b) if a.tobytes() in self._tree else (b, a)
        side = self._tree.get(reached.tobytes(), 0)
        if free:
            self._tree.setdefault(new.tobytes(), side)
            self.reached[side] += 1
        else:
            self.refused[side].append((reached, new))
        return free


def sample_path(
    start: Array,
    goal: Array,
    low: Array,
    high: Array,
    free: Callable[[Array, Array], bool],
    give_up: Callable[[], bool],
    seed: int = 0,
) -> Sampled:
    """Search a path between two places in a box of free and other places.

    Args:
        start: Where it begins, shape (d,).
        goal: Where it ends, shape (d,).
        low: Lower corner of the box, shape (d,).
        high: Upper corner, shape (d,).
        free: Whether the straight move between two places is free.
        give_up: Called again and again; whether to end the search, and no more to shorten a path
            that was found; must not look at a clock.
        seed: Other random numbers are drawn with another.
    """
    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(SEED + seed)
    space = base.RealVectorStateSpace(len(start))
    bounds = base.RealVectorBounds(len(start))
    for k, (lowest, highest) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        bounds.setLow(k, lowest)
        bounds.setHigh(k, highest)
    space.setBounds(bounds)
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(lambda state: True)  # moves are checked, with their ends
    validator = _RecordingValidator(information, free, give_up, (start, goal))
    information.setMotionValidator(validator)
    information.setup()
    ends = space.allocState(), space.allocState()
    for state, place in zip(ends, (start, goal), strict=True):
        space.copyFromReals(state, place.tolist())
    problem = base.ProblemDefinition(information)
    problem.setStartAndGoalStates(*ends)
    planner = geometric.RRTConnect(information)
    planner.setRange(STRIDE * float(np.linalg.norm(high - low)))
    planner.setProblemDefinition(problem)
    planner.setup()
    planner.solve(base.PlannerTerminationCondition(give_up))
    if not problem.hasExactSolution():
        side = int(validator.reached[1] < validator.reached[0])
        refused = np.array(validator.refused[side]).reshape(-1, 2, len(start))
        return Sampled(None, refused)
    solution = problem.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    simplifier.reduceVertices(solution, SHORTCUTS, SHORTCUTS)
    simplifier.partialShortcutPath(solution, SHORTCUTS, SHORTCUTS)
    path = np.array([[state[k] for k in range(len(start))] for state in solution.getStates()])
    return Sampled(fewest(path, free), np.empty((0, 2, len(start))))


def fewest(path: Array, free: Callable[[Array, Array], bool]) -> Array:
    """Leave out every place that a straight move from an earlier to a later one makes idle."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        here = kept[-1]
        ahead = range(len(path) - 1, here + 1, -1)
        kept.append(next((k for k in ahead if free(path[here], path[k])), here + 1))
    return path[kept]
