"""Boxes with a track of low travel: no more than another path makes, in as small a box as can be.

The least box may force the contact to move further than it would have to in a box that is a little
larger on some of its faces. Dynamic programming finds which ones: the least travel of t in a box.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.search.box import JointBox
from opl.search.ladder import Ladder
from opl.search.smooth import TrackCost, Travel, smoothest, travel_of

CONTACT_WEIGHT = 1.0  # cost of moving t by one belt unit against 1 for each radian of a joint
HALVINGS = 7  # of the distance by which faces are moved out
ROUND_OFF = 1e-7  # [rad]


def low_travel_box(
    ladder: Ladder, blocked: np.ndarray, cost: TrackCost, box: JointBox, size: float, most: Travel
) -> JointBox | None:
    """Widen a box as little as needed for a track that moves no further than wanted.

    All faces are moved out by the same amount, as little as there is such a track, and then brought
    back, one after the other, as far as there still is one.

    The result is not larger than `size` in [rad]; `blocked` are the sorted keys of the edges that
    are not free, int64.

    Returns:
        The box, or None if there is no track in one that small.
    """
    dear = replace(cost, contact_weight=CONTACT_WEIGHT, node_cost=np.zeros(ladder.free.shape))
    q = np.nan_to_num(ladder.q, nan=np.inf)

    def spanned(outer: JointBox) -> JointBox | None:
        """Return the box of the track that travels least in an outer one, if that is low enough."""
        track = smoothest(ladder, blocked, outer.holds(q), dear)
        if track is None or not travel_of(ladder, track.rows).within(most):
            return None
        on_track = ladder.q[np.arange(len(track.rows)), track.rows]
        return JointBox(
            np.minimum(box.lower, on_track.min(axis=0)), np.maximum(box.upper, on_track.max(axis=0))
        )

    found = None
    shut, wide = 0.0, 2 * len(box.lower) * (size - box.size)
    for _ in range(HALVINGS):
        amount = wide if found is None else (shut + wide) / 2.0
        outer = spanned(box.widened(amount)) if amount > 0.0 else None
        if outer is not None:
            found, wide = outer, amount
        elif found is None:
            return None
        else:
            shut = amount
    assert found is not None
    for face in reversed(range(2 * len(box.lower))):
        found = _bring_back(face, _faces(box)[face], found, spanned)
    return found if found.size <= size else None


def _bring_back(
    face: int, home: float, found: JointBox, spanned: Callable[[JointBox], JointBox | None]
) -> JointBox:
    """Return a box with one of its faces as near to its home as a track remains inside."""
    tried = shut = home
    for _ in range(HALVINGS):
        faces = _faces(found)
        if faces[face] <= shut + ROUND_OFF:
            break
        faces[face] = tried
        closer = spanned(_box(faces))
        if closer is None:
            shut = tried
        else:
            found = closer
        tried = (shut + _faces(found)[face]) / 2.0
    return found


def _faces(box: JointBox) -> Array:
    """Return how far out each face of a box is, shape (12,)."""
    return np.concatenate([-box.lower, box.upper])


def _box(faces: Array) -> JointBox:
    lower, upper = np.split(faces, 2)
    return JointBox(-lower, upper)
