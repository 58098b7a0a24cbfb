"""The smoothest track: least joint travel, by exact dynamic programming over the ladder.

Each column is passed once; the cost of the best way to each of its nodes is all that is kept, no
step is ever stored.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from opl.geometry.frames import Array
from opl.planning.ladder import Ladder, allowed


@dataclass(frozen=True)
class Roughness:
    """What a track is charged for.

    Attributes:
        joint_weights: Cost of turning each joint in [1/rad], shape (6,).
        contact_weight: Cost of changing t by one belt unit on the wheel: the belt dwells while t
            moves.
        time_weight: Cost of a second on the wheel in [1/s].
        step_seconds: Time that the feed gives each step in [s], shape (n_columns - 1,); 0 off the
            wheel.
        max_speed: Largest joint speeds in [rad/s], shape (6,): a step may need longer for them.
        node_cost: Cost of being at each node, shape (n_columns, n_rows).
    """

    joint_weights: Array
    contact_weight: float
    time_weight: float
    step_seconds: Array
    max_speed: Array
    node_cost: Array


@dataclass(frozen=True)
class SmoothTrack:
    """The cheapest track.

    Attributes:
        rows: The row in each column, shape (n_columns,).
        cost: Its cost.
    """

    rows: np.ndarray
    cost: float


def smoothest(
    ladder: Ladder, blocked: np.ndarray, inside: np.ndarray, roughness: Roughness
) -> SmoothTrack | None:
    """Return the connected track with the least cost, or None if there is no connected track.

    Among equal ones the lowest rows are taken, so the answer is always the same.

    Args:
        ladder: The nodes and what steps are small enough.
        blocked: Sorted keys of steps that are not free, int64.
        inside: Which of the free nodes may be used, shape (n_columns, n_rows).
        roughness: The costs.
    """
    rows = np.empty(len(ladder.q), dtype=np.int64)
    cost = _cheapest(
        ladder.q_by_joint,
        ladder.free & inside,
        ladder.contact_position,
        ladder.off_wheel,
        ladder.max_contact_step,
        ladder.contact_changes,
        ladder.max_joint_step,
        np.asarray(blocked, dtype=np.int64),
        np.array(roughness.joint_weights),
        roughness.contact_weight,
        roughness.time_weight,
        np.array(roughness.step_seconds),
        np.array(roughness.max_speed),
        np.ascontiguousarray(roughness.node_cost),
        rows,
    )
    return SmoothTrack(rows, cost) if np.isfinite(cost) else None


@njit(
    "float64(float64[:,:,::1],boolean[:,::1],float64[::1],boolean[::1],float64,float64[::1],float64,"
    "int64[::1],float64[::1],float64,float64,float64[::1],float64[::1],float64[:,::1],int64[::1])",
    cache=True,
)
def _cheapest(  # type: ignore[no-untyped-def]
    q, free, t, off_wheel, max_t_step, max_t_change, max_q_step, blocked,
    joint_weights, contact_weight, time_weight, step_seconds, max_speed, node_cost, rows,
):  # fmt: skip
    n_columns, n_joints, n_rows = q.shape
    best = np.full(n_rows, np.inf)
    following = np.empty(n_rows)
    before = np.full((n_columns, n_rows), -1, dtype=np.int32)
    for row in range(n_rows):
        if free[0, row]:
            best[row] = node_cost[0, row]
    for column in range(1, n_columns):
        step_weight = 0.0 if off_wheel[column - 1] else contact_weight
        for row in range(n_rows):
            following[row] = np.inf
            if not free[column, row]:
                continue
            for here in range(n_rows):
                cost = best[here] + step_weight * abs(t[row] - t[here])
                if cost >= following[row]:
                    continue
                seconds = step_seconds[column - 1]
                for joint in range(n_joints):
                    turned = abs(q[column, joint, row] - q[column - 1, joint, here])
                    cost += joint_weights[joint] * turned
                    seconds = max(seconds, turned / max_speed[joint])
                if not off_wheel[column - 1]:
                    cost += time_weight * seconds
                if cost < following[row] and allowed(
                    q, t, off_wheel, max_t_step, max_t_change, max_q_step, blocked,
                    column - 1, here, row,
                ):  # fmt: skip
                    following[row] = cost
                    before[column, row] = here
            following[row] += node_cost[column, row]
        best[:] = following
    row = np.argmin(best)
    total = best[row]
    if total == np.inf:
        return total
    for column in range(n_columns - 1, -1, -1):
        rows[column] = row
        row = before[column, row]
    return total
