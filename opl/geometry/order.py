"""In which order and direction passes leave the shortest way from the first to the last."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from opl.geometry.frames import Array, rotation_angle

MOST_EXACT = 10  # passes whose best order is found for certain

# a turn of one radian counts as this length [m], about the size of a part in the hand
_LENGTH_PER_TURN = 0.1

_MAX_STARTS = 24
_MAX_SWEEPS = 30
_DECIMALS = 9  # of what links cost: round-off does not decide between equals


def shortest_links(passes: Sequence[Array]) -> list[tuple[int, int]]:
    """Return an order of passes with a short link from the end of each to the start of the next.

    Args:
        passes: Frames of each pass in order, shapes (k, 4, 4).

    Returns:
        The passes, each with 1 if it is travelled forwards and -1 if backwards; see `least_tour`.
    """
    ends = np.concatenate([frames[[0, -1]] for frames in passes])
    links = np.linalg.norm(ends[:, None, :3, 3] - ends[None, :, :3, 3], axis=-1)
    links += _LENGTH_PER_TURN * rotation_angle(ends[:, None], ends[None, :])
    return least_tour(links, np.zeros(len(ends)))


def least_tour(links: Array, home: Array) -> list[tuple[int, int]]:
    """Return the order and direction of passes whose links cost least, from home to home.

    Up to `MOST_EXACT` passes by dynamic programming over sets of passes: none costs less. Of more
    the nearest next pass is taken, from several first ones; then parts of the best order are
    turned round as long as that makes it cheaper, which is not always the cheapest of all. The same
    way back costs the same: of the two the one is taken that begins with the lower pass.

    Args:
        links: What it costs to go from one end of a pass to another, ends 2 i and 2 i + 1 of pass
            i, symmetric, shape (2 n, 2 n).
        home: What it costs to go from home to an end, or back, shape (2 n,).

    Returns:
        The passes, each with 1 if it is travelled forwards and -1 if backwards.
    """
    links, home, n = links.round(_DECIMALS), home.round(_DECIMALS), len(home) // 2
    if n <= MOST_EXACT:
        best = _least(links, home)
    else:
        starts = np.unique(np.linspace(0, 2 * n - 1, min(2 * n, _MAX_STARTS)).astype(int))
        tours = [_improved(links, home, _nearest_next(links, int(start))) for start in starts]
        best = min(tours, key=lambda tour: round(_cost(links, home, tour), _DECIMALS))
    tour = min(best.tolist(), (best[::-1] ^ 1).tolist())
    return [(end // 2, 1 if end % 2 == 0 else -1) for end in tour]


# a tour holds, for each pass, the end at which it is begun: 2 i forwards, 2 i + 1 backwards


def _least(links: Array, home: Array) -> np.ndarray:
    """Return the cheapest tour, by dynamic programming over the sets of passes that are done."""
    n = len(home) // 2
    # of each set and the end at which its last pass was begun
    cost = np.full((1 << n, 2 * n), np.inf)
    before = np.zeros((1 << n, 2 * n), dtype=int)
    for end in range(2 * n):
        cost[1 << end // 2, end] = home[end]
    from_begun = links[np.arange(2 * n) ^ 1]  # a pass begun at an end is left at its other one
    for done in range(1, 1 << n):
        onward = cost[done][:, None] + from_begun
        least, came_from = onward.min(axis=0), onward.argmin(axis=0)
        for one in range(n):
            if not done >> one & 1:
                ends = slice(2 * one, 2 * one + 2)
                cost[done | 1 << one, ends] = np.minimum(cost[done | 1 << one, ends], least[ends])
                taken = cost[done | 1 << one, ends] == least[ends]
                kept = before[done | 1 << one, ends]
                before[done | 1 << one, ends] = np.where(taken, came_from[ends], kept)
    done = (1 << n) - 1
    tour = [int((cost[done] + home[np.arange(2 * n) ^ 1]).argmin())]
    while done ^ (1 << tour[0] // 2):
        last = tour[0]
        tour.insert(0, int(before[done, last]))
        done ^= 1 << last // 2
    return np.array(tour)


def _nearest_next(links: Array, start: int) -> np.ndarray:
    n = len(links) // 2
    free = np.ones(2 * n, dtype=bool)
    tour = [start]
    for _ in range(n - 1):
        free[[tour[-1], tour[-1] ^ 1]] = False
        tour.append(int(np.argmin(np.where(free, links[tour[-1] ^ 1], np.inf))))
    return np.array(tour)


def _improved(links: Array, home: Array, tour: np.ndarray) -> np.ndarray:
    """Turn parts of a tour round: they are then begun at the other end of their last pass."""
    n = len(tour)
    for _ in range(_MAX_SWEEPS):
        changed = False
        for i in range(n):
            ends = np.arange(i, n)
            before = home if i == 0 else links[tour[i - 1] ^ 1]
            gain = before[tour[i]] - before[tour[ends] ^ 1]
            inner = ends[:-1]
            following = tour[inner + 1]
            gain[:-1] += links[tour[inner] ^ 1, following] - links[tour[i], following]
            gain[-1] += home[tour[-1] ^ 1] - home[tour[i]]
            j = int(np.argmax(gain))
            if gain[j] > 1e-9:
                tour[i : i + j + 1] = tour[i : i + j + 1][::-1] ^ 1
                changed = True
        if not changed:
            break
    return tour


def _cost(links: Array, home: Array, tour: np.ndarray) -> float:
    return float(links[tour[:-1] ^ 1, tour[1:]].sum() + home[tour[0]] + home[tour[-1] ^ 1])
