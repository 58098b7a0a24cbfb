"""Where a triangle mesh crosses itself.

Boxes around ever smaller groups of triangles leave the pairs that may meet; what those do is
decided by separating axes. Two triangles are apart if and only if their shadows on one of few axes
are: both normals, and the directions that are normal to an edge of each or, where both lie in one
plane, normal to an edge in that plane.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from opl.geometry.frames import Array

# triangles that sink into each other by less than this fraction of the mesh's size only touch; the
# single precision of STL files moves their corners by less
_TOUCHING = 2e-6

# pairs looked at together: few enough to stay in the processor's cache
_BLOCK = 30_000


def crossing_triangles(triangles: Array) -> np.ndarray:
    """Return the pairs of triangles that cross or overlap, the smaller index first, shape (k, 2).

    Triangles that share a corner or an edge, or touch otherwise, do not cross; those that lie on
    each other do. Those without area are passed over. Corners are in [m], shape (n, 3, 3).
    """
    size = np.ptp(triangles.reshape(-1, 3), axis=0).max() if len(triangles) else 0.0
    touching = _TOUCHING * float(size)
    edges = np.roll(triangles, -1, axis=1) - triangles
    normals = np.cross(edges[:, 0], edges[:, 1])
    twice_area = np.linalg.norm(normals, axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    # thinner than what only touches: there is no inside to be crossed
    sound = np.flatnonzero(twice_area > touching * longest)
    nothing = np.empty((0, 2), dtype=np.int64)
    if len(sound) < 2:
        return nothing
    triangles, edges = triangles[sound], edges[sound]
    normals = normals[sound] / twice_area[sound, None]
    outward = np.cross(edges, normals[:, None])
    outward /= np.linalg.norm(outward, axis=2, keepdims=True)
    found = [
        pairs[_cross(triangles, normals, outward, pairs, touching)] for pairs in _near(triangles)
    ]
    crossing = np.sort(sound[np.concatenate([nothing, *found])], axis=1)
    return crossing[np.lexsort(crossing.T[::-1])]


def _tree(triangles: Array) -> tuple[np.ndarray, list[Array], list[Array]]:
    """Return triangles in groups that are halved from level to level.

    Returns:
        The triangles, neighbours near each other, filled up with -1 to a power of two; least and
        largest x, y, z of the groups of each level, the whole first, shapes (2^level, 3).
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    n_levels = int(np.ceil(np.log2(len(triangles))))
    order = np.full(2**n_levels, -1)
    order[: len(triangles)] = np.argsort(_along_a_curve(0.5 * (low + high)), kind="stable")
    # the last one, which -1 means, is an empty box
    lows = [np.concatenate([low, np.full((1, 3), np.inf)])[order]]
    highs = [np.concatenate([high, np.full((1, 3), -np.inf)])[order]]
    for _ in range(n_levels):
        lows.append(lows[-1].reshape(-1, 2, 3).min(axis=1))
        highs.append(highs[-1].reshape(-1, 2, 3).max(axis=1))
    return order, lows[::-1], highs[::-1]


def _along_a_curve(points: Array) -> np.ndarray:
    """Return a number for each point, near for near ones: Morton's order, shape (n,)."""
    low = points.min(axis=0)
    scale = (2**21 - 1) / (float((points.max(axis=0) - low).max()) or 1.0)
    cells = ((points - low) * scale).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(21):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code


def _near(triangles: Array) -> Iterator[np.ndarray]:
    """Yield the pairs of triangles whose boxes meet, in blocks of shape (k, 2)."""
    order, lows, highs = _tree(triangles)
    bottom = len(lows) - 1
    halves = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    waiting = [(0, np.zeros((1, 2), dtype=np.int64))]
    while waiting:
        level, pairs = waiting.pop()
        if level == bottom:
            yield order[pairs]
            continue
        one, other = (2 * pairs[:, None] + halves).reshape(-1, 2).T
        low, high = lows[level + 1], highs[level + 1]
        # each pair once; a triangle is no pair with itself
        kept = one < other if level + 1 == bottom else one <= other
        one, other = one[kept], other[kept]
        for axis in range(3):
            meet = (low[one, axis] <= high[other, axis]) & (low[other, axis] <= high[one, axis])
            one, other = one[meet], other[meet]
        blocks = range(0, len(one), _BLOCK)
        pairs = np.stack([one, other], axis=1)
        waiting += [(level + 1, pairs[first : first + _BLOCK]) for first in blocks]


def _cross(
    triangles: Array, normals: Array, outward: Array, pairs: np.ndarray, touching: float
) -> np.ndarray:
    """Return which pairs of triangles sink into each other by more than ``touching`` [m], (k,).

    ``outward`` are unit directions in each plane out over its edges, shape (n, 3, 3).
    """
    left = np.arange(len(pairs))
    flat = np.ones(len(pairs), dtype=bool)
    # most pairs end here: neighbours lie on one side of each other's plane
    for side in (0, 1):
        own, other = pairs[left, side], pairs[left, 1 - side]
        heights = (triangles[other] - triangles[own, :1]) @ normals[own, :, None]
        above, below = heights.max(axis=(1, 2)), -heights.min(axis=(1, 2))
        in_plane = np.maximum(above, below) <= touching
        kept = in_plane | (np.minimum(above, below) > touching)
        flat, left = (flat & in_plane)[kept], left[kept]
    plane, across = left[flat], left[~flat]
    for side in (0, 1):
        own, other = pairs[plane, side], pairs[plane, 1 - side]
        corners, axes = triangles[own], outward[own]
        beyond = axes @ triangles[other].swapaxes(1, 2) - np.sum(axes * corners, axis=2)[..., None]
        plane = plane[(beyond.min(axis=2) < -touching).all(axis=1)]
    one, other = (triangles[pairs[across, side]] for side in (0, 1))
    edges = [np.roll(corners, -1, axis=1) - corners for corners in (one, other)]
    axes = np.cross(edges[0][:, :, None], edges[1][:, None]).reshape(-1, 9, 3)
    deep = _depth(one - one[:, :1], other - one[:, :1], axes) > touching
    crossing = np.zeros(len(pairs), dtype=bool)
    crossing[plane] = True
    crossing[across[deep]] = True
    return crossing


def _depth(one: Array, other: Array, axes: Array) -> Array:
    """Return how far triangles' shadows overlap at least, shape (k,); axes of shape (k, m, 3)."""
    lengths = np.linalg.norm(axes, axis=2)
    a, b = (axes @ corners.swapaxes(1, 2) for corners in (one, other))
    overlap = np.minimum(a.max(axis=2) - b.min(axis=2), b.max(axis=2) - a.min(axis=2))
    # parallel edges have no axis of their own
    none = lengths <= 1e-12 * lengths.max(axis=1, initial=0.0, keepdims=True)
    return np.asarray(np.where(none, np.inf, overlap / np.where(none, 1.0, lengths)).min(axis=1))
