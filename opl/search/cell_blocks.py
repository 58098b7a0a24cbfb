"""Blocks of cells beside each other, which are left out at once where a box around them is far."""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

BLOCK = 8  # cells


@kernel(
    "void(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[::1],int64,int64,"
    "float64[:,::1],float64[:,::1],float64[::1])"
)
def around_blocks(  # type: ignore[no-untyped-def]
    start, along, pad_low, pad_high, known, begin, end, lower, upper, least
):
    """Fill in the box around each block of the cells of a column, and the least known of them.

    Args:
        start: Of all cells, as `Cells` has them, likewise the next three.
        along: From the start of each to its other end.
        pad_low: How far below that it can be.
        pad_high: How far above.
        known: What is known of each cell, shape (n,).
        begin: The first cell of the column.
        end: The first one after it.
        lower: Filled with lower faces in [rad], shape (n_blocks, 6).
        upper: Filled with upper faces.
        least: Filled with the least known of each block, shape (n_blocks,).
    """
    for block in range((end - begin + BLOCK - 1) // BLOCK):
        lower[block], upper[block], least[block] = np.inf, -np.inf, np.inf
        for cell in range(begin + block * BLOCK, min(begin + (block + 1) * BLOCK, end)):
            least[block] = min(least[block], known[cell])
            for joint in range(start.shape[1]):
                low = start[cell, joint] + min(along[cell, joint], 0.0) + pad_low[cell, joint]
                high = start[cell, joint] + max(along[cell, joint], 0.0) + pad_high[cell, joint]
                lower[block, joint] = min(lower[block, joint], low)
                upper[block, joint] = max(upper[block, joint], high)


@kernel(
    "int64(float64[:,::1],float64[:,::1],float64[::1],int64,float64[::1],float64[::1],float64,"
    "float64,float64,float64[::1],float64[::1])"
)
def nearest_block(  # type: ignore[no-untyped-def]
    lower, upper, known, blocks, low, high, travel, time, least, max_speed, far
):
    """Fill in what the way to each block costs at the least; return which block is the nearest.

    Args:
        lower: As `around_blocks` fills them in, likewise the next two.
        upper: Upper faces.
        known: What is known of each block.
        blocks: How many there are.
        low: Lower faces of the box from which the ways lead, in [rad], shape (6,).
        high: Its upper faces.
        travel: Price of a radian.
        time: Price of a second.
        least: Time that each way takes at the least in [s].
        max_speed: Largest joint speeds in [rad/s], shape (6,).
        far: Filled with what is known and the way cost together, shape (n_blocks,).
    """
    nearest = 0
    for block in range(blocks):
        away, lasts = 0.0, least
        for joint in range(lower.shape[1]):
            middle = lower[block, joint] + upper[block, joint]
            middle = 0.5 * (middle - low[joint] - high[joint])
            half = 0.5 * (upper[block, joint] - lower[block, joint] + high[joint] - low[joint])
            middle -= 2.0 * np.pi * np.round(middle / (2.0 * np.pi))
            if half < np.pi:  # of all full turns, none is nearer than so much
                gap = max(abs(middle) - half, 0.0)
                away += gap
                lasts = max(lasts, gap / max_speed[joint])
        far[block] = known[block] + travel * away + time * lasts
        if far[block] < far[nearest]:
            nearest = block
    return nearest
