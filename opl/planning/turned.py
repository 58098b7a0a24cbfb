"""Configurations of nodes: kept as they are, or made of angles and full turns when asked for.

Matrices of one IK branch differ by full turns only. Its angles are kept once; the configurations of
a matrix are made of them where they are read, and all at once for a search.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.geometry.frames import Array

AT_ONCE = 20_000  # nodes: what is worked on at a time stays small beside what is kept


@dataclass(frozen=True)
class Kept:
    """Configurations as they are.

    Attributes:
        q: Joint positions in [rad], NaN where there is no configuration within the limits, shape
            (n_columns, n_rows, 6).
    """

    q: Array

    @cached_property
    def exists(self) -> np.ndarray:
        """Which nodes there are, shape (n_columns, n_rows)."""
        return np.ascontiguousarray(~np.isnan(self.q[..., 0]))

    def whole(self) -> Array:
        """Return all, shape (n_columns, n_rows, 6)."""
        return self.q

    def at(self, columns: np.ndarray | int, rows: np.ndarray | int) -> Array:
        """Return those of some nodes, shape (..., 6)."""
        return np.asarray(self.q[columns, rows])


@dataclass(frozen=True)
class Moved:
    """Configurations that others make at another place of joint space.

    Attributes:
        q: The others in [rad], shape (n_columns, n_rows, 6).
        exists: Which of them are made, shape (n_columns, n_rows).
        sign: 1 or -1 by joint, shape (6,).
        shift: What is added then in [rad], shape (6,).
        turns: Full turns added to that in [rad], shape (6,).
    """

    q: Array
    exists: np.ndarray
    sign: Array
    shift: Array
    turns: Array

    def whole(self) -> Array:
        """Return all, NaN where there is no node, shape (n_columns, n_rows, 6)."""
        return self._made

    def at(self, columns: np.ndarray | int, rows: np.ndarray | int) -> Array:
        """Return those of some nodes in [rad], NaN where there is none, shape (..., 6)."""
        return self._of(self.q[columns, rows], self.exists[columns, rows])

    @cached_property
    def _made(self) -> Array:
        return self._of(self.q, self.exists)

    def _of(self, q: Array, exists: np.ndarray) -> Array:
        made = q * self.sign + self.shift + self.turns
        return np.where(exists[..., None], made, np.nan)


@dataclass(frozen=True)
class Turned:
    """Angles of an IK branch, and the full turns that each row adds to them.

    Attributes:
        by_joint: Principal angles in [rad], shape (n_columns, 6, M).
        start: Where the angles of each joint are cut open in [rad], as in `unrolled`, shape (6,).
        turns: Full turns of each row in [rad], shape (n_rows, 6).
        position_index: Which of the M contact positions each row stands for, shape (n_rows,).
        exists: Which nodes there are, shape (n_columns, n_rows).
    """

    by_joint: Array
    start: Array
    turns: Array
    position_index: np.ndarray
    exists: np.ndarray

    def whole(self) -> Array:
        """Make all in [rad], NaN where there is no node, shape (n_columns, n_rows, 6)."""
        # in memory as the searches read them, who need no copy then
        by_joint = np.empty((len(self.exists), 6, len(self.turns)))
        for block in blocks_of(*self.exists.shape):
            q = by_joint[block]
            q[:] = self.by_joint[block][:, :, self.position_index]
            unroll(np.moveaxis(q, 1, 2), self.start)
            q += self.turns.T
            np.copyto(q, np.nan, where=~self.exists[block][:, None])
        return np.moveaxis(by_joint, 1, 2)

    def at(self, columns: np.ndarray | int, rows: np.ndarray | int) -> Array:
        """Make those of some nodes in [rad], NaN where there is none, shape (..., 6)."""
        columns, rows = np.broadcast_arrays(columns, rows)
        q = self.by_joint[columns, :, self.position_index[rows]]
        unroll(q, self.start)
        q += self.turns[rows]
        q[~self.exists[columns, rows]] = np.nan
        return np.asarray(q)


Configurations = Kept | Moved | Turned


def unroll(q: Array, start: Array) -> None:
    """Bring angles in [rad], shape (..., 6), to within a full turn from where they are cut open.

    Those of joints whose ``start`` is NaN, shape (6,), stay as they are.
    """
    for joint in np.flatnonzero(~np.isnan(start)):
        q[..., joint] = start[joint] + np.remainder(q[..., joint] - start[joint], 2.0 * np.pi)


def blocks_of(n_columns: int, n_rows: int) -> list[slice]:
    """Return slices of columns with about as many nodes as are worked on at once."""
    size = max(AT_ONCE // max(n_rows, 1), 1)
    return [slice(first, first + size) for first in range(0, n_columns, size)]
