"""The ladder graph that every search walks: nodes, and which edges between them are small."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array

EdgeRule = tuple[Array, Array, np.ndarray, float, Array, float, np.ndarray]
# as the inner loops take it: joint positions, t, off the wheel, most of steps and changes of t and
# of steps of joints, sides
EDGE_RULE = (
    "Tuple((float64[:,:,::1],float64[:,::1],boolean[::1],float64,float64[::1],float64,"
    "int16[:,:,::1]))"
)


@dataclass(frozen=True)
class Ladder:
    """A node matrix as the search sees it.

    Attributes:
        q: Joint positions in [rad], shape (n_columns, n_rows, 6); entries of nodes that are not
            free are not looked at.
        free: Which nodes may be used, shape (n_columns, n_rows).
        contact_position: t of each node, shape (n_columns, n_rows), or of each row, (n_rows,).
        off_wheel: Whether the edge from each column to the next leaves the wheel (a new pass),
            shape (n_columns - 1,). Such an edge has no intermediate nodes and may be of any size.
        max_contact_step: Largest difference of t between adjacent nodes, the paper's delta T.
        max_contact_change: Largest difference of t over each edge on the wheel, shape
            (n_columns - 1,) or one for all; the paper sets none.
        max_joint_step: Largest change of a joint between adjacent nodes in [rad]; more is taken for
            a discontinuity.
        sides: For each edge on which side of what is shut on the way its ends are, which an edge
            does not change: that of the rows of its column, and of those of the next, of int16,
            shape (n_columns - 1, 2, n_rows); None where nothing is shut.
    """

    q: Array
    free: np.ndarray
    contact_position: Array
    off_wheel: np.ndarray
    max_contact_step: float
    max_joint_step: float
    max_contact_change: Array | float = np.inf
    sides: np.ndarray | None = None

    @cached_property
    def t_of_nodes(self) -> Array:
        """Contact position of each node, shape (n_columns, n_rows)."""
        return np.array(np.broadcast_to(self.contact_position, self.q.shape[:2]), order="C")

    @cached_property
    def contact_changes(self) -> Array:
        """Largest difference of t over each edge, shape (n_columns - 1,)."""
        return np.broadcast_to(self.max_contact_change, len(self.q) - 1).astype(float)

    @cached_property
    def q_by_joint(self) -> Array:
        """Joint positions as the inner loop reads them, shape (n_columns, 6, n_rows)."""
        return np.ascontiguousarray(np.moveaxis(self.q, 1, 2))

    @cached_property
    def edge_rule(self) -> EdgeRule:
        """The nodes, and what makes an edge small enough, in the order of `EDGE_RULE`."""
        n_columns, n_rows = self.q.shape[:2]
        nothing = np.zeros((n_columns - 1, 2, n_rows), dtype=np.int16)
        return (
            self.q_by_joint,
            self.t_of_nodes,
            self.off_wheel,
            self.max_contact_step,
            self.contact_changes,
            self.max_joint_step,
            nothing if self.sides is None else self.sides,
        )

    def edge_key(self, column: int, row: int, next_row: int) -> int:
        """Return the number under which an edge is remembered as blocked."""
        n_rows = int(self.q.shape[1])
        return (column * n_rows + row) * n_rows + next_row


def middle_count(contact_step: float, max_contact_step: float) -> int:
    """Return how many intermediate nodes keep t from changing by more than delta T (equation 15).

    An edge exactly divisible by delta T does not repeat its end node.
    """
    return max(int(np.ceil(abs(contact_step) / max_contact_step - 1e-9)) - 1, 0)


@kernel(f"boolean({EDGE_RULE},int64,int64,int64)")
def continuous(edge_rule, column, here, row):  # type: ignore[no-untyped-def]
    """Return whether an edge to a row of the next column is small in t and in every joint."""
    q, t, off_wheel, max_t_step, max_t_change, max_q_step, sides = edge_rule
    if off_wheel[column]:
        return True
    t_step = abs(t[column + 1, row] - t[column, here])
    if t_step > max_t_change[column] + 1e-9:
        return False
    if sides[column, 0, here] != sides[column, 1, row]:
        return False
    largest = max_q_step * max(np.ceil(t_step / max_t_step - 1e-9), 1.0)
    for joint in range(q.shape[1]):
        if abs(q[column + 1, joint, row] - q[column, joint, here]) > largest:
            return False
    return True


@kernel("boolean(int64[::1],int64)")
def contains(keys, key):  # type: ignore[no-untyped-def]
    """Return whether a number is among sorted ones."""
    place = np.searchsorted(keys, key)
    return place < len(keys) and keys[place] == key


@kernel(f"boolean({EDGE_RULE},int64[::1],int64,int64,int64)")
def allowed(edge_rule, blocked, column, here, row):  # type: ignore[no-untyped-def]
    """Return whether an edge to a row of the next column is small enough and not blocked."""
    n_rows = edge_rule[0].shape[2]
    return continuous(edge_rule, column, here, row) and not contains(
        blocked, (column * n_rows + here) * n_rows + row
    )
