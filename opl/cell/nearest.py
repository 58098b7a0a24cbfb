"""How near anything comes that has to keep a distance, and which two bodies that are.

For pictures: the planner asks only yes or no, and what is proven the replay measures.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opl.cell.collision import BodyPair, CollisionScene
from opl.geometry.frames import Array


@dataclass(frozen=True, eq=False)
class Nearest:
    """The nearest pair at each of some configurations.

    Attributes:
        distance: In [m], 0 or less in collision, shape (n,).
        pair: Index of the pair, shape (n,).
        points: Where the two are nearest in the base frame in [m], shape (n, 2, 3).
        pairs: The names of the pairs.
    """

    distance: Array
    pair: np.ndarray
    points: Array
    pairs: tuple[BodyPair, ...]


def nearest_pairs(scene: CollisionScene, q: Array) -> Nearest:
    """Return the nearest pair that has to keep a distance, part against wheel aside.

    A pair is measured only when it could have become the nearest: since it was last measured its
    distance cannot have shrunk by more than the joints turned times their levers.

    Args:
        scene: The cell.
        q: Configurations in [rad], the fewer pairs are measured the nearer they follow each other,
            shape (n, 6).
    """
    kept = scene.kept_apart
    separation = scene.separation(kept)
    least = separation.apart
    distance, chosen = np.full(len(q), np.inf), np.zeros(len(q), dtype=np.intp)
    points = np.zeros((len(q), 2, 3))
    for k, configuration in enumerate(q):
        if not len(kept):
            break
        scene.place(configuration)
        # the pair that was the nearest before is likely to be near still
        chosen[k] = chosen[k - 1] if k else 0
        distance[k] = scene.distance(int(kept[chosen[k]]))
        near = np.flatnonzero(separation.near(configuration[None], np.full(len(kept), distance[k])))
        for index in near[least[near].argsort(kind="stable")]:
            if least[index] >= distance[k]:
                break
            least[index] = scene.distance(int(kept[index]))
            if least[index] < distance[k]:
                distance[k], chosen[k] = least[index], index
        points[k] = scene.nearest_points(int(kept[chosen[k]]))
    return Nearest(distance, chosen, points, tuple(scene.pair(int(index)) for index in kept))
