"""In which order and direction passes leave the shortest links between them."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array, rotation_angle

# a turn of one radian counts as this length [m], about the size of a part in the hand
_LENGTH_PER_TURN = 0.1

_MAX_STARTS = 24
_MAX_SWEEPS = 30


def shortest_links(Ts_ends: Array) -> list[tuple[int, int]]:
    """Return an order of passes with a short link from the end of each to the start of the next.

    The nearest next pass is taken, from several first ones; then parts of the best order are
    turned round as long as that makes it shorter. That is not always the shortest of all.

    Args:
        Ts_ends: Frames at both ends of each pass, shape (n, 2, 4, 4).

    Returns:
        The passes, each with 1 if it is travelled forwards and -1 if backwards.
    """
    n = len(Ts_ends)
    ends = Ts_ends.reshape(2 * n, 4, 4)
    links = np.linalg.norm(ends[:, None, :3, 3] - ends[None, :, :3, 3], axis=-1)
    links += _LENGTH_PER_TURN * rotation_angle(ends[:, None], ends[None, :])
    starts = np.unique(np.linspace(0, 2 * n - 1, min(2 * n, _MAX_STARTS)).astype(int))
    tours = [_improved(links, _nearest_next(links, int(start))) for start in starts]
    best = min(tours, key=lambda tour: round(_length(links, tour), 9))
    return [(end // 2, 1 if end % 2 == 0 else -1) for end in best.tolist()]


# a tour holds, for each pass, the end at which it is begun: 2 i forwards, 2 i + 1 backwards


def _nearest_next(links: Array, start: int) -> np.ndarray:
    n = len(links) // 2
    free = np.ones(2 * n, dtype=bool)
    tour = [start]
    for _ in range(n - 1):
        free[[tour[-1], tour[-1] ^ 1]] = False
        tour.append(int(np.argmin(np.where(free, links[tour[-1] ^ 1], np.inf))))
    return np.array(tour)


def _improved(links: Array, tour: np.ndarray) -> np.ndarray:
    """Turn parts of a tour round: they are then begun at the other end of their last pass."""
    n = len(tour)
    for _ in range(_MAX_SWEEPS):
        changed = False
        for i in range(n):
            ends = np.arange(i, n)
            gain = np.zeros(n - i)
            if i > 0:
                left = tour[i - 1] ^ 1
                gain += links[left, tour[i]] - links[left, tour[ends] ^ 1]
            inner = ends[:-1]
            following = tour[inner + 1]
            gain[:-1] += links[tour[inner] ^ 1, following] - links[tour[i], following]
            j = int(np.argmax(gain))
            if gain[j] > 1e-9:
                tour[i : i + j + 1] = tour[i : i + j + 1][::-1] ^ 1
                changed = True
        if not changed:
            break
    return tour


def _length(links: Array, tour: np.ndarray) -> float:
    return float(links[tour[:-1] ^ 1, tour[1:]].sum())
