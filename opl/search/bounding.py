"""What no box below a size can hold is cut off the spans of a subproblem."""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.search.outside import nearest_on_chord
from opl.search.relaxation import ROUND_OFF

MOST_ROUNDS = 12  # of cutting spans off; more would cut little
STILL = 1e-6  # [rad] a core that grows by less in a round has stopped growing


@kernel("boolean(float64[:,::1],int64,float64[::1],float64[::1],float64[:,:,::1])")
def _within_limits(bounds, cell, low, high, limits):  # type: ignore[no-untyped-def]
    """Return whether a box about a core and a cell may be within any of the limits."""
    for k in range(len(limits)):
        kept = True
        for j in range(6):
            if limits[k, 1, j] < np.inf:
                least = min(bounds[cell, 6 + j], low[j]) + ROUND_OFF
                most = max(bounds[cell, j], high[j]) - ROUND_OFF
                if limits[k, 0, j] <= least and most <= limits[k, 1, j]:
                    continue  # mostly no full turn is needed
                turns = 2.0 * np.pi * np.ceil((most - limits[k, 1, j]) / (2.0 * np.pi))
                if limits[k, 0, j] + turns > least:
                    kept = False
                    break
        if kept:
            return True
    return False


@kernel(
    "Tuple((int64,int64,float64))(float64[:,::1],float64[::1],float64[::1],float64,"
    "float64[:,:,::1],float64[:,::1])"
)
def _kept(bounds, low, high, closing, limits, held):  # type: ignore[no-untyped-def]
    """Return the first cell of a span that some box below a size holds, and the end of the last.

    -1 for none; and the size of the smallest such box. Boxes are within limits, if there are any.
    ``held`` is filled with the greatest joint positions in these cells, then the least, in [rad],
    shape (1, 12): the other way round than bounds, a row that is within limits only if all are.
    """
    begin, stop, smallest = -1, -1, np.inf
    held[0, :6], held[0, 6:] = -np.inf, np.inf
    for cell in range(len(bounds)):
        size = 0.0
        for j in range(6):
            edge = max(bounds[cell, j], high[j]) - min(bounds[cell, 6 + j], low[j])
            size += max(edge, 0.0)
        if size < closing and (len(limits) == 0 or _within_limits(bounds, cell, low, high, limits)):
            begin = cell if begin < 0 else begin
            stop = cell + 1
            smallest = min(smallest, size)
            for j in range(6):
                held[0, j] = max(held[0, j], bounds[cell, 6 + j])
                held[0, 6 + j] = min(held[0, 6 + j], bounds[cell, j])
    return begin, stop, smallest


