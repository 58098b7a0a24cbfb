"""On which stretches of a move the held part surely stays out of the wheel, or deep in it by less.

A continuous collision check: one look at a stretch tells of all places on it. What a sphere, slab
or box of the part's tree holds is seen from the middle of the stretch: the plane that touches the
wheel below it bounds the distance there (`opl.cell.wheel_distance`), and from beginning to end the
part comes nearer to that plane only by what it moves across it, which is little where it slides
along.
"""

from __future__ import annotations

import numpy as np

from opl.cell.part_tree import TREE, PartTree
from opl.cell.wheel_distance import FEW, lowest_along
from opl.cell.wheel_triangle import distance_of_point, out_along, reach_of_wheel, way_out
from opl.files.kernels import kernel, prange, threads_are_allowed
from opl.geometry.frames import Array
from opl.geometry.wheel import ContactWheel

MOST_PIECES = 32  # of a triangle that wait at once
MOST_HALVED = 64  # pieces of a triangle looked at, before it is not sure
# A triangle is moved out of the wheel along one direction. One that is nowhere deeper than d is
# parted by a plane from the wheel made smaller by d, if anything is left of that. With the normal
# x, y, z of that plane the wheel ends d (|x| + root of y^2 + z^2) behind it: root of two times d at
# the most
ROOT = np.sqrt(2.0)
BENT = 2.0  # times what a point is off the straight line half-way: how far it may be anywhere


def surely_out(
    part: PartTree,
    wheel: ContactWheel,
    begin: Array,
    middle: Array,
    end: Array,
    needed: Array,
) -> np.ndarray:
    """Return on which stretches the part surely keeps a distance to the wheel, shape (n,).

    Points of the part are taken to be nowhere farther off the straight line from beginning to end
    than `BENT` times what they are half-way, which is not proven.

    Args:
        part: The part.
        wheel: The wheel; its pose does not matter here.
        begin: Poses of the part in contact frame 0 where a stretch begins, shape (n, 4, 4).
        middle: Half-way between.
        end: Where it ends.
        needed: The distance in [m], less than 0 for how far it may be in the wheel, shape (n,).
    """
    half = (end - begin)[:, :3] / 2.0
    off = (middle - (begin + end) / 2.0)[:, :3]
    corners = part.corners
    bent = np.linalg.norm(corners @ off[..., :3].transpose(0, 2, 1) + off[:, None, :, 3], axis=-1)
    out, looks = np.zeros(len(middle), dtype=bool), np.empty(len(middle), dtype=np.int64)
    made = _all_out if len(middle) > FEW and threads_are_allowed() else _few_out
    poses = np.ascontiguousarray(middle), np.ascontiguousarray(half)
    made(
        *poses,
        BENT * bent.max(axis=1),
        part.arrays,
        wheel.width / 2.0,
        wheel.radius,
        needed,
        out,
        looks,
    )
    part.looks[0] += looks.sum()
    return out


@kernel(
    "float64(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],int64,"
    "float64,float64,float64,float64,float64)"
)
def _beyond(T, half, spheres, slabs, boxes, index, nx, ny, nz, half_width, radius):  # type: ignore[no-untyped-def]
    """Least that a sphere, its slab and its box are beyond the wheel in a direction, all along."""
    p, q, r, reach = spheres[index, 0], spheres[index, 1], spheres[index, 2], spheres[index, 3]
    # how much it moves in that direction: at the centre, and around it
    u = nx * half[0, 0] + ny * half[1, 0] + nz * half[2, 0]
    v = nx * half[0, 1] + ny * half[1, 1] + nz * half[2, 1]
    w = nx * half[0, 2] + ny * half[1, 2] + nz * half[2, 2]
    moved = abs(u * p + v * q + w * r + nx * half[0, 3] + ny * half[1, 3] + nz * half[2, 3])
    moved += min(
        np.sqrt(u * u + v * v + w * w) * reach,
        abs(u) * boxes[index, 0] + abs(v) * boxes[index, 1] + abs(w) * boxes[index, 2],
    )
    x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
    y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
    z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3] - radius  # from the middle of the wheel
    centre = nx * x + ny * y + nz * z - reach_of_wheel(nx, ny, nz, half_width, radius)
    return centre + lowest_along(T, spheres, slabs, boxes, index, nx, ny, nz) - moved


