"""A branch while it is searched: which of its nodes and steps were found not to be free."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from opl.cell.collision import CollisionScene
from opl.field.nodes import NodeMatrix
from opl.motion.links import Blocker
from opl.planning.problem import GrindingProblem
from opl.search.ladder import Ladder


@dataclass(frozen=True)
class Track:
    """One node per column.

    Attributes:
        branch: Index of the branch in the list that is searched.
        rows: The row in each column, shape (n_columns,).
    """

    branch: int
    rows: np.ndarray


@dataclass
class Branch:
    """The nodes of one branch with what is known to be blocked.

    Attributes:
        nodes: The nodes.
        ladder: What a search sees; shares ``free``.
        free: Which nodes may be used; shrinks, shape (n_columns, n_rows).
        blocked: Keys of the steps that may not be used; grows.
        causes: How often each cause blocked something, by cutter point.
        cut_off: How many tracks, otherwise free, were refused for a way through the air: by which
            way, and the pair that is in it.
        reached: Largest number of columns that a search passed.
    """

    nodes: NodeMatrix
    ladder: Ladder
    free: np.ndarray
    blocked: set[int] = field(default_factory=set)
    causes: Counter[tuple[int, str]] = field(default_factory=Counter)
    cut_off: Counter[tuple[str, Blocker]] = field(default_factory=Counter)
    reached: int = 0
    _swept: set[int] = field(default_factory=set)

    @property
    def blocked_steps(self) -> np.ndarray:
        """The blocked keys, sorted, as the searches take them."""
        return np.array(sorted(self.blocked), dtype=np.int64)

    def block_step(self, column: int, rows: np.ndarray, cause: str) -> None:
        """Block the step that a track makes from a column to the next."""
        key = self.ladder.step_key(column, int(rows[column]), int(rows[column + 1]))
        self.blocked.add(key)
        self.causes[column, cause] += 1

    def block_steps(
        self, column: int, from_rows: list[int], to_rows: list[int], cause: str
    ) -> None:
        """Block every step from some rows of a column to some of the next."""
        self.blocked.update(
            self.ladder.step_key(column, row, after) for row in from_rows for after in to_rows
        )
        self.causes[column, cause] += len(from_rows) * len(to_rows)

    def block_node(self, column: int, row: int, cause: str) -> None:
        """Block one node."""
        self.free[column, row] = False
        self.causes[column, cause] += 1

    def sweep(self, scene: CollisionScene, column: int, cause: str) -> None:
        """Block every node of a column that collides: where one does, its neighbours mostly do."""
        if column in self._swept:
            return
        self._swept.add(column)
        rows = np.flatnonzero(self.free[column])
        # a full turn of the wrist brings the same bodies to the same places
        _, first, turn = np.unique(
            self.nodes.position_index[rows], return_index=True, return_inverse=True
        )
        hit = scene.collides(self.nodes.q[column, rows[first]])[turn]
        self.free[column, rows[hit]] = False
        self.causes[column, cause] += int(hit.sum())

    def allows(self, rows: np.ndarray) -> bool:
        """Return whether nothing on a track is blocked."""
        columns = np.arange(len(rows))
        n_rows = self.free.shape[1]
        keys = (columns[:-1] * n_rows + rows[:-1]) * n_rows + rows[1:]
        return bool(self.free[columns, rows].all()) and self.blocked.isdisjoint(keys.tolist())


def branches_of(problem: GrindingProblem) -> list[Branch]:
    """Return every branch of a problem, nothing blocked but what its nodes tell."""
    branches = []
    for nodes in problem.field.branches:
        free = problem.free_nodes(nodes)
        branches.append(Branch(nodes, problem.ladder(nodes, free), free))
    return branches
