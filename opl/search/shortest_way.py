"""The cheapest way through columns of cells: a lower bound of travel and time.

A cell is a piece of a curve in joint space, known as a chord and pads around it. What the way from
a cell to one of the next column costs at the least would lose the length of both, if each edge
could choose its own point in a cell. So a potential is added at one edge and taken off at the next:
it is linear along each chord, any one gives a true bound, and the cost of getting there along the
ends of the chords makes it nearly tight. For any prices p of the joints, none above the price of
travel, p times the change of the joints is not more than what their travel costs; that is linear
along both chords, so its least lies at their ends.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array
from opl.search.cell_blocks import BLOCK, around_blocks, nearest_block
from opl.search.way_cells import Cells, WayPrices


def cheapest_ways(cells: Cells, prices: WayPrices, potential: Array) -> tuple[Array, int]:
    """Return what a way through each cell costs at the least, shape (n,).

    And how many ways from cell to cell were looked at.

    Args:
        cells: The cells.
        prices: What is charged for.
        potential: Any number for each of `Cells.ends`; what the travel on the way to each costs
            makes the bound sharp, shape (m,).
    """
    start, end = (np.ascontiguousarray(one) for one in cells.at_ends(potential))
    forward, backward = np.zeros((2, len(start)))
    looked = _fill(cells, prices, start, end, False, forward)
    looked += _fill(cells, prices, start, end, True, backward)
    return np.asarray(forward + backward), looked


def _fill(
    cells: Cells, prices: WayPrices, start: Array, end: Array, backwards: bool, total: Array
) -> int:
    """Fill in costs as `_pass_on` does."""
    looked = _pass_on(
        np.array(cells.start, order="C"),
        np.array(cells.along, order="C"),
        np.array(cells.pad_low, order="C"),
        np.array(cells.pad_high, order="C"),
        np.array(cells.t_low),
        np.array(cells.t_high),
        np.array(cells.first, dtype=np.int64),
        prices.travel,
        prices.time,
        np.array(prices.seconds),
        np.array(prices.max_speed),
        prices.contact_speed,
        start,
        end,
        backwards,
        total,
    )
    return int(looked)


@kernel("float64(float64,float64[:,::1],float64[:,::1],int64,int64,int64)")
def _pads(price, pad_low, pad_high, a, b, joint):  # type: ignore[no-untyped-def]
    """Return the least of a price times what the pads of two cells add to the way from a to b."""
    if price > 0.0:
        return price * (pad_low[b, joint] - pad_high[a, joint])
    return price * (pad_high[b, joint] - pad_low[a, joint])


@kernel(
    "float64(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[::1],float64[::1],"
    "float64,float64,float64,float64[::1],float64,float64[::1],float64[::1],int64,int64,float64,"
    "float64,float64[::1])"
)
def _edge(  # type: ignore[no-untyped-def]
    start, along, pad_low, pad_high, t_low, t_high, travel, time, least, max_speed, contact_speed,
    potential, potential_end, a, b, known, best, price,
):  # fmt: skip
    """Return what a way from cell a to cell b costs at the least, and what is known of the rest.

    Where that is no less than the best it may be told too small. `price` is overwritten.
    """
    n_joints = start.shape[1]
    slope_a = potential_end[a] - potential[a]
    slope_b = potential_end[b] - potential[b]
    fixed, rise_a, rise_b, lasts = 0.0, 0.0, 0.0, least
    for joint in range(n_joints):
        away = start[b, joint] - start[a, joint]
        d_a, d_b = along[a, joint], along[b, joint]
        middle = away + 0.5 * (d_b - d_a)
        # the same posture a full turn away
        turns = 2.0 * np.pi * np.round(middle / (2.0 * np.pi))
        away -= turns
        low = away + min(d_b, 0.0) - max(d_a, 0.0)
        low += pad_low[b, joint] - pad_high[a, joint]
        high = away + max(d_b, 0.0) - min(d_a, 0.0)
        high += pad_high[b, joint] - pad_low[a, joint]
        # of all full turns, none is nearer than so much
        gap = max(min(low, 2.0 * np.pi - high), min(-high, 2.0 * np.pi + low), 0.0)
        lasts = max(lasts, gap / max_speed[joint])
        price[joint] = 0.0
        if max(high, -low) >= np.pi:  # one that is not linear along the chords may be
            fixed += travel * gap
        else:
            price[joint] = travel if middle > turns else -travel
            fixed += price[joint] * away + _pads(price[joint], pad_low, pad_high, a, b, joint)
            rise_a += price[joint] * d_a
            rise_b += price[joint] * d_b
        # a price of zero is as true as any
    slid = max(t_low[b] - t_high[a], t_low[a] - t_high[b])
    lasts = max(lasts, slid / contact_speed)
    found = fixed + min(0.0, slope_a - rise_a) + min(0.0, rise_b - slope_b)
    # all prices lower, where the way hardly turns a joint
    if rise_a + rise_b != 0.0:
        share = min(max((slope_a + slope_b) / (rise_a + rise_b), 0.0), 1.0)
        lower = share * fixed + min(0.0, slope_a - share * rise_a)
        found = max(found, lower + min(0.0, share * rise_b - slope_b))
    # one joint held still: its price makes up for the slopes of the potential
    before = known + time * lasts + potential[a] - potential[b]
    for joint in range(n_joints):
        if before + found >= best:  # which more would not change
            break
        old = price[joint]
        d_a, d_b = along[a, joint], along[b, joint]
        if old == 0.0 or abs(d_a + d_b) < 1e-12:
            continue
        wanted = old + (slope_a + slope_b - rise_a - rise_b) / (d_a + d_b)
        new = min(max(wanted, -travel), travel)
        away = start[b, joint] - start[a, joint]
        middle = away + 0.5 * (d_b - d_a)
        away -= 2.0 * np.pi * np.round(middle / (2.0 * np.pi))
        other = fixed + (new - old) * away
        other += _pads(new, pad_low, pad_high, a, b, joint)
        other -= _pads(old, pad_low, pad_high, a, b, joint)
        other += min(0.0, slope_a - rise_a - (new - old) * d_a)
        other += min(0.0, rise_b + (new - old) * d_b - slope_b)
        found = max(found, other)
    return before + found


@kernel(
    "int64(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[::1],float64[::1],"
    "int64[::1],float64,float64,float64[::1],float64[::1],float64,float64[::1],float64[::1],"
    "boolean,float64[::1])",
    makes_arrays=True,
)
def _pass_on(  # type: ignore[no-untyped-def]
    start, along, pad_low, pad_high, t_low, t_high, first, travel, time, seconds, max_speed,
    contact_speed, potential, potential_end, backwards, total,
):  # fmt: skip
    """Fill in the cost of the cheapest way from one end to each cell; return how many were tried.

    Of a way from the first column the potential at the cell is taken off; of one from the last, it
    is added where that begins. Cells beside each other are looked at one by one only where a box
    around them is near enough.
    """
    n_columns, n_joints, looked = len(first) - 1, start.shape[1], 0
    begin = n_columns - 1 if backwards else 0
    for cell in range(first[begin], first[begin + 1]):
        total[cell] = 0.0
        if backwards:
            total[cell] = min(potential[cell], potential_end[cell])
        else:
            total[cell] = -max(potential[cell], potential_end[cell])
    price = np.empty(n_joints)
    lower, upper = np.empty(n_joints), np.empty(n_joints)
    n_blocks = (len(start) + BLOCK - 1) // BLOCK
    block_lower, block_upper = np.empty((n_blocks, n_joints)), np.empty((n_blocks, n_joints))
    block_least, far, known = np.empty(n_blocks), np.empty(n_blocks), np.empty(len(start))
    for step in range(1, n_columns):
        column = n_columns - 1 - step if backwards else step
        beside = column + 1 if backwards else column - 1
        least = seconds[min(column, beside)]
        begin, end = first[beside], first[beside + 1]
        blocks = (end - begin + BLOCK - 1) // BLOCK
        for come in range(begin, end):
            if backwards:
                known[come] = total[come] - max(potential[come], potential_end[come])
            else:
                known[come] = total[come] + min(potential[come], potential_end[come])
        around_blocks(
            start, along, pad_low, pad_high, known, begin, end, block_lower, block_upper,
            block_least,
        )  # fmt: skip
        for cell in range(first[column], first[column + 1]):
            for joint in range(n_joints):
                lower[joint] = start[cell, joint] + min(along[cell, joint], 0.0)
                lower[joint] += pad_low[cell, joint]
                upper[joint] = start[cell, joint] + max(along[cell, joint], 0.0)
                upper[joint] += pad_high[cell, joint]
            if backwards:
                own = min(potential[cell], potential_end[cell])
            else:
                own = -max(potential[cell], potential_end[cell])
            looked += blocks
            nearest = nearest_block(
                block_lower, block_upper, block_least, blocks, lower, upper, travel, time, least,
                max_speed, far,
            )  # fmt: skip
            best = np.inf
            for turn in range(blocks):
                # the nearest first, then all others
                block = nearest if turn == 0 else turn - int(turn <= nearest)
                if far[block] + own >= best:
                    continue
                looked += BLOCK
                for come in range(begin + block * BLOCK, min(begin + (block + 1) * BLOCK, end)):
                    a, b = (cell, come) if backwards else (come, cell)  # from a to b
                    cost = _edge(
                        start, along, pad_low, pad_high, t_low, t_high, travel, time, least,
                        max_speed, contact_speed, potential, potential_end, a, b, total[come],
                        best, price,
                    )  # fmt: skip
                    best = min(best, cost)
            total[cell] = best
    return looked
