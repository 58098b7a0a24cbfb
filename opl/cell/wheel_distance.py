"""How far the held part is from the wheel, exactly, for any number of poses.

The distance depends on cutter point and contact position only, not on the robot or its ik_branch,
so one layer of distances serves every ik_branch. Bounding spheres around groups of triangles skip
most of the mesh at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.wheel_triangle import (
    DEEPEST,
    TOLERANCE,
    distance_of_point,
    nearest_on_triangle,
)
from opl.files.kernels import kernel, prange, threads_are_allowed
from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh
from opl.geometry.wheel import ContactWheel

FEW = 64  # poses that are not worth more than one thread


@dataclass(frozen=True)
class PartTree:
    """The triangles of the held part in a tree of bounding spheres.

    Attributes:
        triangles: Corners in the workpiece frame in [m], ordered so that each sphere holds a slice,
            shape (k, 3, 3).
        spheres: Centre and radius of each sphere in [m], shape (c, 4); the first holds everything.
        first: Index of each sphere's first triangle, shape (c,).
        end: Index after each sphere's last triangle, shape (c,).
        child: Index of each sphere's first child, the second follows it; 0 for a leaf, shape (c,).
        looks: How many spheres and triangles were looked at so far, shape (1,).
    """

    triangles: Array
    spheres: Array
    first: np.ndarray
    end: np.ndarray
    child: np.ndarray
    looks: np.ndarray


def part_tree(mesh: TriangleMesh) -> PartTree:
    """Sort the triangles of a mesh into a tree by halving them along the longest side."""
    triangles = mesh.triangles
    centres = triangles.mean(axis=1)
    order = np.arange(len(triangles))
    slices = [(0, len(triangles))]
    child: list[int] = []
    spheres = []
    for first, end in slices:  # grows while it is read
        corners = triangles[order[first:end]].reshape(-1, 3)
        centre = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        spheres.append([*centre, np.linalg.norm(corners - centre, axis=1).max()])
        if end - first == 1:
            child.append(0)
            continue
        inside = centres[order[first:end]]
        along = inside[:, int(np.argmax(np.ptp(inside, axis=0)))]
        order[first:end] = order[first:end][np.argsort(along, kind="stable")]
        middle = (first + end) // 2
        child.append(len(slices))
        slices += [(first, middle), (middle, end)]
    firsts, ends = np.array(slices, dtype=np.int64).T
    return PartTree(
        np.ascontiguousarray(triangles[order]),
        np.array(spheres),
        np.ascontiguousarray(firsts),
        np.ascontiguousarray(ends),
        np.array(child, dtype=np.int64),
        np.zeros(1, dtype=np.int64),
    )


def signed_wheel_distance(
    part: PartTree,
    wheel: ContactWheel,
    Ts_contact0_workpiece: Array,
    needed: Array | float,
    enough: Array | float = -np.inf,
) -> Array:
    """Return the smallest signed distance of the part to the wheel in [m], where it is too small.

    Args:
        part: The part.
        wheel: The wheel; its pose does not matter here.
        Ts_contact0_workpiece: Poses of the part in contact frame 0, shape (..., 4, 4).
        needed: Smallest distance allowed in [m]: a part that keeps it is not measured further,
            shape (...) or one for all.
        enough: What is nearer than this in [m] need not be known to be nearer still.

    Returns:
        Distance per pose, shape (...); where the part cuts into the wheel minus the longest of its
        triangles' ways out. Too large by `TOLERANCE` at most where the part is too near, so what is
        nearer than ``needed`` by more than that is less than ``needed``; otherwise that of some
        point of the part. Less than ``enough`` where the least is, too large by any amount there.
    """
    shape = Ts_contact0_workpiece.shape[:-2]
    needs = np.array(np.broadcast_to(needed, shape), dtype=float).reshape(-1)
    stops = np.array(np.broadcast_to(enough, shape), dtype=float).reshape(-1)
    flat = np.ascontiguousarray(Ts_contact0_workpiece.reshape(-1, 4, 4))
    distances, looks = np.empty(len(flat)), np.empty(len(flat), dtype=np.int64)
    # to call threads costs as much as dozens of poses, and many times that on a busy machine
    kernel = _distances if len(flat) > FEW and threads_are_allowed() else _few_distances
    tree = part.triangles, part.spheres, part.first, part.child
    kernel(flat, *tree, wheel.width / 2.0, wheel.radius, needs, stops, distances, looks)
    part.looks[0] += looks.sum()
    return distances.reshape(shape)


@kernel("float64(float64[:,::1],float64[:,::1],int64,float64,float64)")
def _sphere_bound(T, spheres, index, half_width, radius):  # type: ignore[no-untyped-def]
    """Lower bound on the distance of anything in a sphere."""
    p, q, r = spheres[index, 0], spheres[index, 1], spheres[index, 2]
    x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
    y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
    z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
    value, _, _, _ = distance_of_point(x, y, z, half_width, radius)
    return value - spheres[index, 3]


@kernel(
    "Tuple((float64,int64))(float64[:,::1],float64[:,:,::1],float64[:,::1],int64[::1],int64[::1],"
    "float64,float64,float64,float64)"
)
def _part_distance(  # type: ignore[no-untyped-def]
    T, triangles, spheres, first, child, half_width, radius, needed, enough
):
    """Distance of the part in one pose, and how many looks that took."""
    room = np.empty((DEEPEST + 1, 9))
    waiting = np.empty(64, dtype=np.int64)  # deeper than any halving of an array can go
    bounds = np.empty(64)
    waiting[0] = 0
    bounds[0] = -np.inf
    n_waiting = 1
    best, looks = np.inf, 0
    while n_waiting > 0 and best >= enough:
        n_waiting -= 1
        if bounds[n_waiting] >= min(best - TOLERANCE, needed):
            continue
        looks += 1
        node = waiting[n_waiting]
        if child[node] == 0:
            best = nearest_on_triangle(
                T, triangles, first[node], half_width, radius, needed, best, room
            )
            continue
        one, other = child[node], child[node] + 1
        low = _sphere_bound(T, spheres, one, half_width, radius)
        high = _sphere_bound(T, spheres, other, half_width, radius)
        if low > high:
            one, other = other, one
            low, high = high, low
        # the nearer child is taken next: it soon rules out nearly all the others
        waiting[n_waiting], bounds[n_waiting] = other, high
        waiting[n_waiting + 1], bounds[n_waiting + 1] = one, low
        n_waiting += 2
    return best, looks


_POSES = (
    "void(float64[:,:,::1],float64[:,:,::1],float64[:,::1],int64[::1],int64[::1],"
    "float64,float64,float64[::1],float64[::1],float64[::1],int64[::1])"
)


@kernel(_POSES, threads=True, early=True)
def _distances(  # type: ignore[no-untyped-def]
    poses, triangles, spheres, first, child, half_width, radius, needs, stops, distances, looks
):
    for k in prange(len(poses)):
        distances[k], looks[k] = _part_distance(
            poses[k], triangles, spheres, first, child, half_width, radius, needs[k], stops[k]
        )


@kernel(_POSES, early=True)
def _few_distances(  # type: ignore[no-untyped-def]
    poses, triangles, spheres, first, child, half_width, radius, needs, stops, distances, looks
):
    for k in range(len(poses)):
        distances[k], looks[k] = _part_distance(
            poses[k], triangles, spheres, first, child, half_width, radius, needs[k], stops[k]
        )
