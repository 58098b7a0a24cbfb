"""Whether surface and solid can be one part that a robot holds: the test for wrong units."""

from __future__ import annotations

from typing import Literal

import numpy as np

from opl.geometry.frames import Array
from opl.geometry.mesh import TriangleMesh
from opl.geometry.passes import MachinedSurface

SMALLEST, LARGEST = 1e-3, 5.0  # [m]
_FACTOR = 50.0  # between surface and solid; units differ by 1000 or 25.4


class SizeError(ValueError):
    """A surface or a solid has a size or a place that it cannot have.

    Attributes:
        of: Which of them is to blame.
    """

    def __init__(self, of: Literal["part", "surface"], message: str) -> None:
        super().__init__(message)
        self.of = of


def check_sizes(surface: MachinedSurface, part: TriangleMesh) -> None:
    """Refuse sizes that no part has, and a surface that is not on its solid.

    Raises:
        SizeError: If something is too small, too large, or elsewhere.
    """
    own = np.array([surface.extent_along(axis) for axis in np.eye(3)]).T
    solid = np.array([part.vertices.min(axis=0), part.vertices.max(axis=0)])
    boxes: tuple[tuple[Literal["part", "surface"], Array], ...] = (
        ("part", solid),
        ("surface", own),
    )
    for of, box in boxes:
        size = _size(box)
        if not SMALLEST <= size <= LARGEST:
            raise SizeError(
                of,
                f"is {1e3 * size:g} mm long; a part is {1e3 * SMALLEST:g} to "
                f"{1e3 * LARGEST:g} mm; is the unit right?",
            )
    ratio = _size(own) / _size(solid)
    if not 1.0 / _FACTOR <= ratio <= _FACTOR:
        raise SizeError(
            "surface",
            f"is {1e3 * _size(own):g} mm long, the solid in the mesh "
            f"{1e3 * _size(solid):g} mm; is the unit of one of them wrong?",
        )
    gap = np.maximum(own[0] - solid[1], solid[0] - own[1]).max()
    if gap > 0.05 * _size(solid):
        raise SizeError(
            "surface",
            f"lies {1e3 * gap:.4g} mm away from the solid in the mesh; both must be in "
            "the workpiece frame",
        )


def _size(box: Array) -> float:
    return float(np.ptp(box, axis=0).max())
