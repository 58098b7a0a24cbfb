"""What is left of a face: the borders and holes that trim curves cut into its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from opl.geometry.curves import SurfaceCurve, clipped
from opl.geometry.frames import Array, read_only
from opl.geometry.section_curves import FaceCurve

# loops with less than this fraction of the area of all parameters enclose nothing
_LEAST_AREA = 1e-12

# what is narrower than this along a curve is not seen [m]; no more looks than this at one curve
_LOOK = 0.1e-3
_MAX_LOOKS = 4000
_HALVINGS = 40

# points tested at once, so that they fit into memory with all edges of the loops
_BLOCK = 4096


@dataclass(frozen=True, eq=False)
class Trim:
    """Closed polygons in the parameters of a surface; inside is what an odd number encloses.

    Attributes:
        loops: Corners (u, v) of each polygon, the first not repeated, shapes (k, 2).
    """

    loops: tuple[Array, ...]

    def __post_init__(self) -> None:
        loops = []
        for loop in self.loops:
            own = read_only(loop)
            if own.ndim != 2 or own.shape[1] != 2 or len(own) < 3 or not np.isfinite(own).all():
                raise ValueError(f"a loop must be three or more (u, v), got shape {own.shape}")
            loops.append(own)
        object.__setattr__(self, "loops", tuple(loops))

    def check_against(self, domain: Array) -> None:
        """Refuse loops that leave nothing of a surface with a domain, as in `NurbsSurface.domain`.

        Raises:
            ValueError: If no loop has an area, or none reaches into the domain.
        """
        if not max(map(polygon_area, self.loops)) > _LEAST_AREA * float(
            np.ptp(domain, axis=0).prod()
        ):
            raise ValueError("trim_loops: enclose no area")
        low, high = (of(np.concatenate(self.loops), axis=0) for of in (np.min, np.max))
        if (low >= domain[1]).any() or (high <= domain[0]).any():
            (u0, v0), (u1, v1) = domain
            raise ValueError(
                f"trim_loops: lie outside the parameters of the surface, {u0:g} to {u1:g} along u "
                f"and {v0:g} to {v1:g} along v"
            )

    def contains(self, uv: Array) -> np.ndarray:
        """Return whether parameters are inside, shape (...)."""
        starts = np.concatenate(self.loops)
        ends = np.concatenate([np.roll(loop, -1, axis=0) for loop in self.loops])
        flat = np.asarray(uv).reshape(-1, 2)
        inside = np.empty(len(flat), dtype=bool)
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = (ends[:, 0] - starts[:, 0]) / (ends[:, 1] - starts[:, 1])
            for first in range(0, len(flat), _BLOCK):
                u, v = flat[first : first + _BLOCK, :, None].swapaxes(0, 1)
                # edges that cross the line from a point along +u, which even-odd counts
                beside = (starts[:, 1] > v) != (ends[:, 1] > v)
                crossed = beside & (u < starts[:, 0] + (v - starts[:, 1]) * slopes)
                inside[first : first + _BLOCK] = np.count_nonzero(crossed, axis=1) % 2 == 1
        return inside.reshape(np.asarray(uv).shape[:-1])


def polygon_area(loop: Array) -> float:
    """Return the area inside a closed polygon in a plane, corners of shape (k, 2)."""
    x, y = loop.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def parts_inside(curve: FaceCurve, trim: Trim) -> Sequence[SurfaceCurve]:
    """Return the parts of a curve that lie inside a trim, in order."""
    count = int(np.clip(np.ceil(curve.length / _LOOK), 8, _MAX_LOOKS))
    looks = np.linspace(0.0, curve.length, count + 1)
    inside = trim.contains(curve.parameters(looks))
    changes = np.flatnonzero(inside[1:] != inside[:-1])
    left, right, state = looks[changes], looks[changes + 1], inside[changes]
    for _ in range(_HALVINGS if len(changes) else 0):
        middle = 0.5 * (left + right)
        same = trim.contains(curve.parameters(middle)) == state
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    # the side that is inside
    ends = np.where(state, left, right).tolist()
    if inside[0]:
        ends.insert(0, 0.0)
    if inside[-1]:
        ends.append(curve.length)
    return [
        clipped(curve, start, end)
        for start, end in zip(ends[::2], ends[1::2], strict=True)
        if end > start
    ]
