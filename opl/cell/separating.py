"""Directions along which two bodies are apart: the compiled part of `opl.cell.separation`.

Bodies are poses, shape (b, 4, 4), and sizes, shape (b, 3): half the edges of a box, or radius, half
length and -1 of a cylinder about z; in [m]. They are given by their numbers.
"""

from __future__ import annotations

import numpy as np

from opl.cell.touching import beyond, surely_within
from opl.files.kernels import kernel, prange

DIRECTIONS = 18  # that are tried for a pair
SHORTEST = 1e-4  # of a vector that gives a direction
SLACK = 1e-12  # [m] rounding of how far a group has moved

# types of what both kernels are given first
_GIVEN = (
    "float64[:,::1],"
    "Tuple((float64[:,:,::1],float64[:,::1],int64[::1],float64[:,:,::1],float64[:,::1],"
    "float64[:,::1])),"
    "Tuple((int64[:,::1],int64[::1],int64[:,::1],float64[:,::1])),"
    "float64[::1],float64[:,::1],float64[:,::1],float64,"
)


@kernel()
def _reach(bodies, sizes, b, x, y, z):  # type: ignore[no-untyped-def]
    """How far a body reaches from its middle along a unit vector."""
    c = abs(x * bodies[b, 0, 2] + y * bodies[b, 1, 2] + z * bodies[b, 2, 2])
    if sizes[b, 2] < 0.0:
        return sizes[b, 0] * np.sqrt(max(0.0, 1.0 - c * c)) + sizes[b, 1] * c
    a = abs(x * bodies[b, 0, 0] + y * bodies[b, 1, 0] + z * bodies[b, 2, 0])
    d = abs(x * bodies[b, 0, 1] + y * bodies[b, 1, 1] + z * bodies[b, 2, 1])
    return a * sizes[b, 0] + d * sizes[b, 1] + c * sizes[b, 2]


@kernel()
def _between(bodies, sizes, a, b, way):  # type: ignore[no-untyped-def]
    """What is between two bodies along a vector of any length, -inf if that is none."""
    x, y, z = way
    length = np.sqrt(x * x + y * y + z * z)
    if length < SHORTEST:
        return -np.inf
    x, y, z = x / length, y / length, z / length
    away = (
        x * (bodies[b, 0, 3] - bodies[a, 0, 3])
        + y * (bodies[b, 1, 3] - bodies[a, 1, 3])
        + z * (bodies[b, 2, 3] - bodies[a, 2, 3])
    )
    return abs(away) - _reach(bodies, sizes, a, x, y, z) - _reach(bodies, sizes, b, x, y, z)


@kernel()
def _towards(bodies, sizes, a, b):  # type: ignore[no-untyped-def]
    """Return the vector from the nearest point of a body to the middle of another one."""
    return beyond(bodies, sizes, a, 0.0, bodies[b, 0, 3], bodies[b, 1, 3], bodies[b, 2, 3])


@kernel()
def _direction(bodies, sizes, a, b, number):  # type: ignore[no-untyped-def]
    """Return one of the `DIRECTIONS` likely ones, as a vector of any length; 0 where it is none."""
    if number == 1:
        return _towards(bodies, sizes, a, b)
    if number == 2:
        return _towards(bodies, sizes, b, a)
    if number == 0 or 3 <= number < 9:
        x = bodies[b, 0, 3] - bodies[a, 0, 3]
        y = bodies[b, 1, 3] - bodies[a, 1, 3]
        z = bodies[b, 2, 3] - bodies[a, 2, 3]
        if number == 0:  # from middle to middle
            return x, y, z
        # across the faces of either, and away from the axis of a cylinder
        body = a if number < 6 else b
        column = number - 3 if number < 6 else number - 6
        if sizes[body, 2] >= 0.0 or column == 2:
            return bodies[body, 0, column], bodies[body, 1, column], bodies[body, 2, column]
        if column == 0:
            ex, ey, ez = bodies[body, 0, 2], bodies[body, 1, 2], bodies[body, 2, 2]
            along = ex * x + ey * y + ez * z
            return x - along * ex, y - along * ey, z - along * ez
        return 0.0, 0.0, 0.0
    # across an edge of each; a cylinder has its axis
    i, j = (number - 9) // 3, (number - 9) % 3
    if (sizes[a, 2] >= 0.0 or i == 2) and (sizes[b, 2] >= 0.0 or j == 2):
        return (
            bodies[a, 1, i] * bodies[b, 2, j] - bodies[a, 2, i] * bodies[b, 1, j],
            bodies[a, 2, i] * bodies[b, 0, j] - bodies[a, 0, i] * bodies[b, 2, j],
            bodies[a, 0, i] * bodies[b, 1, j] - bodies[a, 1, i] * bodies[b, 0, j],
        )
    return 0.0, 0.0, 0.0


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


