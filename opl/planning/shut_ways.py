"""Between which cutter points the part cuts into the wheel all the way, so that no track gets past.

Contact positions at which it does so at both of two cutter points are bands, with others on either
side. It need not cut in between them: on the crest of a wave the whole wheel fits in at one place,
on a flat between two walls at one contact position after the other. A band that is shut at the
contact position where the part is deepest has a track on one side or the other.
"""

from __future__ import annotations

import numpy as np

from opl.cell.wheel_cuts import shut_along
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.planning.depths import nearer_nodes
from opl.planning.scene import PlanningScene

WITHIN = 7  # halvings of the way between cutter points that is too deep in the wheel, but hardly
# parts of a way whose ends are looked at where that is not sure, and [m] between two of them: no
# more and no closer
MOST_PARTS, CLOSE = 64, 5e-5
CLOSE_IN_BAND = 1e-3  # [m] the same where the part is less deep than somewhere else in its band


def shut_ways(
    scene: PlanningScene, points: CutterPoints, contact_positions: Array, wheel_distance: Array
) -> np.ndarray:
    """Return on which contact positions it cuts in from a cutter point to the next, (N - 1, M).

    Of bands that are shut, surely or as far as places close together tell, those at which it cuts
    in at some places between as well.

    Args:
        scene: The part and the wheel.
        points: The N cutter points.
        contact_positions: Those of the field, shape (M,).
        wheel_distance: As of `GrindingProblem`, shape (N, M).
    """
    cuts = wheel_distance < -scene.cell.planned_penetration
    shut = cuts[:-1] & cuts[1:] & (np.diff(points.pass_index) == 0)[:, None]
    ends = np.diff(np.pad(shut, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (edge, first), (_, end) = np.nonzero(ends > 0), np.nonzero(ends < 0)
    if not len(edge):
        return np.asarray(shut)
    nearest = np.maximum(wheel_distance[:-1], wheel_distance[1:])
    bands = list(zip(edge.tolist(), first.tolist(), end.tolist(), strict=True))
    deepest = np.array([a + np.argmin(nearest[k, a:b]) for k, a, b in bands])
    t, before = contact_positions[deepest], edge.astype(float)
    sure = shut_along(scene.cell, scene.part, points, before, before + 1.0, t, WITHIN)
    for k, a, b in (bands[n] for n in _opening(scene, points, edge, t, np.flatnonzero(~sure))):
        shut[k, a:b] = False
    length, parts = np.abs(np.diff(points.arc_length)), 1
    while len(left := np.flatnonzero(shut.any(axis=1) & (length > parts * CLOSE_IN_BAND))):
        parts *= 2
        t_left = np.broadcast_to(contact_positions, (len(left), len(contact_positions)))
        for share in np.arange(1, parts, 2) / parts:
            between = points.at_places(left + share)
            shut[left] = nearer_nodes(scene, between, t_left, shut[left])
    return np.asarray(shut)


def _opening(
    scene: PlanningScene, points: CutterPoints, edge: np.ndarray, t: Array, asked: np.ndarray
) -> list[int]:
    """Return which of some ways the part does not cut in at all places, at a contact position each.

    Args:
        scene: The part and the wheel.
        points: The cutter points.
        edge: After which cutter point each way is, shape (n,).
        t: The contact position of each, shape (n,).
        asked: Which of these are asked about.
    """
    length, parts, found = np.abs(np.diff(points.arc_length))[edge], 1, list[int]()
    while parts < MOST_PARTS and len(asked := asked[length[asked] > parts * CLOSE]):
        parts *= 2
        for share in np.arange(1, parts, 2) / parts:
            between = points.at_places(edge[asked] + share)
            every = np.ones((len(asked), 1), dtype=bool)
            cuts = nearer_nodes(scene, between, t[asked, None], every)[:, 0]
            found += asked[~cuts].tolist()
            if not len(asked := asked[cuts]):
                return found
    return found
