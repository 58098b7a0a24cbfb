"""The cells of pieces as rows of numbers: what the compiled parts of the proof read.

A row is a cell: joint positions at its two ends, how far below and above the chord the postures can
be, and its ends along the wall. Where part of it is forbidden, the row is that of what is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from opl.geometry.frames import Array
from opl.search.walls import Piece

COLUMNS = 26  # start 0:6, end 6:12, pad_low 12:18, pad_high 18:24, places 24 and 25
NOTHING_LEFT = 1e3  # [rad] presses on every face of any box by more than is of interest


def rows_of(
    pieces: Sequence[Piece],
    sign: Array,
    shift: Array,
    left: Sequence[tuple[Array, Array]],
) -> Array:
    """Return the rows of pieces in one image, one after the other, shape (n, 26).

    Args:
        pieces: The pieces.
        sign: Of the image, shape (6,).
        shift: Of the image in [rad], shape (6,).
        left: What of the cells of each piece is not forbidden, as of `Forbidden.clear`; empty for
            all.
    """
    start, end = (
        np.concatenate([piece.corners[part] for piece in pieces]) * sign + shift
        for part in (slice(None, -1), slice(1, None))
    )
    pad_low = np.concatenate([piece.pad_low for piece in pieces])
    pad_high = np.concatenate([piece.pad_high for piece in pieces])
    rows = np.empty((len(start), COLUMNS))
    rows[:, 0:6], rows[:, 6:12] = start, end
    rows[:, 12:18] = np.where(sign < 0.0, -pad_high, pad_low)
    rows[:, 18:24] = np.where(sign < 0.0, -pad_low, pad_high)
    rows[:, 24] = np.concatenate([piece.at[:-1] for piece in pieces])
    rows[:, 25] = np.concatenate([piece.at[1:] for piece in pieces])
    if not left:
        return rows
    low, high = (np.concatenate(ends) for ends in zip(*left, strict=True))
    none, step, along = low > high, end - start, rows[:, 25] - rows[:, 24]
    begins, ends = (low > 0.0) & ~none, (high < 1.0) & ~none
    rows[begins, 0:6] += (low[:, None] * step)[begins]
    rows[ends, 6:12] = (start + high[:, None] * step)[ends]
    rows[none, 6:12] = start[none]
    rows[none, 12:18], rows[none, 18:24] = NOTHING_LEFT, -NOTHING_LEFT
    rows[:, 24] += np.where(none, 0.0, low * along)
    rows[:, 25] -= np.where(none, 0.0, (1.0 - high) * along)
    return rows


def bounds_of(rows: Array) -> Array:
    """Return what the cells of rows are within, shape (n, 12): least joint positions, greatest."""
    one, other = rows[:, :6], rows[:, 6:12]
    low, high = np.minimum(one, other) + rows[:, 12:18], np.maximum(one, other) + rows[:, 18:24]
    return np.hstack([low, high])


def with_room(table: Any, rows: int) -> Any:
    """Return a table with room for so many rows, twice of what it had at the least."""
    if rows <= len(table):
        return table
    larger = np.empty((max(rows, 2 * len(table)), *table.shape[1:]), table.dtype)
    larger[: len(table)] = table
    return larger