@kernel(
    "int64(float64[:,::1],float64[:,::1],int64[:,::1],int64[::1],int64,float64[:,:,::1],"
    "float64[::1],float64[::1],float64,float64[::1])",
    early=True,
    makes_arrays=True,
)
def tighten(bounds, shifts, spans, pass_index, n_keys, limits, low, high, closing, sizes):  # type: ignore[no-untyped-def]
    """Cut off what no box below a size can hold; return how many spans are left, 0 if none can be.

    Args:
        bounds: As of `Cells`.
        shifts: What the cells of each source are shifted by in [rad], shape (m, 6).
        spans: Sorted by their walls; those left are moved to the front, shape (n, 5).
        pass_index: Of each wall, shape (k,).
        n_keys: Number of keys.
        limits: Lower and upper ones of which the box keeps those of one flip, after full turns, the
            same of all it holds, in [rad], shape (m, 2, 6); infinite for joints without.
        low: The lower faces of the box are not above these, lowered, in [rad], shape (6,).
        high: The upper faces are not below these, raised.
        closing: The size in [rad].
        sizes: Filled with the least size of a box that reaches each wall, shape (k,).
    """
    n, n_walls = len(spans), len(pass_index)
    n_passes = 0
    for wall in range(n_walls):
        n_passes = max(n_passes, pass_index[wall] + 1)
    walls_of = np.zeros(n_passes, dtype=np.int64)
    for wall in range(n_walls):
        walls_of[pass_index[wall]] += 1
    least, most = np.empty(6), np.empty(6)
    # the core, and what is kept of a span, as seen from a span that is not shifted
    below, above, held = np.empty(6), np.empty(6), np.empty((1, 12))
    for _ in range(MOST_ROUNDS):
        change, left, k = 0.0, 0, 0
        for wall in range(n_walls):
            before, smallest = left, np.inf
            least[:], most[:] = np.inf, -np.inf
            while k < n and spans[k, 0] == wall:
                shift = shifts[spans[k, 2]]
                for j in range(6):
                    below[j], above[j] = low[j] - shift[j], high[j] - shift[j]
                own = bounds[spans[k, 3] : spans[k, 4]]
                begin, stop, size = _kept(own, below, above, closing, limits[:0], held)
                # where all of it is within limits together, which is the rule, so is each cell
                if begin >= 0 and not _within_limits(held, 0, below, above, limits):
                    begin, stop, size = _kept(own, below, above, closing, limits, held)
                if begin >= 0:
                    smallest = min(smallest, size)
                    for j in range(6):
                        least[j] = min(least[j], held[0, 6 + j] + shift[j])
                        most[j] = max(most[j], held[0, j] + shift[j])
                    for i in range(3):
                        spans[left, i] = spans[k, i]
                    spans[left, 3], spans[left, 4] = spans[k, 3] + begin, spans[k, 3] + stop
                    left += 1
                k += 1
            if left == before:
                return 0
            sizes[wall] = smallest
            for j in range(6):
                change = max(change, least[j] - high[j], low[j] - most[j])
                high[j], low[j] = max(high[j], least[j]), min(low[j], most[j])
        # each pass is left the postures that all of its walls have
        walls_with = np.zeros((n_passes, n_keys), dtype=np.int64)
        last_wall = np.full((n_passes, n_keys), -1)
        for k in range(left):
            at, key = pass_index[spans[k, 0]], spans[k, 1]
            if last_wall[at, key] != spans[k, 0]:
                last_wall[at, key] = spans[k, 0]
                walls_with[at, key] += 1
        n = 0
        kept = walls_of == 0
        for k in range(left):
            at = pass_index[spans[k, 0]]
            if walls_with[at, spans[k, 1]] == walls_of[at]:
                kept[at] = True
                for i in range(5):
                    spans[n, i] = spans[k, i]
                n += 1
        if not kept.all():
            return 0
        if change < STILL:
            break
    return n


@kernel(
    "float64[::1](float64[:,::1],float64[:,::1],int64[:,::1],float64[::1],float64[::1])",
    early=True,
    makes_arrays=True,
)
def distances(cells, shifts, spans, low, high):  # type: ignore[no-untyped-def]
    """Return by how much a box misses the chords of each span, shape (n,), in [rad]."""
    found = np.empty(len(spans))
    below, above = np.empty(6), np.empty(6)
    for k in range(len(spans)):
        for j in range(6):
            below[j], above[j] = low[j] - shifts[spans[k, 2], j], high[j] - shifts[spans[k, 2], j]
        # what is nearest by its joints, each for itself, soon rules out the others
        nearest, least, best = -1, np.inf, np.inf
        for cell in range(spans[k, 3], spans[k, 4]):
            if cells[cell, 12] > 0.0:
                continue  # forbidden
            away = 0.0
            for j in range(6):
                a, b = cells[cell, j], cells[cell, 6 + j]
                away += max(min(a, b) - above[j], 0.0) + max(below[j] - max(a, b), 0.0)
            if away < least:
                nearest, least = cell, away
        if nearest >= 0:
            best, _ = nearest_on_chord(cells[nearest, :6], cells[nearest, 6:12], below, above, best)
        for cell in range(spans[k, 3], spans[k, 4]):
            if best == 0.0:
                break
            if cells[cell, 12] <= 0.0 and cell != nearest:
                best, _ = nearest_on_chord(cells[cell, :6], cells[cell, 6:12], below, above, best)
        found[k] = best
    return found
