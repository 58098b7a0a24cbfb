"""A branch while it is searched: which of its nodes and steps were found not to be free."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from opl.cell.collision import CollisionScene
from opl.geometry.frames import Array
from opl.planning.nodes import NodeMatrix
from opl.planning.problem import GrindingProblem
from opl.planning.recursive import Ladder

SAME_SUM = 1e-6  # [rad] two tracks whose joint range sums differ by less are equally good


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
        reached: Largest number of columns that a search passed.
    """

    nodes: NodeMatrix
    ladder: Ladder
    free: np.ndarray
    blocked: set[int] = field(default_factory=set)
    causes: Counter[tuple[int, str]] = field(default_factory=Counter)
    reached: int = 0
    _swept: set[int] = field(default_factory=set)

    def block_step(self, column: int, rows: np.ndarray, cause: str) -> None:
        """Block the step that a track makes from a column to the next."""
        key = self.ladder.step_key(column, int(rows[column]), int(rows[column + 1]))
        self.blocked.add(key)
        self.causes[column, cause] += 1

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


def twins(branches: list[Branch], track: Track, lower: Array, upper: Array) -> list[Track]:
    """Return the tracks with the same contact positions and joint range sum, best margin first.

    The other flip of the wrist, or a full turn of a wrist axis, makes the same motion at another
    distance from the joint limits. ``track`` itself is among them.

    Args:
        branches: All branches.
        track: The track.
        lower: Lower joint limits in [rad], shape (6,).
        upper: Upper joint limits in [rad], shape (6,).
    """
    nodes = branches[track.branch].nodes
    positions = nodes.position_index[track.rows]
    total = _range_sum(nodes, track.rows)
    found = []
    for index, branch in enumerate(branches):
        for rows in _followers(branch, positions):
            if abs(_range_sum(branch.nodes, rows) - total) < SAME_SUM and branch.allows(rows):
                q = branch.nodes.q[np.arange(len(rows)), rows]
                margins = np.minimum(q - lower, upper - q).min(axis=0)
                nearness = float((1.0 / np.maximum(margins, 1e-3)).sum())
                found.append((nearness, Track(index, rows)))
    found.sort(key=lambda item: item[0])
    return [twin for _, twin in found] or [track]


def _range_sum(nodes: NodeMatrix, rows: np.ndarray) -> float:
    return float(np.ptp(nodes.q[np.arange(len(rows)), rows], axis=0).sum())


def _followers(branch: Branch, positions: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the tracks of a branch with given contact positions, one for each turn of the wrist."""
    nodes = branch.nodes
    for start in np.flatnonzero(nodes.position_index == positions[0]):
        rows = np.full(len(positions), start)
        for column in range(1, len(positions)):
            alike = np.flatnonzero(nodes.position_index == positions[column])
            away = np.abs(nodes.q[column, alike] - nodes.q[column - 1, rows[column - 1]]).sum(
                axis=1
            )
            if np.isnan(away).all():
                break
            rows[column] = alike[np.nanargmin(away)]
        else:
            if nodes.exists[0, start]:
                yield rows
