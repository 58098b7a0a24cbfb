"""Configurations on the joint lines between configurations, close together."""

from __future__ import annotations

import numpy as np

from opl.geometry.frames import Array

RESOLUTION = np.deg2rad(1.0)  # largest joint change between two configurations that are checked


def densify(q: Array, resolution: float) -> tuple[Array, np.ndarray]:
    """Put configurations on the joint lines between configurations.

    `q` is in [rad], shape (n, 6); no joint changes by more than `resolution` in [rad] between two
    of the result.

    Returns:
        Configurations, shape (m, 6), ending with the last; and for each the index of the move that
        it belongs to (the configuration that the move ends at), shape (m,).
    """
    counts = np.ceil(np.abs(np.diff(q, axis=0)).max(axis=1) / resolution)
    counts = np.maximum(counts, 1).astype(int)
    move = np.repeat(np.arange(1, len(q)), counts)
    ends = np.cumsum(counts)
    fraction = (np.arange(len(move)) - np.repeat(ends - counts, counts) + 1) / counts[move - 1]
    dense = q[move - 1] + fraction[:, None] * (q[move] - q[move - 1])
    return np.concatenate([q[:1], dense]), np.concatenate([[0], move])
