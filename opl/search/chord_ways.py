"""The cheapest way over chords of joint space, from column to column: what can be attained.

Over the ends of chords alone a way wobbles: a joint that it could hold still turns by what lies
between two ends, at each column. So a way may leave a column where a joint is held still, too. What
it costs to get there is taken to change evenly along a chord. That is no bound, but nearly what a
motion attains; as a potential it makes the lower bound sharp.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.search.cell_blocks import BLOCK, around_blocks, nearest_block
from opl.search.way_cells import Cells, WayPrices

STILL = 1e-12  # [rad] a joint that turns less over a chord is not held still by a choice of it


def cheapest_over_chords(cells: Cells, prices: WayPrices) -> tuple[Array, int]:
    """Return the cost of the cheapest way to each of `Cells.ends`, shape (m,).

    And how many ways from chord to end were looked at.
    """
    ends = cells.ends
    total = np.zeros(len(ends.start))
    looked = _over_chords(
        *_chords(cells),
        np.array(ends.start, order="C"),
        np.array(ends.t_low),
        np.array(ends.first, dtype=np.int64),
        *_priced(prices),
        total,
    )
    return total, int(looked)


def way_over_chords(cells: Cells, prices: WayPrices, total: Array) -> tuple[Array, Array]:
    """Return the cheapest way over chords.

    Args:
        cells: The cells.
        prices: What is charged for.
        total: `cheapest_over_chords` of the same.

    Returns:
        Its contact positions in belt units, shape (n_columns,); its joint positions in [rad], on
        the chords, each within half a turn of the one before, shape (n_columns, 6).
    """
    ends = cells.ends
    begin = ends.first[-2]
    last = begin + int(np.argmin(total[begin:]))
    n_columns = len(cells.first) - 1
    t, q = np.empty(n_columns), np.empty((n_columns, cells.start.shape[1]))
    t[-1], q[-1] = ends.t_low[last], ends.start[last]
    _way(*_chords(cells), *_priced(prices), total, t, q)
    return t, q


def _chords(cells: Cells) -> tuple[Array | np.ndarray, ...]:
    return (
        np.array(cells.start, order="C"),
        np.array(cells.along, order="C"),
        np.array(cells.t_low),
        np.array(cells.t_high),
        np.array(cells.first, dtype=np.int64),
        np.array(cells.at_start, dtype=np.int64),
    )


def _priced(prices: WayPrices) -> tuple[float | Array, ...]:
    return (
        prices.travel,
        prices.time,
        np.array(prices.seconds),
        np.array(prices.max_speed),
        prices.contact_speed,
    )


@kernel(
    "UniTuple(float64,2)(float64[:,::1],float64[:,::1],float64[::1],float64[::1],int64,float64[::1],"
    "float64,float64,float64,float64,float64[::1],float64,float64,float64,float64[::1])"
)
def _from_chord(  # type: ignore[no-untyped-def]
    start, along, t_low, t_high, come, q, t, travel, time, least, max_speed, contact_speed, known,
    known_end, away,
):  # fmt: skip
    """Return what the cheapest way over a chord to a posture costs, and where it leaves the chord.

    As a share of it. `away` is overwritten.
    """
    n_joints = len(q)
    for joint in range(n_joints):
        away[joint] = q[joint] - start[come, joint]
        middle = away[joint] - 0.5 * along[come, joint]
        # the same posture a full turn away
        away[joint] -= 2.0 * np.pi * np.round(middle / (2.0 * np.pi))
    best, where = np.inf, 0.0
    for still in range(-2, n_joints):
        share = still + 2.0  # an end of the chord
        if still >= 0:
            if abs(along[come, still]) < STILL:
                continue
            share = away[still] / along[come, still]
            if not 0.0 < share < 1.0:
                continue
        turned, lasts = 0.0, least
        for joint in range(n_joints):
            by = abs(away[joint] - share * along[come, joint])
            turned += by
            lasts = max(lasts, by / max_speed[joint])
        slid = abs(t - t_low[come] - share * (t_high[come] - t_low[come]))
        lasts = max(lasts, slid / contact_speed)
        cost = known + share * (known_end - known) + travel * turned + time * lasts
        if cost < best:
            best, where = cost, share
    return best, where


@kernel(
    "int64(float64[:,::1],float64[:,::1],float64[::1],float64[::1],int64[::1],int64[::1],"
    "float64[:,::1],float64[::1],int64[::1],float64,float64,float64[::1],float64[::1],float64,"
    "float64[::1])",
    makes_arrays=True,
)
def _over_chords(  # type: ignore[no-untyped-def]
    start, along, t_low, t_high, first, at_start, ends, ends_t, ends_first, travel, time, seconds,
    max_speed, contact_speed, total,
):  # fmt: skip
    """Fill in the cost of the cheapest way to each end; return how many chords were tried.

    Chords beside each other are looked at one by one only where a box around them is near enough.
    """
    n_joints, looked = start.shape[1], 0
    away, none = np.empty(n_joints), np.zeros_like(start)
    n_blocks = (len(start) + BLOCK - 1) // BLOCK
    lower, upper = np.empty((n_blocks, n_joints)), np.empty((n_blocks, n_joints))
    block_least, far, known = np.empty(n_blocks), np.empty(n_blocks), np.empty(len(start))
    for column in range(1, len(first) - 1):
        begin, end, least = first[column - 1], first[column], seconds[column - 1]
        blocks = (end - begin + BLOCK - 1) // BLOCK
        for come in range(begin, end):
            known[come] = min(total[at_start[come]], total[at_start[come] + 1])
        around_blocks(start, along, none, none, known, begin, end, lower, upper, block_least)
        for here in range(ends_first[column], ends_first[column + 1]):
            looked += blocks
            nearest = nearest_block(
                lower, upper, block_least, blocks, ends[here], ends[here], travel, time, least,
                max_speed, far,
            )  # fmt: skip
            best = np.inf
            for turn in range(blocks):
                # the nearest first, then all others
                block = nearest if turn == 0 else turn - int(turn <= nearest)
                if far[block] >= best:
                    continue
                looked += BLOCK
                for come in range(begin + block * BLOCK, min(begin + (block + 1) * BLOCK, end)):
                    at = at_start[come]
                    cost, _ = _from_chord(
                        start, along, t_low, t_high, come, ends[here], ends_t[here], travel, time,
                        least, max_speed, contact_speed, total[at], total[at + 1], away,
                    )  # fmt: skip
                    best = min(best, cost)
            total[here] = best
    return looked


@kernel(
    "void(float64[:,::1],float64[:,::1],float64[::1],float64[::1],int64[::1],int64[::1],float64,"
    "float64,float64[::1],float64[::1],float64,float64[::1],float64[::1],float64[:,::1])",
    makes_arrays=True,
)
def _way(  # type: ignore[no-untyped-def]
    start, along, t_low, t_high, first, at_start, travel, time, seconds, max_speed, contact_speed,
    total, t, q,
):  # fmt: skip
    """Fill in the cheapest way backwards from its last posture, which is given."""
    n_joints = start.shape[1]
    away = np.empty(n_joints)
    for column in range(len(t) - 1, 0, -1):
        best, chord, where = np.inf, first[column - 1], 0.0
        for come in range(first[column - 1], first[column]):
            at = at_start[come]
            cost, share = _from_chord(
                start, along, t_low, t_high, come, q[column], t[column], travel, time,
                seconds[column - 1], max_speed, contact_speed, total[at], total[at + 1], away,
            )  # fmt: skip
            if cost < best:
                best, chord, where = cost, come, share
        t[column - 1] = t_low[chord] + where * (t_high[chord] - t_low[chord])
        for joint in range(n_joints):
            there = start[chord, joint] + where * along[chord, joint]
            turns = np.round((q[column, joint] - there) / (2.0 * np.pi))
            q[column - 1, joint] = there + 2.0 * np.pi * turns
