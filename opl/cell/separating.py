"""Directions along which two bodies are apart: the compiled part of `opl.cell.separation`.

A body is its pose, shape (4, 4), and half the edges of a box, or radius, half length and -1 of a
cylinder about z, shape (3,); in [m].
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

DIRECTIONS = 18  # that are tried for a pair
SHORTEST = 1e-4  # of a vector that gives a direction


@kernel()
def _reach(T, size, x, y, z):  # type: ignore[no-untyped-def]
    """How far a body reaches from its middle along a unit vector."""
    c = abs(x * T[0, 2] + y * T[1, 2] + z * T[2, 2])
    if size[2] < 0.0:
        return size[0] * np.sqrt(max(0.0, 1.0 - c * c)) + size[1] * c
    a = abs(x * T[0, 0] + y * T[1, 0] + z * T[2, 0])
    b = abs(x * T[0, 1] + y * T[1, 1] + z * T[2, 1])
    return a * size[0] + b * size[1] + c * size[2]


@kernel()
def _between(T, size, other, other_size, way):  # type: ignore[no-untyped-def]
    """What is between two bodies along a vector of any length, -inf if that is none."""
    length = np.sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2])
    if length < SHORTEST:
        return -np.inf
    x, y, z = way[0] / length, way[1] / length, way[2] / length
    away = x * (other[0, 3] - T[0, 3]) + y * (other[1, 3] - T[1, 3]) + z * (other[2, 3] - T[2, 3])
    return abs(away) - _reach(T, size, x, y, z) - _reach(other, other_size, x, y, z)


@kernel()
def _towards(T, size, other, way):  # type: ignore[no-untyped-def]
    """Set a vector from the nearest point of a body to the middle of another one."""
    dx, dy, dz = other[0, 3] - T[0, 3], other[1, 3] - T[1, 3], other[2, 3] - T[2, 3]
    a = dx * T[0, 0] + dy * T[1, 0] + dz * T[2, 0]
    b = dx * T[0, 1] + dy * T[1, 1] + dz * T[2, 1]
    c = dx * T[0, 2] + dy * T[1, 2] + dz * T[2, 2]
    if size[2] < 0.0:
        away = np.sqrt(a * a + b * b)
        part = max(0.0, away - size[0]) / away if away > 0.0 else 0.0
        a, b = part * a, part * b
        c -= min(max(c, -size[1]), size[1])
    else:
        a -= min(max(a, -size[0]), size[0])
        b -= min(max(b, -size[1]), size[1])
        c -= min(max(c, -size[2]), size[2])
    for k in range(3):
        way[k] = a * T[k, 0] + b * T[k, 1] + c * T[k, 2]


@kernel()
def _direction(T, size, other, other_size, number, way):  # type: ignore[no-untyped-def]
    """Set one of the `DIRECTIONS` likely ones, as a vector of any length; 0 where it is none."""
    way[:] = 0.0
    if number == 0:  # from middle to middle
        for k in range(3):
            way[k] = other[k, 3] - T[k, 3]
    elif number == 1:
        _towards(T, size, other, way)
    elif number == 2:
        _towards(other, other_size, T, way)
    elif number < 9:  # across the faces of either, and away from the axis of a cylinder
        first = number < 6
        axes, extent = (T, size) if first else (other, other_size)
        column = number - 3 if first else number - 6
        if extent[2] >= 0.0 or column == 2:
            for k in range(3):
                way[k] = axes[k, column]
        elif column == 0:
            along = 0.0
            for k in range(3):
                along += axes[k, 2] * (other[k, 3] - T[k, 3])
            for k in range(3):
                way[k] = other[k, 3] - T[k, 3] - along * axes[k, 2]
    else:  # across an edge of each; a cylinder has its axis
        i, j = (number - 9) // 3, (number - 9) % 3
        if (size[2] >= 0.0 or i == 2) and (other_size[2] >= 0.0 or j == 2):
            way[0] = T[1, i] * other[2, j] - T[2, i] * other[1, j]
            way[1] = T[2, i] * other[0, j] - T[0, i] * other[2, j]
            way[2] = T[0, i] * other[1, j] - T[1, i] * other[0, j]


@kernel()
def _product(A, B, C):  # type: ignore[no-untyped-def]
    """Set C to A B, poses all."""
    for i in range(3):
        for j in range(4):
            C[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]
        C[i, 3] += A[i, 3]


@kernel()
def _turn_about(axis, angle, T):  # type: ignore[no-untyped-def]
    """Set the rotation of a pose to the turn about a unit axis."""
    s, c = np.sin(angle), np.cos(angle)
    x, y, z = axis
    d = 1.0 - c
    T[0, 0], T[0, 1], T[0, 2] = c + d * x * x, d * x * y - s * z, d * x * z + s * y
    T[1, 0], T[1, 1], T[1, 2] = d * y * x + s * z, c + d * y * y, d * y * z - s * x
    T[2, 0], T[2, 1], T[2, 2] = d * z * x - s * y, d * z * y + s * x, c + d * z * z


@kernel(
    "void(float64[:,::1],float64[:,:,::1],float64[:,::1],int64[::1],float64[:,:,::1],"
    "float64[:,::1],float64[:,::1],int64[:,::1],float64[::1],float64,float64[::1],float64[::1],"
    "int64[::1],boolean[:,::1])"
)
def separate(  # type: ignore[no-untyped-def]
    q,
    before_joint,
    axes,
    joint,
    joint_body,
    sizes,
    levers,
    pairs,
    enough,
    more,
    last,
    apart,
    best,
    near,
):
    """Go through configurations one after the other; see `Separation.near`.

    Kept up to date from one to the next: joints ``last``, bounds ``apart``, directions ``best``.
    """
    n_joints, n_bodies = len(before_joint), len(joint)
    placed = np.zeros((n_joints + 1, 4, 4))  # of the joints in the world
    for k in range(4):
        placed[0, k, k] = 1.0
    at_zero, turn, way = np.zeros((4, 4)), np.zeros((4, 4)), np.empty(3)
    bodies = np.zeros((n_bodies, 4, 4))
    at: np.ndarray = np.full(n_bodies, -1)  # number of the configuration a body was placed at
    # how far each body can have moved by the joints up to one
    moved = np.zeros((n_bodies, n_joints + 1))
    radii = np.empty(n_bodies)
    for b in range(n_bodies):
        last_edge = max(sizes[b, 2], 0.0)
        radii[b] = np.sqrt(sizes[b, 0] ** 2 + sizes[b, 1] ** 2 + last_edge**2)
    for n in range(len(q)):
        for b in range(n_bodies):
            for k in range(joint[b]):
                moved[b, k + 1] = moved[b, k] + abs(q[n, k] - last[k]) * levers[b, k]
        last[:] = q[n]
        chain = False
        for p in range(len(pairs)):
            a, b = pairs[p, 0], pairs[p, 1]
            apart[p] -= moved[b, joint[b]] - moved[b, joint[a]]  # the second is moved by more
            if apart[p] > enough[p]:
                near[n, p] = False
                continue
            if not chain:
                chain = True
                for k in range(n_joints):
                    _product(placed[k], before_joint[k], at_zero)
                    _turn_about(axes[k], q[n, k], turn)
                    _product(at_zero, turn, placed[k + 1])
            for body in (a, b):
                if at[body] < n and (at[body] < 0 or joint[body] > 0):
                    _product(placed[joint[body]], joint_body[body], bodies[body])
                    at[body] = n
            x = bodies[b, 0, 3] - bodies[a, 0, 3]
            y = bodies[b, 1, 3] - bodies[a, 1, 3]
            z = bodies[b, 2, 3] - bodies[a, 2, 3]
            apart[p] = np.sqrt(x * x + y * y + z * z) - radii[a] - radii[b]
            if apart[p] > enough[p]:
                near[n, p] = False
                continue
            T, size, other, other_size = bodies[a], sizes[a], bodies[b], sizes[b]
            # what was the best direction the last time mostly still is
            _direction(T, size, other, other_size, best[p], way)
            apart[p] = max(apart[p], _between(T, size, other, other_size, way))
            if apart[p] <= enough[p]:
                for number in range(DIRECTIONS):
                    _direction(T, size, other, other_size, number, way)
                    bound = _between(T, size, other, other_size, way)
                    if bound > apart[p]:
                        apart[p], best[p] = bound, number
                    if bound > enough[p] + more:
                        break
            near[n, p] = apart[p] <= enough[p]
