"""What holds the least box up: the cutter points that press on its faces, and what each costs.

The linear program of the least box has a price for each wall and face: how much the box would
shrink if that wall pressed a little less there. Without a wall the others still bound the box from
below: no change at that place alone can gain more than the difference.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from opl.geometry.frames import Array
from opl.search.least_box import BoxProof
from opl.search.walls import Image, Piece, Wall

PRESSES = 0.05  # share of a face's price below which a wall is not said to hold it
LEAST_SHARE = 0.01  # of the sum that a joint must turn to be told of
MOST_HOLDERS = 6
MOST_SUBPROBLEMS = 2000  # for what a box needs without a wall
GAP = 2e-3  # to which these proofs are taken


@dataclass(frozen=True)
class Holder:
    """A place that keeps the joint range sum from being smaller.

    Attributes:
        place: Cutter point, fractional between two.
        pass_index: Its pass.
        joints: Those whose range it holds, the dearest first.
        bound_without: No motion has a smaller joint range sum even if this place need not be
            ground, in [rad].
    """

    place: float
    pass_index: int
    joints: tuple[int, ...]
    bound_without: float


def holders(
    walls: Sequence[Wall],
    images: Callable[[int], Sequence[Image]],
    cut: Callable[[Piece, int], Sequence[Piece]],
    value: float,
) -> tuple[Holder, ...]:
    """Return what holds the least box over some walls up, what could gain most first.

    Args:
        walls: The walls.
        images: The images of each family.
        cut: Cuts a cell of a wall into smaller ones.
        value: Size of a box that is large enough, in [rad].
    """
    _, spans = _least(walls, images, cut, value)
    prices = _prices(spans, len(walls))
    pressing = np.argsort(-prices.sum(axis=1), kind="stable")[:MOST_HOLDERS].tolist()
    found = []
    for k in pressing:
        joints = np.argsort(-prices[k], kind="stable")
        held = tuple(joint for joint in joints.tolist() if prices[k, joint] >= PRESSES)
        if not held:
            continue
        others = [wall for index, wall in enumerate(walls) if index != k]
        without, _ = _least(others, images, cut, value)
        found.append(Holder(walls[k].place, walls[k].pass_index, held, without))
    return tuple(sorted(found, key=lambda one: one.bound_without))


def _prices(spans: list[tuple[int, Array]], n_walls: int) -> Array:
    """Return how hard each wall presses on the two faces of each joint, shape (n_walls, 6).

    From the linear program of the least box over the spans, each relaxed to its chord and pads.
    """
    prices = np.zeros((n_walls, 6))
    alone = [(wall, cells) for wall, cells in spans if [w for w, _ in spans].count(wall) == 1]
    k = len(alone)
    if k == 0:
        return prices
    rows, limits = np.zeros((k, 12, 12 + k)), np.zeros((k, 12))
    for i, (_, cells) in enumerate(alone):
        first, along = cells[0, :6], cells[-1, 6:12] - cells[0, :6]
        x = (cells[:, 24:26] - cells[0, 24]) / (cells[-1, 25] - cells[0, 24])
        away = np.stack([cells[:, :6], cells[:, 6:12]], axis=1) - first - x[..., None] * along
        low = (away.min(axis=1) + cells[:, 12:18]).min(axis=0)
        high = (away.max(axis=1) + cells[:, 18:24]).max(axis=0)
        rows[i, :6, :6], rows[i, 6:, 6:12] = -np.eye(6), np.eye(6)
        rows[i, :6, 12 + i], rows[i, 6:, 12 + i] = along, -along
        limits[i, :6], limits[i, 6:] = -first - low, first + high
    cost = np.concatenate([np.ones(6), -np.ones(6), np.zeros(k)])
    bounds = [(None, None)] * 12 + [(0.0, 1.0)] * k
    solved = linprog(cost, rows.reshape(12 * k, -1), limits.ravel(), bounds=bounds)
    if solved.status == 0:
        by_face = -solved.ineqlin.marginals.reshape(k, 2, 6)
        ranges = solved.x[:6] - solved.x[6:12]
        by_face[..., ranges < LEAST_SHARE * ranges.sum()] = 0.0  # held by all alike
        prices[[wall for wall, _ in alone]] = np.abs(by_face[:, 0] - by_face[:, 1])
    return prices


def _least(
    walls: Sequence[Wall],
    images: Callable[[int], Sequence[Image]],
    cut: Callable[[Piece, int], Sequence[Piece]],
    value: float,
) -> tuple[float, list[tuple[int, Array]]]:
    """Return what no box over walls is smaller than, and the spans that the least one meets.

    No spans where the least box was not found.
    """
    proof = BoxProof(images, cut, value * (1.0 + GAP), GAP / 2.0)
    for wall in walls:
        proof.add(wall)
    while not proof.closed and proof.subproblems < MOST_SUBPROBLEMS:
        bound = proof.lower_bound
        candidate = proof.take_next()
        if candidate is None:
            continue
        if candidate.settled:
            return min(max(bound, candidate.bound), value), proof.kept_spans
        proof.split()
    return min(proof.lower_bound, value), []
