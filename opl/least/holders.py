"""What holds the least box up: the cutter points that press on its faces, and what each costs.

The linear program of the least box has a price for each wall and face: how much the box would
shrink if that wall pressed a little less there. Without a wall the others still bound the box from
below: no change at that place alone can gain more than the difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from opl.files.beside import Beside
from opl.geometry.frames import Array
from opl.planning.plan import Holder
from opl.search.box import JointBox
from opl.search.forbidden import Forbidden
from opl.search.joint_limits import UNLIMITED
from opl.search.least_box import BoxProof
from opl.search.walls import Image, Piece, Wall

PRESSES = 0.05  # share of a face's price below which a wall is not said to hold it
LEAST_SHARE = 0.01  # of the sum that a joint must turn to be told of
MOST_HOLDERS = 6
MOST_SUBPROBLEMS = 1000  # bounded, for what a box needs without a wall
MOST_NUMBERS = 3e8  # worked on in linear programs for it
GAP = 2e-3  # to which these proofs are taken


def holders(
    walls: Sequence[Wall],
    images: Callable[[int], Sequence[Image]],
    cut: Callable[[Piece, int], Sequence[Piece]],
    value: float,
    forbidden: Forbidden | None = None,
    limits: Sequence[JointBox] = UNLIMITED,
    beside: Beside | None = None,
) -> tuple[Holder, ...]:
    """Return what holds the least box over some walls up, what could gain most first.

    Args:
        walls: The walls.
        images: The images of each family.
        cut: Cuts a cell of a wall into smaller ones.
        value: Size of a box that is large enough, in [rad].
        forbidden: Tells which parts of cells are forbidden; nothing more is looked at.
        limits: What a box is within, as of `BoxProof`.
        beside: What may work beside this process, if anything.
    """
    known = None if forbidden is None else _Known(forbidden)
    proof = BoxProof(images, cut, value * (1.0 + GAP), GAP / 2.0, known, limits)
    for wall in walls:
        proof.add(wall)
    _, prices = _least(proof, value)
    pressing = np.argsort(-prices.sum(axis=1), kind="stable")[:MOST_HOLDERS].tolist()
    held = {}
    for k in pressing:
        joints = np.argsort(-prices[k], kind="stable").tolist()
        held[k] = tuple(joint for joint in joints if prices[k, joint] >= PRESSES)
    pressing = [k for k in pressing if held[k]]
    # what tells what is forbidden asks solids, which are not passed on
    shared = beside if beside is not None and forbidden is None else Beside()
    bounds = shared.share(_bounding, (proof, value), pressing)
    found = [
        Holder(walls[k].place, walls[k].pass_index, held[k], without)
        for k, without in zip(pressing, bounds, strict=True)
    ]
    return tuple(sorted(found, key=lambda one: one.bound_without))


class _Known:
    """Tells what is known to be forbidden, and looks no further.

    Args:
        forbidden: Knows it.
    """

    def __init__(self, forbidden: Forbidden) -> None:
        self._forbidden = forbidden
        self.n_flips = forbidden.n_flips

    def clear(
        self, piece: Piece, flip: int, first: int, end: int, looks: int
    ) -> tuple[Array, Array]:
        """Return what `Forbidden.clear` does where no cell is asked about."""
        return self._forbidden.clear(piece, flip, first, first, looks)


@contextmanager
def _bounding(proof: BoxProof, value: float) -> Iterator[Callable[[int], float]]:
    """Open what tells what no box over all walls but one is smaller than, given its number."""
    yield lambda k: _least(proof.without(k), value)[0]


def _least(proof: BoxProof, value: float) -> tuple[float, Array]:
    """Return what no box over the walls is smaller than, and how hard each presses on the least.

    On the two faces of each joint, shape (n_walls, 6); 0 where the least box was not found.
    """
    while not proof.closed:
        if proof.bounded >= MOST_SUBPROBLEMS or proof.work >= MOST_NUMBERS:
            break
        bound = proof.lower_bound
        candidate = proof.take_next()
        if candidate is None:
            continue
        prices = np.abs(proof.pressing())
        ranges = candidate.high - candidate.low
        prices[:, ranges < LEAST_SHARE * ranges.sum()] = 0.0  # held by all alike
        return min(max(bound, candidate.bound), value), prices
    return min(proof.lower_bound, value), np.zeros((len(proof.walls), 6))
