"""The clearance layer: how far the held part is from the wheel, for any number of poses.

Part against wheel depends on cutter point and contact position only, not on the robot or its
branch, so one layer serves every branch. The wheel has a closed form; the part is a cloud of
surface samples in a tree of bounding spheres. A sphere that is farther from the wheel than the best
sample so far is skipped with all it holds, which is exact because the distance to the wheel changes
no faster than a point moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange, set_num_threads

from opl.geometry.frames import Array
from opl.geometry.wheel import ContactWheel

LEAF_SIZE = 8  # samples


@dataclass(frozen=True)
class PartSamples:
    """Surface samples of the held part in a tree of bounding spheres.

    Attributes:
        points: Samples in the workpiece frame in [m], ordered so that each sphere holds a slice,
            shape (k, 3).
        spheres: Centre and radius of each sphere in [m], shape (c, 4); the first holds all samples.
        first: Index of each sphere's first sample, shape (c,).
        end: Index after each sphere's last sample, shape (c,).
        child: Index of each sphere's first child, the second follows it; 0 for a leaf, shape (c,).
    """

    points: Array
    spheres: Array
    first: np.ndarray
    end: np.ndarray
    child: np.ndarray


def sample_tree(points: Array) -> PartSamples:
    """Sort surface samples, shape (k, 3) in [m], into a tree.

    Halves the cloud at the median of its longest side until the pieces are small.
    """
    order = np.arange(len(points))
    slices = [(0, len(points))]
    child: list[int] = []
    spheres = []
    for first, end in slices:  # grows while it is read
        inside = points[order[first:end]]
        low, high = inside.min(axis=0), inside.max(axis=0)
        centre = (low + high) / 2.0
        spheres.append([*centre, np.linalg.norm(inside - centre, axis=1).max()])
        if end - first <= LEAF_SIZE:
            child.append(0)
            continue
        along = inside[:, int(np.argmax(high - low))]
        order[first:end] = order[first:end][np.argsort(along, kind="stable")]
        middle = (first + end) // 2
        child.append(len(slices))
        slices += [(first, middle), (middle, end)]
    firsts, ends = np.array(slices, dtype=np.int64).T
    return PartSamples(
        points[order],
        np.array(spheres),
        np.ascontiguousarray(firsts),
        np.ascontiguousarray(ends),
        np.array(child, dtype=np.int64),
    )


def wheel_clearance(
    samples: PartSamples, wheel: ContactWheel, Ts_contact0_workpiece: Array
) -> Array:
    """Return the smallest signed distance of the part's samples to the wheel in [m].

    Args:
        samples: The part.
        wheel: The wheel; its pose does not matter here.
        Ts_contact0_workpiece: Poses of the part in contact frame 0, shape (..., 4, 4).

    Returns:
        Clearance per pose, negative where the part cuts into the wheel, shape (...).
    """
    shape = Ts_contact0_workpiece.shape[:-2]
    flat = np.ascontiguousarray(Ts_contact0_workpiece.reshape(-1, 4, 4))
    clearance = np.empty(len(flat))
    _clearances(
        flat,
        samples.points,
        samples.spheres,
        samples.first,
        samples.end,
        samples.child,
        wheel.width / 2.0,
        wheel.radius,
        clearance,
    )
    return clearance.reshape(shape)


def use_threads(count: int) -> None:
    """Limit the threads that clearances are computed in, where processes share the cores."""
    set_num_threads(count)


_POSES = "float64[:,:,::1]"
_POINTS = "float64[:,::1]"


@njit("float64(float64,float64,float64,float64,float64)", cache=True)
def _distance(x: float, y: float, z: float, half_width: float, radius: float) -> float:
    """Signed distance to the wheel as in `ContactWheel.clearance`, for one point."""
    beside = abs(x) - half_width
    beyond = np.sqrt(y * y + (z - radius) ** 2) - radius
    if beside > 0.0 and beyond > 0.0:
        return np.sqrt(beside * beside + beyond * beyond)
    return max(beside, beyond)


@njit("float64(float64[:,::1],float64[::1],float64,float64)", cache=True)
def _distance_at(T, p, half_width, radius):  # type: ignore[no-untyped-def]
    """Signed distance to the wheel of a point given in the workpiece frame."""
    x = T[0, 0] * p[0] + T[0, 1] * p[1] + T[0, 2] * p[2] + T[0, 3]
    y = T[1, 0] * p[0] + T[1, 1] * p[1] + T[1, 2] * p[2] + T[1, 3]
    z = T[2, 0] * p[0] + T[2, 1] * p[1] + T[2, 2] * p[2] + T[2, 3]
    return _distance(x, y, z, half_width, radius)


@njit(
    f"void({_POSES},{_POINTS},{_POINTS},int64[::1],int64[::1],int64[::1],"
    "float64,float64,float64[::1])",
    cache=True,
    parallel=True,
)
def _clearances(  # type: ignore[no-untyped-def]
    poses, points, spheres, first, end, child, half_width, radius, clearance
):
    for k in prange(len(poses)):
        T = poses[k]
        waiting = np.empty(64, dtype=np.int64)  # deeper than any halving of an array can go
        bounds = np.empty(64)
        waiting[0] = 0
        bounds[0] = -np.inf
        n_waiting = 1
        best = np.inf
        while n_waiting > 0:
            n_waiting -= 1
            if bounds[n_waiting] >= best:
                continue
            node = waiting[n_waiting]
            if child[node] == 0:
                for s in range(first[node], end[node]):
                    best = min(best, _distance_at(T, points[s], half_width, radius))
                continue
            one, other = child[node], child[node] + 1
            low = _distance_at(T, spheres[one], half_width, radius) - spheres[one, 3]
            high = _distance_at(T, spheres[other], half_width, radius) - spheres[other, 3]
            if low > high:
                one, other = other, one
                low, high = high, low
            # the nearer child is taken next: it soon rules out nearly all the others
            waiting[n_waiting] = other
            bounds[n_waiting] = high
            waiting[n_waiting + 1] = one
            bounds[n_waiting + 1] = low
            n_waiting += 2
        clearance[k] = best
