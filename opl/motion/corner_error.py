"""How far a corner between two joint lines takes the contact from the wheel if it is cut off.

A controller may leave the one line before the corner and join the other after it, no earlier than
half-way. The chord between is looked at: less is cut off by every other rounding.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.motion.line_error import Run, Screws, flange_at, off_target

# of the way along the chord, those first that are mostly off the most
_SHARES = tuple(n / 8.0 for n in (4, 3, 5, 2, 6, 1, 7))


def corner_error(screws: Screws, run: Run, corner: tuple[int, int, int], zone: float) -> float:
    """Return how far from the wheel's surface a corner that is cut off takes the part, in [m].

    Args:
        screws: The arm.
        run: The run.
        corner: Where the line comes from, turns and leads to.
        zone: How far from the corner in [m] of the tool point either line may be left, no earlier
            than half-way.
    """
    arm = screws.axes, screws.T_base_flange
    found = rounded_off(*arm, *run.arrays[:4], run.tool, *corner, zone, np.inf)
    return float(found)


@kernel(makes_arrays=True)
def rounded_off(axes, T0, q, places, targets, freedom, tool, i, j, k, zone, most):  # type: ignore[no-untyped-def]
    """Return how far along its normal the contact is off in [m] if the corner at j is cut off.

    Of a corner that is off by more than ``most`` anything that is more.
    """
    T, point, off, other = np.empty((3, 4)), np.empty(6), np.empty(6), np.empty(6)
    left, begun = _cut(tool, j, i, zone), _cut(tool, j, k, zone)
    worst = 0.0
    for share in _SHARES:
        for c in range(6):
            before, after = q[i, c] - q[j, c], q[k, c] - q[j, c]
            point[c] = q[j, c] + (1.0 - share) * left * before + share * begun * after
        flange_at(axes, T0, point, T)
        # walk to the place that is nearest
        m, step = j, 0
        nearest = _off_but(T, places[m], targets[m], freedom[m], off)
        for way in (-1, 1):
            while i <= m + way <= k and step != -way:
                beside = m + way
                found = _off_but(T, places[beside], targets[beside], freedom[beside], other)
                if found >= nearest:
                    break
                m, nearest, step = beside, found, way
                off[:] = other
        # what is passed lies between the nearest place and one beside it: where the contact slides,
        # by how the part is turned, where it rolls, by what comes to the edge
        normal, told_by = off[2], 4 - freedom[m]
        for side in (m - 1, m + 1):
            if i <= side <= k:
                off_target(T, places[side], targets[m], other)
                if off[told_by] * other[told_by] < 0.0:
                    s = off[told_by] / (off[told_by] - other[told_by])
                    normal = off[2] + s * (other[2] - off[2])
        worst = max(worst, abs(normal))
        if worst > most:
            break
    return worst


@kernel()
def _off_but(T, place, target, free, off):  # type: ignore[no-untyped-def]
    """Put how far a place is from its target into off, but for what the contact may do there.

    And return the square of what that is.
    """
    off_target(T, place, target, off)
    off[free] = 0.0
    total = 0.0
    for c in range(6):
        total += off[c] * off[c]
    return total


@kernel()
def _cut(tool, corner, end, zone):  # type: ignore[no-untyped-def]
    """Return which share of a line may be cut off at a corner."""
    square = 0.0
    for c in range(3):
        square += (tool[end, c] - tool[corner, c]) ** 2
    length = np.sqrt(square)
    return 0.5 if zone >= 0.5 * length else zone / length