@kernel(
    "boolean(float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],float64[:,::1],int64,"
    "float64,float64,float64)"
)
def _node_out(T, half, spheres, slabs, boxes, index, half_width, radius, needed):  # type: ignore[no-untyped-def]
    """Whether a sphere, its slab and its box keep a distance all along, as five directions tell."""
    p, q, r = spheres[index, 0], spheres[index, 1], spheres[index, 2]
    x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r + T[0, 3]
    y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r + T[1, 3]
    z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r + T[2, 3]
    _, gx, gy, gz = distance_of_point(x, y, z, half_width, radius)
    away = np.sqrt(y * y + (z - radius) ** 2)
    out_y, out_z = (y / away, (z - radius) / away) if away > 0.0 else (0.0, -1.0)
    side = 1.0 if x >= 0.0 else -1.0
    p, q, r = slabs[index, 0], slabs[index, 1], slabs[index, 2]
    square_x = T[0, 0] * p + T[0, 1] * q + T[0, 2] * r
    square_y = T[1, 0] * p + T[1, 1] * q + T[1, 2] * r
    square_z = T[2, 0] * p + T[2, 1] * q + T[2, 2] * r
    for direction in range(5):
        if direction == 0:  # to the nearest point of the wheel
            nx, ny, nz = gx, gy, gz
        elif direction == 1:  # over the rim, as far aside as the surface is tilted
            share = np.sqrt(max(1.0 - square_x * square_x, 0.0))
            nx, ny, nz = side * abs(square_x), share * out_y, share * out_z
        elif direction == 2:  # from the axle
            nx, ny, nz = 0.0, out_y, out_z
        elif direction == 3:  # square to the surface
            above = 1.0 if square_x * gx + square_y * gy + square_z * gz >= 0.0 else -1.0
            nx, ny, nz = above * square_x, above * square_y, above * square_z
        else:  # along the axle
            nx, ny, nz = side, 0.0, 0.0
        beyond = _beyond(T, half, spheres, slabs, boxes, index, nx, ny, nz, half_width, radius)
        if beyond >= needed:
            return True
    return False


@kernel(
    "boolean(float64[:,::1],float64[:,::1],float64[:,:,::1],int64,float64,float64,float64,"
    "float64[:,::1])",
    makes_arrays=True,
)
def _triangle_out(T, half, triangles, index, half_width, radius, needed, room):  # type: ignore[no-untyped-def]
    """Return whether a triangle surely keeps a distance all along.

    Its pieces are halved until they do. ``room``, shape (MOST_PIECES, 9), is where they wait.
    """
    corner = np.empty((3, 3))
    for k in range(3):
        for i in range(3):
            room[0, 3 * k + i] = triangles[index, k, i]
    n, looked, least = 1, 0, needed
    while n > 0:
        n -= 1
        looked += 1
        x = y = z = 0.0
        for k in range(3):
            p, q, r = room[n, 3 * k], room[n, 3 * k + 1], room[n, 3 * k + 2]
            for i in range(3):
                corner[k, i] = T[i, 0] * p + T[i, 1] * q + T[i, 2] * r + T[i, 3]
            x, y, z = x + corner[k, 0] / 3.0, y + corner[k, 1] / 3.0, z + corner[k, 2] / 3.0
        value, gx, gy, gz = distance_of_point(x, y, z, half_width, radius)
        if value < least:
            return False
        lowest = np.inf
        for k in range(3):
            p, q, r = room[n, 3 * k], room[n, 3 * k + 1], room[n, 3 * k + 2]
            moved = 0.0
            for i in range(3):
                g = gx if i == 0 else gy if i == 1 else gz
                moved += g * (half[i, 0] * p + half[i, 1] * q + half[i, 2] * r + half[i, 3])
            slope = gx * (corner[k, 0] - x) + gy * (corner[k, 1] - y) + gz * (corner[k, 2] - z)
            lowest = min(lowest, slope - abs(moved))
        if value + lowest >= least:
            continue
        least = max(needed, needed / ROOT)
        if -least >= min(half_width, radius) or looked > MOST_HALVED or n + 2 > MOST_PIECES:
            return False
        # halve the longest edge
        longest, one = -1.0, 0
        for k in range(3):
            m = (k + 1) % 3
            length = 0.0
            for i in range(3):
                length += (corner[k, i] - corner[m, i]) ** 2
            if length > longest:
                longest, one = length, k
        a, b, c = 3 * one, 3 * ((one + 1) % 3), 3 * ((one + 2) % 3)
        for i in range(3):
            from_a, from_b, from_c = room[n, a + i], room[n, b + i], room[n, c + i]
            half_way = (from_a + from_b) / 2.0
            corner[0, i], corner[1, i], corner[2, i] = from_b, half_way, from_c
            room[n, i], room[n, 3 + i], room[n, 6 + i] = from_a, half_way, from_c
            for k in range(3):
                room[n + 1, 3 * k + i] = corner[k, i]
        n += 2
    return True


