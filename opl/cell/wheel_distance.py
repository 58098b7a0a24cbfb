"""How far the held part is from the wheel, exactly, for any number of poses.

The distance depends on cutter point and contact position only, not on the robot or its ik_branch,
so one layer of distances serves every ik_branch. Nodes of the part's tree that are certainly far
enough away are skipped, most of the mesh at once.
"""

from __future__ import annotations

import numpy as np

from opl.cell.part_tree import TREE, PartTree
from opl.cell.wheel_triangle import (
    DEEPEST,
    TOLERANCE,
    distance_of_point,
    nearest_on_triangle,
)
from opl.files.kernels import kernel, prange, threads_are_allowed
from opl.geometry.frames import Array
from opl.geometry.wheel import ContactWheel

FEW = 64  # poses that are not worth more than one thread


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
        point of the part, or infinite. Less than ``enough`` where the least is, too large by any
        amount there.
    """
    return nearest_triangle(part, wheel, Ts_contact0_workpiece, needed, enough)[0]


def nearest_triangle(
    part: PartTree,
    wheel: ContactWheel,
    Ts_contact0_workpiece: Array,
    needed: Array | float,
    enough: Array | float = -np.inf,
) -> tuple[Array, np.ndarray]:
    """Return what `signed_wheel_distance` does, and which triangle has that distance or less.

    By its number in the arrays of the part, -1 where the distance is infinite, shape (...).
    """
    shape = Ts_contact0_workpiece.shape[:-2]
    needs = np.array(np.broadcast_to(needed, shape), dtype=float).reshape(-1)
    stops = np.array(np.broadcast_to(enough, shape), dtype=float).reshape(-1)
    flat = np.ascontiguousarray(Ts_contact0_workpiece.reshape(-1, 4, 4))
    distances = np.empty(len(flat))
    nearest, looks = np.empty(len(flat), dtype=np.int64), np.empty(len(flat), dtype=np.int64)
    # to call threads costs as much as dozens of poses, and many times that on a busy machine
    kernel = _distances if len(flat) > FEW and threads_are_allowed() else _few_distances
    half, radius = wheel.width / 2.0, wheel.radius
    kernel(flat, part.arrays, half, radius, needs, stops, distances, nearest, looks)
    part.looks[0] += looks.sum()
    return distances.reshape(shape), nearest.reshape(shape)


@kernel(
    "float64(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],int64,float64,float64,"
    "float64)"
)
def lowest_along(T, spheres, slabs, boxes, index, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Lower bound on how far what a sphere, its slab and its box hold is along a direction.

    From the centre of the sphere; the direction, of length 1, is seen from contact frame 0.
    """
    u = nx * T[0, 0] + ny * T[1, 0] + nz * T[2, 0]
    v = nx * T[0, 1] + ny * T[1, 1] + nz * T[2, 1]
    w = nx * T[0, 2] + ny * T[1, 2] + nz * T[2, 2]
    # what of it is not along the normal of the slab
    p, q, r = slabs[index, 0], slabs[index, 1], slabs[index, 2]
    a, b, c, reach = boxes[index, 0], boxes[index, 1], boxes[index, 2], spheres[index, 3]
    along = u * p + v * q + w * r
    nearest = along * (slabs[index, 3] if along > 0.0 else slabs[index, 4])
    aside = np.sqrt(max(1.0 - along * along, 0.0)) * reach
    aside = min(aside, abs(u - along * p) * a + abs(v - along * q) * b + abs(w - along * r) * c)
    return max(nearest - aside, -reach, -(abs(u) * a + abs(v) * b + abs(w) * c))


@kernel(
    "float64(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],int64,float64,float64)"
)
def _bound(T, spheres, slabs, boxes, index, half_width, radius):  # type: ignore[no-untyped-def]
    """Lower bound on the distance of anything in a sphere, its slab and its box.

    The distance is convex: nothing is nearer than the slope at the centre tells. And what is moved
    along that slope until it is beyond the wheel is out of it.
    """
    p, q, r = spheres[index, 0], spheres[index, 1], spheres[index, 2]
    x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
    y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
    z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
    value, gx, gy, gz = distance_of_point(x, y, z, half_width, radius)
    return value + lowest_along(T, spheres, slabs, boxes, index, gx, gy, gz)


@kernel(
    f"Tuple((float64,int64,int64))(float64[:,::1],{TREE},float64,float64,float64,float64)",
    makes_arrays=True,
)
def _part_distance(T, tree, half_width, radius, needed, enough):  # type: ignore[no-untyped-def]
    """Distance of the part in one pose, of which triangle, and how many looks that took."""
    triangles, spheres, slabs, boxes, first, child = tree
    room = np.empty((DEEPEST + 1, 9))
    waiting = np.empty(64, dtype=np.int64)  # deeper than any halving of an array can go
    bounds = np.empty(64)
    waiting[0] = 0
    bounds[0] = -np.inf
    n_waiting = 1
    best, nearest, looks = np.inf, -1, 0
    while n_waiting > 0 and best >= enough:
        n_waiting -= 1
        if bounds[n_waiting] >= min(best - TOLERANCE, needed):
            continue
        looks += 1
        node = waiting[n_waiting]
        if child[node] == 0:
            value = nearest_on_triangle(
                T, triangles, first[node], half_width, radius, needed, enough, best, room
            )
            if value < best:
                best, nearest = value, first[node]
            continue
        one, other = child[node], child[node] + 1
        low = _bound(T, spheres, slabs, boxes, one, half_width, radius)
        high = _bound(T, spheres, slabs, boxes, other, half_width, radius)
        if low > high:
            one, other = other, one
            low, high = high, low
        # the nearer child is taken next: it soon rules out nearly all the others
        waiting[n_waiting], bounds[n_waiting] = other, high
        waiting[n_waiting + 1], bounds[n_waiting + 1] = one, low
        n_waiting += 2
    return best, nearest, looks


_POSES = (
    f"void(float64[:,:,::1],{TREE},float64,float64,"
    "float64[::1],float64[::1],float64[::1],int64[::1],int64[::1])"
)


@kernel(_POSES, threads=True, early=True)
def _distances(poses, tree, half_width, radius, needs, stops, distances, nearest, looks):  # type: ignore[no-untyped-def]
    for k in prange(len(poses)):
        distances[k], nearest[k], looks[k] = _part_distance(
            poses[k], tree, half_width, radius, needs[k], stops[k]
        )


@kernel(_POSES, early=True)
def _few_distances(poses, tree, half_width, radius, needs, stops, distances, nearest, looks):  # type: ignore[no-untyped-def]
    for k in range(len(poses)):
        distances[k], nearest[k], looks[k] = _part_distance(
            poses[k], tree, half_width, radius, needs[k], stops[k]
        )
