"""Subproblems of the search for the least box, and what is found of them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from opl.geometry.frames import Array
from opl.search.cells import END, FIRST, KEY, WALL, Key

MOST_PRICED = 3000  # cells of a wall that is priced; one with more is split before


@dataclass(frozen=True)
class Relaxation:
    """The least box over the convex hulls of the walls.

    Attributes:
        low: Lower faces of the box found, shape (6,).
        high: Upper faces.
        lost: How much more a wall would press had its cells no pads, in [rad], shape (k,).
        pressed: How hard a wall presses on all faces together, each from 0 to 1, shape (k,).
        closing: Bounds beyond this were of no interest when it was found, in [rad].
        changes: How often cells had become shorter by then.
    """

    low: Array
    high: Array
    lost: Array
    pressed: Array
    closing: float
    changes: int


@dataclass(order=True)
class Subproblem:
    """Boxes of which it is known through which spans they lead.

    Attributes:
        bound: None of them is smaller, in [rad].
        number: To order those with equal bounds.
        spans: The spans, sorted by their walls, columns as in `cells`, shape (n, 5).
        n_walls: Of how many walls.
        low: The lower faces are not above these, in [rad], shape (6,).
        high: The upper faces are not below these.
    """

    bound: float
    number: int
    spans: np.ndarray = field(compare=False)
    n_walls: int = field(compare=False)
    low: Array = field(compare=False)
    high: Array = field(compare=False)
    found: Relaxation | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Candidate:
    """A box that holds a point of every wall, as far as the proof can tell.

    It is settled: nothing is gained by splitting its subproblem further.

    Attributes:
        bound: Of its subproblem in [rad].
        low: Lower faces in [rad], shape (6,).
        high: Upper faces.
        keys: The families and images that each pass with walls has left, by pass.
        mirrored: Whether the whole motion has the wrist flipped; the box is that of the other.
    """

    bound: float
    low: Array
    high: Array
    keys: dict[int, list[Key]]
    mirrored: bool


def worth_a_price(spans: np.ndarray) -> np.ndarray:
    """Return which spans are of walls with so few cells left that they are worth a price."""
    if (spans[:, END] - spans[:, FIRST]).sum() <= MOST_PRICED:
        return np.ones(len(spans), dtype=bool)
    cells = np.bincount(spans[:, WALL], weights=spans[:, END] - spans[:, FIRST])
    return np.asarray(cells[spans[:, WALL]] <= MOST_PRICED)


def keys_left(spans: np.ndarray, pass_index: np.ndarray) -> dict[int, np.ndarray]:
    """Return the numbers of the keys that spans have, by pass: all that its walls may have.

    Args:
        spans: The spans.
        pass_index: Of each wall.
    """
    of_pass = pass_index[spans[:, WALL]]
    passes = np.unique(of_pass).tolist()
    return {index: np.unique(spans[of_pass == index, KEY]) for index in passes}
