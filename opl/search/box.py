"""Joint boxes: how small a box can be that holds a connected track.

The joint range sum of a track is the size of the box that its nodes span. The functions here look
at one core, the part of joint space that every box under consideration is known to contain, and
compute what it costs to take in one node more, of some columns, of all, or of a whole track.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from opl.geometry.frames import Array


@dataclass(frozen=True)
class JointBox:
    """A range for each joint.

    Attributes:
        lower: Lower faces in [rad], shape (6,).
        upper: Upper faces in [rad], shape (6,).
    """

    lower: Array
    upper: Array

    @property
    def size(self) -> float:
        """Sum of the edges in [rad]: the joint range sum of a track that touches every face."""
        return float(np.sum(self.upper - self.lower))

    def widened(self, amount: float) -> JointBox:
        """Return the box that is larger by ``amount`` in [rad] in all, the same at every face."""
        step = amount / (2.0 * len(self.lower))
        return JointBox(self.lower - step, self.upper + step)

    def holds(self, q: Array) -> np.ndarray:
        """Return which ``q``, shape (..., 6), lie inside; round-off at a face is forgiven."""
        inside = (q >= self.lower - 1e-12) & (q <= self.upper + 1e-12)
        return np.asarray(inside.all(axis=-1))


def size_of(low: Array, high: Array) -> float:
    """Return the size of a core in [rad], 0 while it is empty."""
    return float(np.maximum(high - low, 0.0).sum())


_Q, _B = "float64[:,:,::1]", "boolean[:,::1]"
_F1, _I1 = "float64[::1]", "int64[::1]"


@njit(f"void({_Q},int64,int64,int64,{_F1},{_F1},{_F1})", cache=True)
def sizes_with(q, column, first, last, low, high, sizes):  # type: ignore[no-untyped-def]
    """Fill in the size of the core with each node of a column taken in, rows first to last."""
    sizes[first : last + 1] = 0.0
    for joint in range(q.shape[1]):
        low_joint = low[joint]
        high_joint = high[joint]
        for row in range(first, last + 1):
            value = q[column, joint, row]
            sizes[row] += max(value, high_joint) - min(value, low_joint)


@njit(
    f"Tuple((float64,int64))({_Q},{_B},{_I1},{_I1},{_I1},float64,{_F1},{_F1})",
    cache=True,
)
def tighten(q, free, columns, first, last, threshold, low, high):  # type: ignore[no-untyped-def]
    """Enlarge a core by what every box below a threshold must hold anyway.

    A node that would make the box as large as the threshold is out. What all the nodes left of a
    column have in common belongs to the core, which puts more nodes out, and so on.

    Args:
        q: Nodes in [rad], shape (n_columns, 6, n_rows).
        free: Which may be used, shape (n_columns, n_rows).
        columns: The columns looked at.
        first: First row in play of each column; raised where nodes are out, shape (n_columns,).
        last: Last row in play of each column; lowered likewise, shape (n_columns,).
        threshold: Boxes of this size or more in [rad] are of no interest.
        low: Largest value the lower faces can have; changed, shape (6,).
        high: Smallest value the upper faces can have; changed, shape (6,).

    Returns:
        A lower bound on the size of any box that holds a node in play of every one of the columns,
        infinite if none is smaller than the threshold; and the column that costs most to take in.
    """
    sizes = np.empty(q.shape[2])
    while True:
        changed = False
        worst = 0.0
        worst_column = -1
        for column in columns:
            sizes_with(q, column, first[column], last[column], low, high, sizes)
            cheapest = np.inf
            for row in range(first[column], last[column] + 1):
                if not free[column, row]:
                    sizes[row] = np.inf
                cheapest = min(cheapest, sizes[row])
            if cheapest >= threshold:
                return np.inf, column
            while sizes[first[column]] >= threshold:
                first[column] += 1
            while sizes[last[column]] >= threshold:
                last[column] -= 1
            for joint in range(q.shape[1]):
                least = np.inf
                greatest = -np.inf
                for row in range(first[column], last[column] + 1):
                    if sizes[row] < threshold:
                        least = min(least, q[column, joint, row])
                        greatest = max(greatest, q[column, joint, row])
                if least > high[joint] + 1e-12:
                    high[joint] = least
                    changed = True
                if greatest < low[joint] - 1e-12:
                    low[joint] = greatest
                    changed = True
            if cheapest > worst:
                worst = cheapest
                worst_column = column
        if not changed:
            return worst, worst_column


@njit(f"void({_Q},{_B},{_I1},{_I1},{_F1},{_F1})", cache=True)
def grow(q, free, first, last, low, high):  # type: ignore[no-untyped-def]
    """Enlarge a box until it holds a node in play of every column, the worst column first.

    Args:
        q: Nodes in [rad], shape (n_columns, 6, n_rows).
        free: Which may be used, shape (n_columns, n_rows).
        first: First row in play of each column, shape (n_columns,).
        last: Last row in play of each column, shape (n_columns,).
        low: Lower faces; changed, shape (6,).
        high: Upper faces; changed, shape (6,).
    """
    sizes = np.empty(q.shape[2])
    while True:
        size = 0.0
        for joint in range(q.shape[1]):
            size += max(high[joint] - low[joint], 0.0)
        worst = -np.inf
        worst_column = worst_row = 0
        for column in range(len(q)):
            sizes_with(q, column, first[column], last[column], low, high, sizes)
            cheapest = np.inf
            cheapest_row = -1
            for row in range(first[column], last[column] + 1):
                if free[column, row] and sizes[row] < cheapest:
                    cheapest = sizes[row]
                    cheapest_row = row
            if cheapest > worst:
                worst = cheapest
                worst_column = column
                worst_row = cheapest_row
        if worst_row < 0 or worst <= size + 1e-12:
            return
        for joint in range(q.shape[1]):
            value = q[worst_column, joint, worst_row]
            high[joint] = max(high[joint], value)
            low[joint] = min(low[joint], value)
