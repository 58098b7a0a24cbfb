"""A node matrix while it is searched: which of its nodes and edges are still open to a track."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from opl.cell.collision import CollisionScene
from opl.motion.free_move_search import Blocker
from opl.planning.nodes import NodeMatrix
from opl.planning.problem import GrindingProblem
from opl.search.box import JointBox
from opl.search.ladder import Ladder


class FreeMove(str, Enum):
    """Where a free move leads; the value is how messages name it."""

    FROM_HOME = "free move from home"
    BETWEEN_PASSES = "free move between passes"
    TO_HOME = "free move to home"


@dataclass(frozen=True)
class Track:
    """One node per column: its row in each, shape (n_columns,), in a matrix given by its index."""

    matrix: int
    rows: np.ndarray


@dataclass
class OpenMatrix:
    """A node matrix with what is known to be blocked in it.

    Attributes:
        nodes: The nodes.
        ladder: What a search sees; shares ``free``.
        free: Which nodes may be used; shrinks, shape (n_columns, n_rows).
        blocked: Keys of the edges that may not be used; grows.
        causes: How often each cause blocked something, by cutter point.
        cut_off: How many tracks, otherwise free, were refused for a free move: by which one, and
            the pair of bodies that blocks it.
        reached: Largest number of columns that a search passed.

    What is known to collide is shared between the matrices of a problem.
    """

    nodes: NodeMatrix
    ladder: Ladder
    free: np.ndarray
    blocked: set[int] = field(default_factory=set)
    causes: Counter[tuple[int, str]] = field(default_factory=Counter)
    cut_off: Counter[tuple[FreeMove, Blocker]] = field(default_factory=Counter)
    reached: int = 0
    _collides: dict[tuple[int, int], dict[int, bool]] = field(default_factory=dict)
    _swept: set[int] = field(default_factory=set)
    _sorted: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def blocked_edges(self) -> np.ndarray:
        """The blocked keys, sorted, as the searches take them."""
        if len(self._sorted) != len(self.blocked):
            self._sorted = np.array(sorted(self.blocked), dtype=np.int64)
        return self._sorted

    def ladder_within(self, max_contact_change: float) -> Ladder:
        """Return the ladder with a largest change of t over each edge on the wheel."""
        changes = np.where(self.ladder.off_wheel, np.inf, max_contact_change)
        return replace(self.ladder, max_contact_change=changes)

    def free_inside(self, box: JointBox) -> np.ndarray:
        """Return which nodes are free and lie in a box, shape (n_columns, n_rows)."""
        return np.asarray(self.free & box.holds(np.nan_to_num(self.nodes.q, nan=np.inf)))

    def block_edges(
        self, column: int, from_rows: list[int], to_rows: list[int], cause: str
    ) -> None:
        """Block every edge from some rows of a column to some of the next."""
        self.blocked.update(
            self.ladder.edge_key(column, row, after) for row in from_rows for after in to_rows
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
        positions = self.nodes.position_index[rows]
        # full turns bring the same bodies to the same places, in this matrix and in others
        known = self._collides.setdefault((self.nodes.ik_branch, column), {})
        asked, first = np.unique(positions, return_index=True)
        new = np.array([position not in known for position in asked.tolist()], dtype=bool)
        hits = scene.collides(self.nodes.q[column, rows[first[new]]])
        known.update(zip(asked[new].tolist(), hits.tolist(), strict=True))
        hit = np.array([known[position] for position in positions.tolist()], dtype=bool)
        self.free[column, rows[hit]] = False
        self.causes[column, cause] += int(hit.sum())

    def allows(self, rows: np.ndarray) -> bool:
        """Return whether nothing on a track is blocked."""
        columns, n_rows = np.arange(len(rows)), self.free.shape[1]
        keys = (columns[:-1] * n_rows + rows[:-1]) * n_rows + rows[1:]
        return bool(self.free[columns, rows].all()) and self.blocked.isdisjoint(keys.tolist())


def open_matrices(problem: GrindingProblem) -> list[OpenMatrix]:
    """Return every matrix of a problem, nothing blocked yet but nodes that cut into the wheel."""
    matrices = []
    collides: dict[tuple[int, int], dict[int, bool]] = {}
    for nodes in problem.field.matrices:
        free = problem.free_nodes(nodes)
        ladder = problem.ladder(nodes, free)
        matrices.append(OpenMatrix(nodes, ladder, free, _collides=collides))
    return matrices
