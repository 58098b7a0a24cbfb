"""One triangle of the held part against the wheel: how far it is away, or how deep in the wheel.

The signed distance to a cylinder is convex, so planes below it bound it on a whole triangle. A
triangle whose bound is no better than what is known is skipped, another is halved until the rest
cannot matter.

How deep one is that cuts into the wheel is how far it has to be moved to be out of it, as the
second opinion has it too. At the rim that is more than its deepest point is below the surface, by
up to the square root of two: a face that cuts the corner of the wheel off has to go all the way to
the corner. Any direction gives a way out; the shortest is along the axle, away from it at a corner
of the triangle, along its normal, or square to one of its edges where that touches the rim. Only
those of the last kind have to be looked for, where an edge is so near to the rim.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

TOLERANCE = 1e-7  # [m] distances returned are at most this much too large
DEEPEST = 96  # pieces that wait at once; halving to the tolerance needs far fewer
# Square to an edge, evenly. Between two the way out can be shorter than about both only if it is
# a least one there, and then by no more than a thousandth.
DIRECTIONS = 64
_COS = np.cos(2.0 * np.pi / DIRECTIONS * np.arange(DIRECTIONS))
_SIN = np.sin(2.0 * np.pi / DIRECTIONS * np.arange(DIRECTIONS))
_CLOSER = 24  # times that the bracket around a shortest one is made smaller, by the golden section
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


@kernel("float64(float64,float64,float64,float64,float64)")
def reach_of_wheel(nx, ny, nz, half_width, radius):  # type: ignore[no-untyped-def]
    """Return how far the wheel reaches from its middle in a direction, times the length of that."""
    return half_width * abs(nx) + radius * np.sqrt(ny * ny + nz * nz)


@kernel("float64(float64[:,::1],float64,float64,float64,float64,float64)")
def out_along(corners, half_width, radius, nx, ny, nz):  # type: ignore[no-untyped-def]
    """Return how far a triangle is beyond all of the wheel in a direction, of any length.

    Negative where it has to be moved that far. The corners, shape (3, 3), are seen from the middle
    of the wheel.
    """
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return -np.inf
    least = np.inf
    for k in range(3):
        least = min(least, nx * corners[k, 0] + ny * corners[k, 1] + nz * corners[k, 2])
    return (least - reach_of_wheel(nx, ny, nz, half_width, radius)) / length


@kernel("float64(float64[:,::1],float64,float64,float64[:,::1],float64,float64)")
def _out_around(corners, half_width, radius, across, c, s):  # type: ignore[no-untyped-def]
    """Return the same for the direction between the two of ``across``, shape (2, 3).

    It is at an angle whose cosine and sine are given.
    """
    return out_along(
        corners,
        half_width,
        radius,
        c * across[0, 0] + s * across[1, 0],
        c * across[0, 1] + s * across[1, 1],
        c * across[0, 2] + s * across[1, 2],
    )


@kernel("boolean(float64[::1],float64[::1],float64,float64,float64)")
def _may_cross_rim(a, b, half_width, radius, way):  # type: ignore[no-untyped-def]
    """Return whether an edge from a to b can touch the rim of the wheel after so short a way.

    What does was no farther from it than that: from the side of the wheel, and from its radius.
    Only where an edge touches the rim, a direction square to it can be the shortest way out.
    """
    one, other = np.sqrt(a[1] * a[1] + a[2] * a[2]), np.sqrt(b[1] * b[1] + b[2] * b[2])
    beside = max(abs(a[0]), abs(b[0])) + way
    return beside >= half_width and max(one, other) + way >= radius


@kernel("UniTuple(float64,4)(float64[:,::1],float64,float64,float64)", makes_arrays=True)
def way_out(triangle, half_width, radius, enough):  # type: ignore[no-untyped-def]
    """Return minus the length of the shortest way out of a triangle in the wheel, and where to.

    Of one that is outside it is some distance that it keeps at least, not less than 0. The corners,
    shape (3, 3), are seen from contact frame 0. Ways no longer than ``enough`` says, such as -0.001
    for a millimetre, are all the same. The direction, x, y and z, is of any length.
    """
    corners = triangle.copy()
    corners[:, 2] -= radius
    most, x, y, z = -np.inf, 0.0, 0.0, -1.0
    for sign in (-1.0, 1.0):
        out = out_along(corners, half_width, radius, sign, 0.0, 0.0)
        if out > most:
            most, x, y, z = out, sign, 0.0, 0.0
    for k in range(3):
        cy, cz = corners[k, 1], corners[k, 2]
        out = out_along(corners, half_width, radius, 0.0, cy, cz)
        if out > most:
            most, x, y, z = out, 0.0, cy, cz
    if most >= min(enough, 0.0):
        return most, x, y, z
    edges = np.empty((3, 3))
    for k in range(3):
        for i in range(3):
            edges[k, i] = corners[(k + 1) % 3, i] - corners[k, i]
    nx = edges[0, 1] * edges[1, 2] - edges[0, 2] * edges[1, 1]
    ny = edges[0, 2] * edges[1, 0] - edges[0, 0] * edges[1, 2]
    nz = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    for sign in (-1.0, 1.0):
        out = out_along(corners, half_width, radius, sign * nx, sign * ny, sign * nz)
        if out > most:
            most, x, y, z = out, sign * nx, sign * ny, sign * nz
        for k in range(3):
            # square to an edge and to the axle: mostly that is enough
            ey, ez = sign * edges[k, 1], sign * edges[k, 2]
            out = out_along(corners, half_width, radius, 0.0, -ez, ey)
            if out > most:
                most, x, y, z = out, 0.0, -ez, ey
    across, tried = np.empty((2, 3)), np.empty(DIRECTIONS)
    turn = 2.0 * np.pi / DIRECTIONS
    for k in range(3):
        if most >= min(enough, 0.0):
            return most, x, y, z
        if not _may_cross_rim(corners[k], corners[(k + 1) % 3], half_width, radius, -most):
            continue
        ex, ey, ez = edges[k, 0], edges[k, 1], edges[k, 2]
        length, square = np.sqrt(ex * ex + ey * ey + ez * ez), np.sqrt(ey * ey + ez * ez)
        if length == 0.0:
            continue
        # one square to the axle as well; of an edge along the axle all are
        across[0, 0] = 0.0
        across[0, 1], across[0, 2] = (-ez / square, ey / square) if square > 0.0 else (1.0, 0.0)
        across[1, 0] = (ey * across[0, 2] - ez * across[0, 1]) / length
        across[1, 1] = -ex * across[0, 2] / length
        across[1, 2] = ex * across[0, 1] / length
        for d in range(DIRECTIONS):
            tried[d] = _out_around(corners, half_width, radius, across, _COS[d], _SIN[d])
        for d in range(DIRECTIONS):
            if tried[d] < tried[d - 1] or tried[d] < tried[(d + 1) % DIRECTIONS]:
                continue
            low, high = (d - 1.0) * turn, (d + 1.0) * turn
            first, second = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            one = _out_around(corners, half_width, radius, across, np.cos(first), np.sin(first))
            other = _out_around(corners, half_width, radius, across, np.cos(second), np.sin(second))
            for _ in range(_CLOSER):
                if one > other:
                    high, second, other = second, first, one
                    first = high - _GOLDEN * (high - low)
                    one = _out_around(
                        corners, half_width, radius, across, np.cos(first), np.sin(first)
                    )
                else:
                    low, first, one = first, second, other
                    second = low + _GOLDEN * (high - low)
                    other = _out_around(
                        corners, half_width, radius, across, np.cos(second), np.sin(second)
                    )
            for angle, out in ((d * turn, tried[d]), (first, one), (second, other)):
                if out > most:
                    c, s = np.cos(angle), np.sin(angle)
                    most, x = out, c * across[0, 0] + s * across[1, 0]
                    y, z = c * across[0, 1] + s * across[1, 1], c * across[0, 2] + s * across[1, 2]
    return most, x, y, z


@kernel("UniTuple(float64,4)(float64,float64,float64,float64,float64)")
def distance_of_point(x, y, z, half_width, radius):  # type: ignore[no-untyped-def]
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


@kernel("float64(float64,float64,float64,float64,float64,float64)")
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


@kernel(
    "float64(float64[:,::1],float64[:,:,::1],int64,float64,float64,float64,float64,float64,"
    "float64[:,::1])"
)
def nearest_on_triangle(  # type: ignore[no-untyped-def]
    T, triangles, index, half_width, radius, needed, stop, best, room
):
    """Return the distance of a triangle, or ``best`` if it is not nearer than that.

    One that is nearer than ``stop`` need not be known to be nearer still: a point of it tells that
    at once, as no way out of the triangle is shorter than one out of the point.

    Below the distance lie its own tangent plane, the plane of the wheel's side, the tangent plane
    of its rim, and every mean of the last two: at an edge only such a mean is flat along the part.
    A mean below 0 is no bound of the way out: it counts along less than a direction.
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
    for k in range(3):
        value, _, _, _ = distance_of_point(
            room[0, 3 * k], room[0, 3 * k + 1], room[0, 3 * k + 2], half_width, radius
        )
        best = min(best, value)
    n = 1
    whole = True
    while n > 0 and best >= stop:
        n -= 1
        ax, ay, az = room[n, 0], room[n, 1], room[n, 2]
        bx, by, bz = room[n, 3], room[n, 4], room[n, 5]
        cx, cy, cz = room[n, 6], room[n, 7], room[n, 8]
        x, y, z = (ax + bx + cx) / 3.0, (ay + by + cy) / 3.0, (az + bz + cz) / 3.0
        value, gx, gy, gz = distance_of_point(x, y, z, half_width, radius)
        best = min(best, value)
        if best < stop:
            break
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
            if whole and bound < 0.0:  # it may be in the wheel
                out, _, _, _ = way_out(room[0].reshape(3, 3), half_width, radius, enough)
                if out < 0.0 or out >= enough:
                    return out if out < enough else best
        if bound >= enough or n + 2 > DEEPEST:
            continue
        whole = False
        ab = (ax - bx) ** 2 + (ay - by) ** 2 + (az - bz) ** 2
        bc = (bx - cx) ** 2 + (by - cy) ** 2 + (bz - cz) ** 2
        ca = (cx - ax) ** 2 + (cy - ay) ** 2 + (cz - az) ** 2
        if bc >= ab and bc >= ca:  # turn the corners so that a and b end the longest edge
            ax, ay, az, bx, by, bz, cx, cy, cz = bx, by, bz, cx, cy, cz, ax, ay, az
        elif ca >= ab:
            ax, ay, az, bx, by, bz, cx, cy, cz = cx, cy, cz, ax, ay, az, bx, by, bz
        mx, my, mz = (ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0
        value, _, _, _ = distance_of_point(mx, my, mz, half_width, radius)
        best = min(best, value)
        room[n, 0], room[n, 1], room[n, 2] = ax, ay, az
        room[n, 3], room[n, 4], room[n, 5] = mx, my, mz
        room[n, 6], room[n, 7], room[n, 8] = cx, cy, cz
        room[n + 1, 0], room[n + 1, 1], room[n + 1, 2] = mx, my, mz
        room[n + 1, 3], room[n + 1, 4], room[n + 1, 5] = bx, by, bz
        room[n + 1, 6], room[n + 1, 7], room[n + 1, 8] = cx, cy, cz
        n += 2
    return best