@kernel()
def _place_joints(q, n, before_joint, axes, placed, at_zero, turn):  # type: ignore[no-untyped-def]
    """Bring the joints to where they are at configuration n."""
    for k in range(len(before_joint)):
        _product(placed[k], before_joint[k], at_zero)
        _turn_about(axes[k], q[n, k], turn)
        _product(at_zero, turn, placed[k + 1])


@kernel(
    "void(" + _GIVEN + "float64[::1],float64[::1],int64[::1],boolean[:,::1],boolean[::1])",
    early=True,
    makes_arrays=True,
)
def separate(  # type: ignore[no-untyped-def]
    q, solids, paired, enough, closer, surely, more, last, apart, best, near, met
):
    """Go through configurations one after the other; see `Separation.near` and `near_or_met`.

    Kept up to date from one call to the next: joints ``last``, bounds ``apart``, directions
    ``best``. What may be within its ``closer``, which is no more than ``enough``, is set in
    ``near``, the rest of which is left as it is. Once a pair is found to be within its ``surely``,
    -inf where that is not asked, ``met`` is set and no other pair is looked at. Both have one row
    for all configurations or one for each.

    ``solids`` are the arrays of `Bodies`; ``paired`` the bodies of the pairs, the order in which
    pairs are gone through, and of each group its first place in there, the one after its last, the
    first joint between its bodies, the one after the last, and its levers.

    A group of pairs is looked at when something of it could have become near: by the joints that
    move one body of each and not the other, with the largest levers of the group.
    """
    before_joint, axes, joint, joint_body, sizes, levers = solids
    pairs, order, groups, group_levers = paired
    n_joints, n_bodies = len(before_joint), len(joint)
    placed = np.zeros((n_joints + 1, 4, 4))  # of the joints in the world
    for k in range(4):
        placed[0, k, k] = 1.0
    at_zero, turn = np.zeros((4, 4)), np.zeros((4, 4))
    bodies = np.zeros((n_bodies, 4, 4))
    at: np.ndarray = np.full(n_bodies + 1, -1)
    radii = np.empty(n_bodies)
    for b in range(n_bodies):
        last_edge = max(sizes[b, 2], 0.0)
        radii[b] = np.sqrt(sizes[b, 0] ** 2 + sizes[b, 1] ** 2 + last_edge**2)
    turned = np.zeros(n_joints)  # by each joint since the call began
    seen = np.zeros((len(pairs), n_joints))  # of that, when the bound of a pair was found
    # how far its group has to move until a pair is looked at again, and any pair of the group
    wakes, first_wakes = np.empty(len(pairs)), np.full(len(groups), -np.inf)
    for p in range(len(pairs)):
        wakes[p] = apart[p] - enough[p] - SLACK if apart[p] > enough[p] else -np.inf
    # bodies are placed as they are needed, written out twice: a call for it costs half of the rest
    struck = -1  # the pair that was within its distance the last time: it mostly still is
    for n in range(len(q)):
        for k in range(n_joints):
            turned[k] += abs(q[n, k] - last[k])
            last[k] = q[n, k]
        asked, within = min(n, len(closer) - 1), min(n, len(surely) - 1)
        if struck >= 0 and surely[within, struck] > -np.inf:
            a, b = pairs[struck, 0], pairs[struck, 1]
            if at[-1] < n:
                _place_joints(q, n, before_joint, axes, placed, at_zero, turn)
                at[-1] = n
            for body in (a, b):
                if at[body] < n and (at[body] < 0 or joint[body] > 0):
                    _product(placed[joint[body]], joint_body[body], bodies[body])
                    at[body] = n
            if surely_within(bodies, sizes, a, b, surely[within, struck]):
                met[n] = True
                continue
        for g in range(len(groups)):
            low, high = groups[g, 2], groups[g, 3]
            moved = 0.0
            for k in range(low, high):
                moved += group_levers[g, k] * turned[k]
            if moved < first_wakes[g]:
                continue
            soonest = np.inf
            for place in range(groups[g, 0], groups[g, 1]):
                p = order[place]
                if wakes[p] > moved:
                    soonest = min(soonest, wakes[p])
                    continue
                a, b = pairs[p, 0], pairs[p, 1]
                bound = apart[p]
                for k in range(low, high):
                    bound -= levers[b, k] * (turned[k] - seen[p, k])
                    seen[p, k] = turned[k]
                if bound <= enough[p]:
                    if at[-1] < n:
                        _place_joints(q, n, before_joint, axes, placed, at_zero, turn)
                        at[-1] = n
                    for body in (a, b):
                        if at[body] < n and (at[body] < 0 or joint[body] > 0):
                            _product(placed[joint[body]], joint_body[body], bodies[body])
                            at[body] = n
                    x = bodies[b, 0, 3] - bodies[a, 0, 3]
                    y = bodies[b, 1, 3] - bodies[a, 1, 3]
                    z = bodies[b, 2, 3] - bodies[a, 2, 3]
                    bound = np.sqrt(x * x + y * y + z * z) - radii[a] - radii[b]
                    if bound <= enough[p]:
                        # what was the best direction the last time mostly still is
                        way = _direction(bodies, sizes, a, b, best[p])
                        bound = max(bound, _between(bodies, sizes, a, b, way))
                    if bound <= enough[p]:
                        for number in range(DIRECTIONS):
                            way = _direction(bodies, sizes, a, b, number)
                            along = _between(bodies, sizes, a, b, way)
                            if along > bound:
                                bound, best[p] = along, number
                            if along > enough[p] + more:
                                break
                    if bound <= enough[p] and surely[within, p] > -np.inf:
                        met[n] = surely_within(bodies, sizes, a, b, surely[within, p])
                apart[p] = bound
                if bound > enough[p]:
                    wakes[p] = moved + (bound - enough[p]) - SLACK
                else:
                    wakes[p] = -np.inf
                    near[n, p] = bound <= closer[asked, p]
                soonest = min(soonest, wakes[p])
                if met[n]:
                    struck = p
                    break
            first_wakes[g] = soonest
            if met[n]:
                break
    for p in range(len(pairs)):
        b = pairs[p, 1]
        for k in range(joint[pairs[p, 0]], joint[b]):
            apart[p] -= levers[b, k] * (turned[k] - seen[p, k])


@kernel(
    "void(" + _GIVEN + "float64[:,::1],float64[:,::1],int64[:,::1],boolean[:,::1],boolean[::1],"
    "int64)",
    threads=True,
    early=True,
)
def separate_parts(  # type: ignore[no-untyped-def]
    q, solids, paired, enough, closer, surely, more, last, apart, best, near, met, length
):
    """Go through parts of this length as `separate` does, each with a state of its own."""
    for part in prange(len(last)):
        own = slice(part * length, min((part + 1) * length, len(q)))
        state = last[part], apart[part], best[part], near[own], met[own]
        asked = closer if len(closer) == 1 else closer[own]
        within = surely if len(surely) == 1 else surely[own]
        separate(q[own], solids, paired, enough, asked, within, more, *state)
