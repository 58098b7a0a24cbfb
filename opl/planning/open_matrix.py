"""A node matrix while it is searched: which of its nodes and edges are still open to a track."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from opl.cell.collision import CollisionScene
from opl.motion.free_move_search import Blocker
from opl.planning.nodes import NodeMatrix
from opl.planning.problem import GrindingProblem
from opl.search.box import JointBox
from opl.search.ladder import Ladder

AT_HAND = 3_000_000  # nodes whose ladders are kept: 60 bytes each


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
        free: Which nodes may be used; shrinks, shape (n_columns, n_rows).
        ladders: Make what a search sees.
        blocked: Keys of the edges that may not be used; grows.
        shut: Keys of others that may not, sorted.
        causes: How often each cause blocked something, by cutter point.
        cut_off: How many tracks, otherwise free, were refused for a free move: by which one, and
            the pair of bodies that blocks it.
        reached: Largest number of columns that a search passed.

    What is known to collide is shared between the matrices of a problem.
    """

    nodes: NodeMatrix
    free: np.ndarray
    ladders: Ladders
    blocked: set[int] = field(default_factory=set)
    shut: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    causes: Counter[tuple[int, str]] = field(default_factory=Counter)
    cut_off: Counter[tuple[FreeMove, Blocker]] = field(default_factory=Counter)
    reached: int = 0
    _collides: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)
    _swept: set[int] = field(default_factory=set)
    _sorted: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    _counted: int = 0

    @property
    def blocked_edges(self) -> np.ndarray:
        """The blocked keys, sorted, as the searches take them."""
        count = len(self.blocked) + len(self.shut)
        if self._counted != count:
            blocked = np.sort(np.fromiter(self.blocked, np.int64, len(self.blocked)))
            # those shut may be millions: into their order, which they are in
            at = np.searchsorted(self.shut, blocked)
            new = np.append(self.shut, -1)[at] != blocked
            self._sorted, self._counted = np.insert(self.shut, at[new], blocked[new]), count
        return self._sorted

    @property
    def ladder(self) -> Ladder:
        """What a search sees; shares ``free``."""
        return self.ladders.of(self.nodes, self.free)

    def free_inside(self, box: JointBox) -> np.ndarray:
        """Return which nodes are free and lie in a box, shape (n_columns, n_rows)."""
        return np.asarray(self.free & box.holds(np.nan_to_num(self.nodes.q, nan=np.inf)))

    def block_edges(
        self, column: int, from_rows: list[int], to_rows: list[int], cause: str
    ) -> None:
        """Block every edge from some rows of a column to some of the next."""
        self.blocked.update(
            self._edge_key(column, row, after) for row in from_rows for after in to_rows
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
        key = int(self.nodes.ik_branch[column]), column
        known = self._collides.get(key, np.empty(0, dtype=np.int8))
        more = int(self.nodes.position_index.max()) + 1 - len(known)
        if more > 0:
            # -1 where nothing is known
            known = self._collides[key] = np.append(known, np.full(more, -1, dtype=np.int8))
        new = rows[known[positions] < 0]
        if len(new):
            asked, first = np.unique(self.nodes.position_index[new], return_index=True)
            known[asked] = scene.collides(self.nodes.at(column, new[first]))
        hit = known[positions] > 0
        self.free[column, rows[hit]] = False
        self.causes[column, cause] += int(hit.sum())

    def allows(self, rows: np.ndarray) -> bool:
        """Return whether nothing on a track is blocked."""
        columns = np.arange(len(rows))
        keys = self._edge_key(columns[:-1], rows[:-1], rows[1:])
        blocked = self.blocked_edges
        at = np.searchsorted(blocked, keys)
        met = blocked[np.minimum(at, len(blocked) - 1)] == keys if len(blocked) else False
        return bool(self.free[columns, rows].all() and not np.any(met))

    def _edge_key(self, column: Any, row: Any, next_row: Any) -> Any:
        """Return the numbers under which ladders know edges."""
        n_rows = self.free.shape[1]
        return (column * n_rows + row) * n_rows + next_row


class Ladders:
    """Makes the ladders of a problem when they are asked for, and keeps those used last.

    Args:
        problem: The problem.
    """

    def __init__(self, problem: GrindingProblem) -> None:
        self._problem = problem
        self._made: dict[int, tuple[NodeMatrix, Ladder]] = {}

    def of(self, nodes: NodeMatrix, free: np.ndarray) -> Ladder:
        """Return the ladder of a matrix, with the nodes that may be used."""
        kept = self._made.pop(id(nodes), None)
        if kept is None or kept[1].free is not free:
            kept = nodes, self._problem.ladder(nodes, free)
            room = AT_HAND - free.size
            while self._made and sum(one.free.size for _, one in self._made.values()) > room:
                del self._made[next(iter(self._made))]
        self._made[id(nodes)] = kept
        return kept[1]


def open_matrices(problem: GrindingProblem) -> list[OpenMatrix]:
    """Return every matrix of a problem, nothing blocked yet but nodes that cut into the wheel."""
    matrices, ladders = [], Ladders(problem)
    collides: dict[tuple[int, int], np.ndarray] = {}
    for nodes in problem.field.matrices:
        free = problem.free_nodes(nodes)
        matrices.append(OpenMatrix(nodes, free, ladders, _collides=collides))
    return matrices


def columns_without_nodes(matrices: Sequence[OpenMatrix]) -> list[int]:
    """Return columns in which no node of any matrix is free: the middle one of each run of them."""
    shut = np.flatnonzero(~np.any([matrix.free.any(axis=1) for matrix in matrices], axis=0))
    runs = np.split(shut, np.flatnonzero(np.diff(shut) > 1) + 1)
    return [int(run[len(run) // 2]) for run in runs if len(run)]


def close_collisions(
    matrices: Sequence[OpenMatrix], scene: CollisionScene, leave_some: bool = False
) -> None:
    """Close every node that collides in matrices of the same places and contact positions.

    Where that leaves nothing of a column, ``leave_some`` leaves the column as it is.
    """
    hits: dict[bytes, np.ndarray] = {}
    asked: dict[bytes, np.ndarray] = {}
    for matrix in matrices:
        # full turns bring the same bodies to the same places
        branch = matrix.nodes.ik_branch.tobytes()
        hit = hits.setdefault(branch, np.zeros_like(matrix.free))
        known = asked.setdefault(branch, np.zeros_like(matrix.free))
        now = matrix.free & ~known
        hit[now] = scene.collides(matrix.nodes.q[now])
        known |= now
        closed = hit & (matrix.free & ~hit).any(axis=1, keepdims=True) if leave_some else hit
        matrix.free &= ~closed