@kernel(
    "boolean(float64[:,::1],float64[:,::1],float64[:,:,::1],int64,float64,float64,float64)",
    makes_arrays=True,
)
def _led_out(T, half, triangles, index, half_width, radius, needed):  # type: ignore[no-untyped-def]
    """Return whether a triangle surely keeps a distance all along in one direction.

    That of its shortest way out of the wheel half-way.
    """
    middle, moved = np.empty((3, 3)), np.empty((3, 3))
    for k in range(3):
        p, q, r = triangles[index, k, 0], triangles[index, k, 1], triangles[index, k, 2]
        for i in range(3):
            middle[k, i] = T[i, 0] * p + T[i, 1] * q + T[i, 2] * r + T[i, 3]
            moved[k, i] = half[i, 0] * p + half[i, 1] * q + half[i, 2] * r + half[i, 3]
    out, nx, ny, nz = way_out(middle, half_width, radius, 0.0)
    if out < needed:
        return False
    middle[:, 2] -= radius  # from the middle of the wheel
    # corners move straight: what they are beyond the wheel is least at an end
    begin = out_along(middle - moved, half_width, radius, nx, ny, nz)
    return min(begin, out_along(middle + moved, half_width, radius, nx, ny, nz)) >= needed


@kernel(
    f"Tuple((boolean,int64))(float64[:,::1],float64[:,::1],float64,{TREE},float64,float64,float64)",
    makes_arrays=True,
)
def _part_out(T, half, bent, tree, half_width, radius, needed):  # type: ignore[no-untyped-def]
    """Whether the part surely keeps a distance on one stretch, and how many looks that took."""
    triangles, spheres, slabs, boxes, first, child = tree
    room = np.empty((MOST_PIECES, 9))
    waiting = np.empty(64, dtype=np.int64)  # deeper than any halving of an array can go
    waiting[0] = 0
    n_waiting, looks = 1, 0
    while n_waiting > 0:
        n_waiting -= 1
        looks += 1
        node = waiting[n_waiting]
        if _node_out(T, half, spheres, slabs, boxes, node, half_width, radius, needed + bent):
            continue
        if child[node] == 0:
            least = needed + bent
            near = T, half, triangles, first[node], half_width, radius, least
            if not (_triangle_out(*near, room) or _led_out(*near)):
                return False, looks
            continue
        waiting[n_waiting], waiting[n_waiting + 1] = child[node], child[node] + 1
        n_waiting += 2
    return True, looks


_STRETCHES = (
    f"void(float64[:,:,::1],float64[:,:,::1],float64[::1],{TREE},float64,float64,float64[::1],"
    "boolean[::1],int64[::1])"
)


@kernel(_STRETCHES, threads=True, early=True)
def _all_out(middle, half, bent, tree, half_width, radius, needed, out, looks):  # type: ignore[no-untyped-def]
    for k in prange(len(middle)):
        out[k], looks[k] = _part_out(
            middle[k], half[k], bent[k], tree, half_width, radius, needed[k]
        )


@kernel(_STRETCHES, early=True)
def _few_out(middle, half, bent, tree, half_width, radius, needed, out, looks):  # type: ignore[no-untyped-def]
    for k in range(len(middle)):
        out[k], looks[k] = _part_out(
            middle[k], half[k], bent[k], tree, half_width, radius, needed[k]
        )
