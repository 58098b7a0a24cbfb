"""How far a corner between two joint lines takes the contact from the wheel if it is cut off.

A controller may leave the one line before the corner and join the other after it, no earlier than
half-way. The chord between is looked at: less is cut off by every other rounding.
"""

from __future__ import annotations

import numpy as np

from opl.files.kernels import kernel
from opl.motion.line_error import Run, Screws, off_target

_SHARES = tuple(n / 8.0 for n in range(1, 8))  # of the way along the chord


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
    found = rounded_off(*arm, *run.arrays[:4], run.tool, *corner, zone)
    return float(found)


@kernel()
def rounded_off(axes, T0, q, places, targets, freedom, tool, i, j, k, zone):  # type: ignore[no-untyped-def]
    """Return how far along its normal the contact is off in [m] if the corner at j is cut off."""
    T, point, off, other = np.empty((3, 4)), np.empty(6), np.empty(6), np.empty(6)
    left, begun = _cut(tool, j, i, zone), _cut(tool, j, k, zone)
    worst = 0.0
    for share in _SHARES:
        for c in range(6):
            before, after = q[i, c] - q[j, c], q[k, c] - q[j, c]
            point[c] = q[j, c] + (1.0 - share) * left * before + share * begun * after
        # walk to the place that is nearest
        m, step = j, 0
        _off_but(axes, T0, point, places[m], targets[m], freedom[m], T, off)
        nearest = np.square(off).sum()
        for way in (-1, 1):
            while i <= m + way <= k and step != -way:
                _off_but(
                    axes, T0, point, places[m + way], targets[m + way], freedom[m + way], T, other
                )
                found = np.square(other).sum()
                if found >= nearest:
                    break
                m, nearest, step = m + way, found, way
                off[:] = other
        # what is passed lies between the nearest place and one beside it: where the contact slides,
        # by how the part is turned, where it rolls, by what comes to the edge
        normal, told_by = off[2], 4 - freedom[m]
        for side in (m - 1, m + 1):
            if i <= side <= k:
                off_target(axes, T0, point, places[side], targets[m], T, other)
                if off[told_by] * other[told_by] < 0.0:
                    s = off[told_by] / (off[told_by] - other[told_by])
                    normal = off[2] + s * (other[2] - off[2])
        worst = max(worst, abs(normal))
    return worst


@kernel()
def _off_but(axes, T0, q, place, target, free, T, off):  # type: ignore[no-untyped-def]
    """Put how far a place is from its target into off, but for what the contact may do there."""
    off_target(axes, T0, q, place, target, T, off)
    off[free] = 0.0


@kernel()
def _cut(tool, corner, end, zone):  # type: ignore[no-untyped-def]
    """Return which share of a line may be cut off at a corner."""
    length = np.sqrt(np.square(tool[end] - tool[corner]).sum())
    return 0.5 if zone >= 0.5 * length else zone / length
