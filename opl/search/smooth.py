"""The smoothest track: least joint travel, by exact dynamic programming over the ladder.

Each column is passed once; the cost of the best track to each of its nodes is all that is kept, no
edge is ever stored.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.search.ladder import EDGE_RULE, Ladder, allowed

DEARER = 2.0 ** np.arange(1, 6)  # times the price of moving t
LEAST_CONTACT_WEIGHT = 0.01  # where t may move for nothing


@dataclass(frozen=True)
class TrackCost:
    """What a track is charged for.

    Attributes:
        joint_weights: Cost of turning each joint in [1/rad], shape (6,).
        contact_weight: Cost of changing t by one belt unit on the wheel: the belt dwells while t
            moves.
        time_weight: Cost of a second on the wheel in [1/s].
        edge_seconds: Time that the feed gives each edge in [s], shape (n_columns - 1,); 0 off the
            wheel.
        max_speed: Largest joint speeds in [rad/s], shape (6,): an edge may need longer for them.
        contact_speed: Largest speed of t in belt units per second: likewise.
        node_cost: Cost of being at each node, shape (n_columns, n_rows).
    """

    joint_weights: Array
    contact_weight: float
    time_weight: float
    edge_seconds: Array
    max_speed: Array
    contact_speed: float
    node_cost: Array


@dataclass(frozen=True)
class Travel:
    """How far joints and contact move on the wheel along a track or a path.

    Attributes:
        joints: Sum over edges and joints of the absolute change in [rad].
        contact: Sum over edges of the absolute change of t in belt units.
    """

    joints: float
    contact: float

    def within(self, most: Travel) -> bool:
        """Return whether neither moves further; round-off is forgiven."""
        return self.joints <= most.joints + 1e-9 and self.contact <= most.contact + 1e-9


@dataclass(frozen=True)
class SmoothTrack:
    """The cheapest track: its row in each column, shape (n_columns,), and its cost."""

    rows: np.ndarray
    cost: float


def smoothest(
    ladder: Ladder, blocked: np.ndarray, inside: np.ndarray, cost: TrackCost
) -> SmoothTrack | None:
    """Return the connected track with the least cost, or None if there is no connected track.

    Among equal ones the lowest rows are taken, so the answer is always the same.

    `blocked` are the sorted keys of the edges that are not free, int64; `inside` says which of the
    free nodes may be used, shape (n_columns, n_rows).
    """
    rows = np.empty(len(ladder.q), dtype=np.int64)
    total = _cheapest(
        ladder.edge_rule,
        ladder.free & inside,
        np.asarray(blocked, dtype=np.int64),
        np.array(cost.joint_weights),
        cost.contact_weight,
        cost.time_weight,
        np.array(cost.edge_seconds),
        np.array(cost.max_speed),
        cost.contact_speed,
        np.ascontiguousarray(cost.node_cost),
        rows,
    )
    return SmoothTrack(rows, total) if np.isfinite(total) else None


def travel_of(ladder: Ladder, rows: np.ndarray) -> Travel:
    """Return how far joints and contact move along a track, node to node."""
    on_wheel = ~ladder.off_wheel
    turned = np.abs(np.diff(ladder.q[np.arange(len(rows)), rows], axis=0))
    moved = np.abs(np.diff(ladder.t_of_nodes[np.arange(len(rows)), rows]))
    return Travel(float(turned[on_wheel].sum()), float(moved[on_wheel].sum()))


def smoothest_within(
    ladder: Ladder, blocked: np.ndarray, inside: np.ndarray, cost: TrackCost, most: Travel
) -> SmoothTrack | None:
    """Return the cheapest track that moves no further than another did, or just the cheapest.

    Movement of t is made dearer until the cheapest track keeps to both; where none of the prices
    tried leads to such a track, the prices given decide. None if there is no connected track.

    Joints and contact should move no further than `most`; all else is as in `smoothest`.
    """
    cheapest = smoothest(ladder, blocked, inside, cost)
    if cheapest is None or travel_of(ladder, cheapest.rows).within(most):
        return cheapest
    for price in DEARER * max(cost.contact_weight, LEAST_CONTACT_WEIGHT):
        dearer = replace(cost, contact_weight=float(price))
        track = smoothest(ladder, blocked, inside, dearer)
        if track is not None and travel_of(ladder, track.rows).within(most):
            return track
    return cheapest


@kernel(
    f"float64({EDGE_RULE},boolean[:,::1],int64[::1],float64[::1],float64,float64,float64[::1],"
    "float64[::1],float64,float64[:,::1],int64[::1])",
    early=True,
    makes_arrays=True,
)
def _cheapest(  # type: ignore[no-untyped-def]
    edge_rule, free, blocked, joint_weights, contact_weight, time_weight, edge_seconds, max_speed,
    contact_speed, node_cost, rows,
):  # fmt: skip
    q, t, off_wheel = edge_rule[:3]
    n_columns, n_joints, n_rows = q.shape
    best = np.full(n_rows, np.inf)
    following = np.empty(n_rows)
    before = np.full((n_columns, n_rows), -1, dtype=np.int32)
    for row in range(n_rows):
        if free[0, row]:
            best[row] = node_cost[0, row]
    price = np.empty(n_rows)  # of a row, coming from each row of the column before
    seconds = np.empty(n_rows)
    for column in range(1, n_columns):
        on_wheel = not off_wheel[column - 1]
        for row in range(n_rows):
            following[row] = np.inf
            if not free[column, row]:
                continue
            # the inner loops have no branches: they are what the time goes into
            for here in range(n_rows):
                price[here] = best[here]
            if on_wheel:
                for here in range(n_rows):
                    price[here] += contact_weight * abs(t[column, row] - t[column - 1, here])
            for joint in range(n_joints):
                there = q[column, joint, row]
                weight = joint_weights[joint]
                for here in range(n_rows):
                    price[here] += weight * abs(there - q[column - 1, joint, here])
            if on_wheel and time_weight > 0.0:
                for here in range(n_rows):
                    sliding = abs(t[column, row] - t[column - 1, here]) / contact_speed
                    seconds[here] = max(edge_seconds[column - 1], sliding)
                for joint in range(n_joints):
                    there = q[column, joint, row]
                    for here in range(n_rows):
                        turning = abs(there - q[column - 1, joint, here]) / max_speed[joint]
                        seconds[here] = max(seconds[here], turning)
                for here in range(n_rows):
                    price[here] += time_weight * seconds[here]
            cheapest = -1
            least = np.inf
            for here in range(n_rows):
                if price[here] < least:  # never for NaN, the price of a node that is not there
                    least = price[here]
                    cheapest = here
            if cheapest < 0:
                continue
            if allowed(edge_rule, blocked, column - 1, cheapest, row):
                following[row] = least
                before[column, row] = cheapest
            else:
                for here in range(n_rows):
                    if price[here] < following[row] and allowed(
                        edge_rule, blocked, column - 1, here, row
                    ):
                        following[row] = price[here]
                        before[column, row] = here
            following[row] += node_cost[column, row]
        best[:] = following
    row = int(np.argmin(best))
    total = best[row]
    if total == np.inf:
        return total
    for column in range(n_columns - 1, -1, -1):
        rows[column] = row
        row = before[column, row]
    return total
