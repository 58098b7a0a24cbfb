"""Boxes and cylinders that certainly are as near as asked, or sunk into each other as deep.

Bodies as in `opl.cell.separating`. From body to body each time to the nearest point: the way left
is never shorter than the distance, and soon no longer.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel

ROUNDS = 8  # from body to body and back
SPARE = 1e-5  # [m] by which bodies that are to touch are seen to sink into each other


@kernel()
def beyond(bodies, sizes, a, thinner, x, y, z):  # type: ignore[no-untyped-def]
    """Return the vector to a place from the nearest point of a body that is thinner all around."""
    dx, dy, dz = x - bodies[a, 0, 3], y - bodies[a, 1, 3], z - bodies[a, 2, 3]
    x = dx * bodies[a, 0, 0] + dy * bodies[a, 1, 0] + dz * bodies[a, 2, 0]
    y = dx * bodies[a, 0, 1] + dy * bodies[a, 1, 1] + dz * bodies[a, 2, 1]
    z = dx * bodies[a, 0, 2] + dy * bodies[a, 1, 2] + dz * bodies[a, 2, 2]
    first, second = sizes[a, 0] - thinner, sizes[a, 1] - thinner
    if sizes[a, 2] < 0.0:
        away = np.sqrt(x * x + y * y)
        part = max(0.0, away - first) / away if away > 0.0 else 0.0
        x, y = part * x, part * y
        z -= min(max(z, -second), second)
    else:
        third = sizes[a, 2] - thinner
        x -= min(max(x, -first), first)
        y -= min(max(y, -second), second)
        z -= min(max(z, -third), third)
    return (
        x * bodies[a, 0, 0] + y * bodies[a, 0, 1] + z * bodies[a, 0, 2],
        x * bodies[a, 1, 0] + y * bodies[a, 1, 1] + z * bodies[a, 1, 2],
        x * bodies[a, 2, 0] + y * bodies[a, 2, 1] + z * bodies[a, 2, 2],
    )


@kernel()
def _thickness(sizes, a):  # type: ignore[no-untyped-def]
    """Return by how much a body may be made thinner all around."""
    least = min(sizes[a, 0], sizes[a, 1])
    return least if sizes[a, 2] < 0.0 else min(least, sizes[a, 2])


@kernel()
def surely_within(bodies, sizes, a, b, distance):  # type: ignore[no-untyped-def]
    """Return whether two bodies are found to be apart by no more than that.

    Below 0 they have to sink into each other: what touches a body that is thinner by so much does.
    """
    thinner = max(SPARE - distance, 0.0)
    if _thickness(sizes, a) < thinner:
        a, b = b, a
    if _thickness(sizes, a) < thinner:
        return False
    allowed = (distance + thinner) ** 2
    x, y, z = bodies[b, 0, 3], bodies[b, 1, 3], bodies[b, 2, 3]
    for _ in range(ROUNDS):
        for body, less in ((a, thinner), (b, 0.0)):
            dx, dy, dz = beyond(bodies, sizes, body, less, x, y, z)
            if dx * dx + dy * dy + dz * dz <= allowed:
                return True
            x, y, z = x - dx, y - dy, z - dz
    return False
