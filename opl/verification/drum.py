"""The wheel as the second opinion has it: a plain cylinder, and what may be near it.

It is written out from its axis, apart from `ContactWheel` and from the planner's kernels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.files.kernels import kernel
from opl.geometry.frames import Array, inverse


@kernel("UniTuple(float64,4)(float64,float64,float64,float64[:,::1],float64,float64)")
def out_of_drum(x, y, z, T, radius, width):  # type: ignore[no-untyped-def]
    """Return the distance of a point from a `Drum` in [m], and the direction in which it grows."""
    x, y, z = x - T[0, 3], y - T[1, 3], z - T[2, 3]
    along = x * T[0, 2] + y * T[1, 2] + z * T[2, 2]
    x, y, z = x - along * T[0, 2], y - along * T[1, 2], z - along * T[2, 2]
    away = np.sqrt(x * x + y * y + z * z)
    beside, beyond = abs(along) - width / 2.0, away - radius
    # parts of the shortest motion out: along the axis, and away from it
    if beside <= 0.0 and beyond <= 0.0:
        distance = max(beside, beyond)
        sideways, outward = (1.0, 0.0) if beside > beyond else (0.0, 1.0)
    else:
        sideways, outward = max(beside, 0.0), max(beyond, 0.0)
        distance = np.sqrt(sideways * sideways + outward * outward)
        sideways, outward = sideways / distance, outward / distance
    if along < 0.0:
        sideways = -sideways
    outward /= max(away, 1e-12)
    return (
        distance,
        sideways * T[0, 2] + outward * x,
        sideways * T[1, 2] + outward * y,
        sideways * T[2, 2] + outward * z,
    )


@kernel(
    "void(float64[:,::1],float64[:,::1],float64,float64,float64[::1],float64[:,::1])", early=True
)
def _from_drum(points, T, radius, width, distance, direction):  # type: ignore[no-untyped-def]
    """Do `Drum.distances` for points in the base frame, shape (n, 3)."""
    for k in range(len(points)):
        x, y, z = points[k]
        distance[k], x, y, z = out_of_drum(x, y, z, T, radius, width)
        direction[k, 0], direction[k, 1], direction[k, 2] = x, y, z


@kernel("float64(float64[:,::1],float64,float64,float64,float64,float64)")
def _beyond(corners, radius, width, x, y, z):  # type: ignore[no-untyped-def]
    """Return how far a triangle is beyond all of a drum along a direction of any length, in [m].

    No point of it is nearer, nor is the way out of the drum longer where that is less than 0. The
    corners are in the frame of the drum, shape (3, 3).
    """
    aside = np.sqrt(x * x + y * y)
    length = np.sqrt(aside * aside + z * z)
    if length == 0.0:
        return -np.inf
    least = np.inf
    for k in range(3):
        least = min(least, x * corners[k, 0] + y * corners[k, 1] + z * corners[k, 2])
    return (least - radius * aside - width / 2.0 * abs(z)) / length


@kernel("float64(float64[:,::1],float64,float64,float64,float64,float64)")
def _beyond_from(corners, radius, width, x, y, z):  # type: ignore[no-untyped-def]
    """Do `_beyond` along the way from the drum to a point, from its axis to one that is beside."""
    away = np.sqrt(x * x + y * y)
    beyond, beside = away - radius, abs(z) - width / 2.0
    if beyond <= 0.0 or beside <= 0.0:
        return _beyond(corners, radius, width, x, y, 0.0)
    share = beyond / away
    return _beyond(corners, radius, width, share * x, share * y, beside if z > 0.0 else -beside)


@kernel("boolean(float64[:,::1],float64,float64,float64)", makes_arrays=True)
def _is_beyond(corners, radius, width, within):  # type: ignore[no-untyped-def]
    """Return whether some direction tells that a triangle is farther from a drum than ``within``.

    Tried are those from the drum to its middle and to where each edge is nearest to the axis, the
    normal and the axis.
    """
    x = (corners[0, 0] + corners[1, 0] + corners[2, 0]) / 3.0
    y = (corners[0, 1] + corners[1, 1] + corners[2, 1]) / 3.0
    z = (corners[0, 2] + corners[1, 2] + corners[2, 2]) / 3.0
    if _beyond_from(corners, radius, width, x, y, z) > within:
        return True
    edges = np.empty((3, 3))
    for k in range(3):
        for i in range(3):
            edges[k, i] = corners[(k + 1) % 3, i] - corners[k, i]
        ex, ey = edges[k, 0], edges[k, 1]
        square = ex * ex + ey * ey
        share = -(corners[k, 0] * ex + corners[k, 1] * ey) / square if square > 0.0 else 0.0
        share = min(max(share, 0.0), 1.0)
        x, y = corners[k, 0] + share * ex, corners[k, 1] + share * ey
        z = corners[k, 2] + share * edges[k, 2]
        if _beyond_from(corners, radius, width, x, y, z) > within:
            return True
    x = edges[0, 1] * edges[1, 2] - edges[0, 2] * edges[1, 1]
    y = edges[0, 2] * edges[1, 0] - edges[0, 0] * edges[1, 2]
    z = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    for sign in (-1.0, 1.0):
        if _beyond(corners, radius, width, sign * x, sign * y, sign * z) > within:
            return True
        if _beyond(corners, radius, width, 0.0, 0.0, sign) > within:
            return True
    return False


@kernel(
    "boolean(float64[:,:,::1],float64[:,::1],float64,float64,float64)",
    early=True,
    makes_arrays=True,
)
def _are_beyond(triangles, T, radius, width, within):  # type: ignore[no-untyped-def]
    """Do `Drum.is_beyond` for a part at T in the frame of the drum."""
    corners = np.empty((3, 3))
    for t in range(len(triangles)):
        for k in range(3):
            x, y, z = triangles[t, k]
            for i in range(3):
                corners[k, i] = T[i, 0] * x + T[i, 1] * y + T[i, 2] * z + T[i, 3]
        if not _is_beyond(corners, radius, width, within):
            return False
    return True


@dataclass(frozen=True, eq=False)
class Drum:
    """A cylinder about z of its own frame.

    Attributes:
        T_base_drum: Its pose, the origin in the middle, shape (4, 4).
        radius: In [m].
        width: In [m].
    """

    T_base_drum: Array
    radius: float
    width: float

    def distances(self, p_base: Array) -> tuple[Array, Array]:
        """Return signed distances of points in [m] and the directions in which they grow.

        The points are in the base frame in [m], shape (n, 3).

        Returns:
            Distances, negative inside, shape (n,); unit vectors, shape (n, 3).
        """
        distance, direction = np.empty(len(p_base)), np.empty((len(p_base), 3))
        _from_drum(p_base, self.T_base_drum, self.radius, self.width, distance, direction)
        return distance, direction

    @cached_property
    def T_drum_base(self) -> Array:
        """Where the base is in its frame, shape (4, 4)."""
        return inverse(self.T_base_drum)

    def are_beyond(self, triangles: Array, T_drum_workpiece: Array, within: float) -> bool:
        """Return whether triangles are certainly farther away than ``within``, in [m].

        Or no deeper, if that is negative: each has a way out that is shorter.

        Args:
            triangles: Their corners in the workpiece frame in [m], shape (m, 3, 3).
            T_drum_workpiece: Where the part is, shape (4, 4).
            within: How far, in [m].
        """
        return bool(_are_beyond(triangles, T_drum_workpiece, self.radius, self.width, within))
