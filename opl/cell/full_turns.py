"""Joint positions apart from full turns: a revolute joint is at the same place every 2 pi."""

from __future__ import annotations

from itertools import product

import numpy as np

from opl.geometry.frames import Array

FULL_TURN = 2.0 * np.pi


def principal(angle: Array) -> Array:
    """Return angles in [rad] turned into (-pi, pi], any shape."""
    angle = angle - FULL_TURN * np.ceil(angle / FULL_TURN - 0.5)
    # round-off must not carry a joint past pi, which may be its limit
    return np.minimum(angle, np.pi)


def angular_distance(q: Array, other: Array) -> Array:
    """Return how far joint positions in [rad] are apart but for full turns, 0 to pi, any shape."""
    return np.abs(principal(q - other))


def nearest_turn(q: Array, reference: Array) -> Array:
    """Return joint positions with the full turns that bring each nearest to a reference.

    All in [rad]; the shapes must broadcast.
    """
    return q + FULL_TURN * np.round((reference - q) / FULL_TURN)


def full_turns(lower: Array, upper: Array) -> Array:
    """Return the full turns after which a principal angle can lie within the limits.

    A joint whose range only touches the end of a further turn (S at exactly +-180 degrees) does not
    get that turn. The limits are in [rad], shape (6,).

    Returns:
        Multiples of 2 pi to add to q, in [rad], shape (k, 6): fewest turns first, so zero leads,
        where it is among them; among equals in ascending order.
    """
    touching = 1e-9  # [turns]
    first = np.floor(lower / FULL_TURN + 0.5 + touching).astype(int)
    last = np.ceil(upper / FULL_TURN - 0.5 - touching).astype(int)
    ranges = [range(low, high + 1) for low, high in zip(first, last, strict=True)]
    numbers = sorted(product(*ranges), key=lambda number: (sum(map(abs, number)), number))
    return FULL_TURN * np.array(numbers, dtype=float)
