"""Joint boxes: a range for each joint.

The joint range sum of a track is the size of the box that its nodes span.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.geometry.frames import Array


@dataclass(frozen=True)
class JointBox:
    """A range for each joint.

    Attributes:
        lower: Lower faces in [rad], shape (6,).
        upper: Upper faces in [rad], shape (6,).
    """

    lower: Array
    upper: Array

    @property
    def size(self) -> float:
        """Sum of the edges in [rad]: the joint range sum of a track that touches every face."""
        return float(np.sum(self.upper - self.lower))

    def widened(self, amount: float) -> JointBox:
        """Return the box that is larger by ``amount`` in [rad] in all, the same at every face."""
        step = amount / (2.0 * len(self.lower))
        return JointBox(self.lower - step, self.upper + step)

    def scaled(self, size: float) -> JointBox:
        """Return the box of a size in [rad] with the same middle and ratio of edges.

        Its own size is not 0.
        """
        middle, edges = (self.lower + self.upper) / 2.0, self.upper - self.lower
        half = edges * (size / self.size / 2.0)
        return JointBox(middle - half, middle + half)

    def holds(self, q: Array) -> np.ndarray:
        """Return which ``q``, shape (..., 6), lie inside; round-off at a face is forgiven."""
        inside = (q >= self.lower - 1e-12) & (q <= self.upper + 1e-12)
        return np.asarray(inside.all(axis=-1))
