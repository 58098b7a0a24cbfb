"""How far the held part is from the wheel, exactly, for any number of poses.

The distance depends on cutter point and contact position only, not on the robot or its ik_branch,
so one layer of distances serves every ik_branch. The signed distance to the wheel, a cylinder, is a
convex function, so planes below it bound it on a whole triangle. Triangles whose bound is no better
than the best point known are skipped, the others are halved until the rest cannot matter. Bounding
spheres around groups of triangles skip most of the mesh at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange, set_num_threads

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh
from opl.geometry.wheel import ContactWheel

FEW = 64  # poses that are not worth more than one thread
TOLERANCE = 2e-6  # [m] distances returned are at most this much too large


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
    """

    triangles: Array
    spheres: Array
    first: np.ndarray
    end: np.ndarray
    child: np.ndarray


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
    )


def signed_wheel_distance(
    part: PartTree, wheel: ContactWheel, Ts_contact0_workpiece: Array, needed: Array | float
) -> Array:
    """Return the smallest signed distance of the part to the wheel in [m], where it is too small.

    Args:
        part: The part.
        wheel: The wheel; its pose does not matter here.
        Ts_contact0_workpiece: Poses of the part in contact frame 0, shape (..., 4, 4).
        needed: Smallest distance allowed in [m]: a part that keeps it is not measured further,
            shape (...) or one for all.

    Returns:
        Distance per pose, negative where the part cuts into the wheel, shape (...). Less than
        ``needed`` exactly where the part is too near, and then too large by `TOLERANCE` at most;
        otherwise the distance of some point of the part.
    """
    shape = Ts_contact0_workpiece.shape[:-2]
    needs = np.array(np.broadcast_to(needed, shape), dtype=float).reshape(-1)
    flat = np.ascontiguousarray(Ts_contact0_workpiece.reshape(-1, 4, 4))
    distances = np.empty(len(flat))
    # to call threads costs as much as dozens of poses, and many times that on a busy machine
    kernel = _few_distances if len(flat) <= FEW else _distances
    tree = part.triangles, part.spheres, part.first, part.child
    kernel(flat, *tree, wheel.width / 2.0, wheel.radius, needs, distances)
    return distances.reshape(shape)


def use_threads(count: int) -> None:
    """Limit the threads that distances are computed in, where processes share the cores."""
    set_num_threads(count)


DEEPEST = 96  # pieces that wait at once; halving to a micrometre needs far fewer


@njit("UniTuple(float64,4)(float64,float64,float64,float64,float64)", cache=True)
def _distance(x, y, z, half_width, radius):  # type: ignore[no-untyped-def]
    """Signed distance to the wheel as in `ContactWheel.signed_distance`, and its gradient."""
    away = np.sqrt(y * y + (z - radius) ** 2)
    beside = abs(x) - half_width
    beyond = away - radius
    if beside > 0.0 and beyond > 0.0:
        value = np.sqrt(beside * beside + beyond * beyond)
        along, out = beside / value, beyond / value
    elif beside > beyond:
        value, along, out = beside, 1.0, 0.0
    else:
        value, along, out = beyond, 0.0, 1.0
    scale = out / away if away > 0.0 else 0.0
    return value, along if x >= 0.0 else -along, scale * y, scale * (z - radius)


@njit("float64(float64,float64,float64,float64,float64,float64)", cache=True)
def _mean_bound(beside0, beside1, beside2, beyond0, beyond1, beyond2):  # type: ignore[no-untyped-def]
    """Largest lower bound that a mean of two linear functions gives, from their values at corners.

    The mean at which corners 0 and 1 are equal; the others come by calling it with other corners.
    """
    rise, fall = beside0 - beside1, beyond1 - beyond0
    share = fall / (rise + fall) if rise + fall != 0.0 else -1.0
    if not 0.0 < share < 1.0:
        return -np.inf
    rest = 1.0 - share
    return min(share * beside0 + rest * beyond0, share * beside2 + rest * beyond2)


