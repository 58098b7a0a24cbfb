"""Meshes in PyBullet, in pieces.

PyBullet hands over what it finds between two bodies in blocks of 8 MiB, 47 661 points. With more of
them it reads a second block beyond its memory: distances of any size were seen, and the end of the
process, for a part of 12 800 triangles 13 cm from a link. There it found 3.7 points of a triangle;
two pieces of 50 triangles leave room for 19 of each two. And the pieces that cannot be the nearest
need not be measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from opl.geometry.frames import Array
from opl.verification.arm import At
from opl.verification.patches import Patches


class Pieces:
    """The bodies of a mesh, which are brought to where the mesh is once they are asked for.

    Args:
        patches: Which triangles each has.
        bodies: Bullet's number of each.
        place: Brings a body to a pose.

    Attributes:
        T_base_mesh: Where the mesh is, shape (4, 4), once it was moved there.
    """

    def __init__(
        self, patches: Patches, bodies: Sequence[int], place: Callable[..., object]
    ) -> None:
        self.patches, self.bodies = patches, bodies
        self._place = place
        self._there = np.zeros(len(bodies), dtype=bool)

    def move_to(self, at: At, T_base_mesh: Array) -> None:
        """Move the mesh, its pose given as Bullet takes it and as a matrix of shape (4, 4)."""
        self._at, self.T_base_mesh = at, T_base_mesh
        self._there[:] = False

    def placed(self, k: int) -> int:
        """Return the number of a body that is where the mesh is."""
        if not self._there[k]:
            self._place(self.bodies[k], *self._at)
            self._there[k] = True
        return self.bodies[k]

    def from_box(self, low: Array, high: Array) -> Iterator[tuple[float, int]]:
        """Yield pieces, the nearest first, and how near each can be to a box in [m] at the least.

        The box along the base frame is given by its lowest and highest coordinates, shape (3,).
        """
        bounds = self.patches.from_box(low, high, self.T_base_mesh)
        for k in bounds.argsort(kind="stable").tolist():
            yield float(bounds[k]), k