@njit(
    "float64(float64[:,::1],float64[:,:,::1],int64,float64,float64,float64,float64,float64[:,::1])",
    cache=True,
)
def _nearest_on_triangle(  # type: ignore[no-untyped-def]
    T, triangles, index, half_width, radius, needed, best, room
):
    """Return the distance of a triangle, or ``best`` if it is not nearer than that.

    Below the distance lie its own tangent plane, the plane of the wheel's side, the tangent plane
    of its rim, and every mean of the last two: at an edge only such a mean is flat along the part.
    ``room``, shape (DEEPEST + 1, 9), is where pieces of the triangle wait.
    """
    for k in range(3):
        for i in range(3):
            room[0, 3 * k + i] = (
                T[i, 0] * triangles[index, k, 0]
                + T[i, 1] * triangles[index, k, 1]
                + T[i, 2] * triangles[index, k, 2]
                + T[i, 3]
            )
    n = 1
    whole = True
    while n > 0:
        n -= 1
        ax, ay, az = room[n, 0], room[n, 1], room[n, 2]
        bx, by, bz = room[n, 3], room[n, 4], room[n, 5]
        cx, cy, cz = room[n, 6], room[n, 7], room[n, 8]
        x, y, z = (ax + bx + cx) / 3.0, (ay + by + cy) / 3.0, (az + bz + cz) / 3.0
        value, gx, gy, gz = _distance(x, y, z, half_width, radius)
        best = min(best, value)
        slope_a = gx * (ax - x) + gy * (ay - y) + gz * (az - z)
        slope_b = gx * (bx - x) + gy * (by - y) + gz * (bz - z)
        slope_c = gx * (cx - x) + gy * (cy - y) + gz * (cz - z)
        bound = value + min(slope_a, slope_b, slope_c)
        enough = min(best - TOLERANCE, needed)
        if bound < enough:
            away = np.sqrt(y * y + (z - radius) ** 2)
            out_y = y / away if away > 0.0 else 0.0
            out_z = (z - radius) / away if away > 0.0 else 0.0
            side = 1.0 if x >= 0.0 else -1.0
            beside_a, beside_b, beside_c = side * ax, side * bx, side * cx
            beyond = away - radius + half_width
            beyond_a = beyond + out_y * (ay - y) + out_z * (az - z)
            beyond_b = beyond + out_y * (by - y) + out_z * (bz - z)
            beyond_c = beyond + out_y * (cy - y) + out_z * (cz - z)
            mean = max(
                _mean_bound(beside_a, beside_b, beside_c, beyond_a, beyond_b, beyond_c),
                _mean_bound(beside_b, beside_c, beside_a, beyond_b, beyond_c, beyond_a),
                _mean_bound(beside_c, beside_a, beside_b, beyond_c, beyond_a, beyond_b),
                min(beside_a, beside_b, beside_c),
                min(beyond_a, beyond_b, beyond_c),
            )
            bound = max(bound, mean - half_width)
        if bound >= enough or n + 2 > DEEPEST:
            continue
        if whole:  # it has to be halved: its corners may be the nearest points
            whole = False
            for k in range(3):
                value, _, _, _ = _distance(
                    room[0, 3 * k], room[0, 3 * k + 1], room[0, 3 * k + 2], half_width, radius
                )
                best = min(best, value)
        ab = (ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2
        bc = (bx - cx) ** 2 + (by - cy) ** 2 + (bz - cz) ** 2
        ca = (cx - ax) ** 2 + (cy - ay) ** 2 + (cz - az) ** 2
        if bc >= ab and bc >= ca:  # turn the corners so that a and b end the longest edge
            ax, ay, az, bx, by, bz, cx, cy, cz = bx, by, bz, cx, cy, cz, ax, ay, az
        elif ca >= ab:
            ax, ay, az, bx, by, bz, cx, cy, cz = cx, cy, cz, ax, ay, az, bx, by, bz
        mx, my, mz = (ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0
        value, _, _, _ = _distance(mx, my, mz, half_width, radius)
        best = min(best, value)
        room[n, 0], room[n, 1], room[n, 2] = ax, ay, az
        room[n, 3], room[n, 4], room[n, 5] = mx, my, mz
        room[n, 6], room[n, 7], room[n, 8] = cx, cy, cz
        room[n + 1, 0], room[n + 1, 1], room[n + 1, 2] = mx, my, mz
        room[n + 1, 3], room[n + 1, 4], room[n + 1, 5] = bx, by, bz
        room[n + 1, 6], room[n + 1, 7], room[n + 1, 8] = cx, cy, cz
        n += 2
    return best


@njit("float64(float64[:,::1],float64[:,::1],int64,float64,float64)", cache=True)
def _sphere_bound(T, spheres, index, half_width, radius):  # type: ignore[no-untyped-def]
    """Lower bound on the distance of anything in a sphere."""
    p, q, r = spheres[index, 0], spheres[index, 1], spheres[index, 2]
    x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
    y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
    z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
    value, _, _, _ = _distance(x, y, z, half_width, radius)
    return value - spheres[index, 3]


@njit(
    "float64(float64[:,::1],float64[:,:,::1],float64[:,::1],int64[::1],int64[::1],float64,float64,"
    "float64)",
    cache=True,
)
def _part_distance(  # type: ignore[no-untyped-def]
    T, triangles, spheres, first, child, half_width, radius, needed
):
    """Distance of the part in one pose; see `signed_wheel_distance`."""
    room = np.empty((DEEPEST + 1, 9))
    waiting = np.empty(64, dtype=np.int64)  # deeper than any halving of an array can go
    bounds = np.empty(64)
    waiting[0] = 0
    bounds[0] = -np.inf
    n_waiting = 1
    best = np.inf
    while n_waiting > 0:
        n_waiting -= 1
        if bounds[n_waiting] >= min(best - TOLERANCE, needed):
            continue
        node = waiting[n_waiting]
        if child[node] == 0:
            best = _nearest_on_triangle(
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
    return best


_POSES = (
    "void(float64[:,:,::1],float64[:,:,::1],float64[:,::1],int64[::1],int64[::1],"
    "float64,float64,float64[::1],float64[::1])"
)


@njit(_POSES, cache=True, parallel=True)
def _distances(  # type: ignore[no-untyped-def]
    poses, triangles, spheres, first, child, half_width, radius, needs, distances
):
    for k in prange(len(poses)):
        distances[k] = _part_distance(
            poses[k], triangles, spheres, first, child, half_width, radius, needs[k]
        )


@njit(_POSES, cache=True)
def _few_distances(  # type: ignore[no-untyped-def]
    poses, triangles, spheres, first, child, half_width, radius, needs, distances
):
    for k in range(len(poses)):
        distances[k] = _part_distance(
            poses[k], triangles, spheres, first, child, half_width, radius, needs[k]
        )
