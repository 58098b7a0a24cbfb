"""How near the part is to the wheel at nodes: exact where it is deeper in it than allowed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from opl.cell.wheel_distance import signed_wheel_distance
from opl.geometry.frames import Array, inverse
from opl.geometry.toolpath import CutterPoints
from opl.planning.scene import PlanningScene
from opl.planning.turned import blocks_of


def wheel_distances(scene: PlanningScene, points: CutterPoints, contact_positions: Array) -> Array:
    """Return the signed distance of the part to the wheel at all nodes in [m], shape (N, M).

    As in `signed_wheel_distance`: exact where it is less than the belt penetration permits, else
    anything that is not, or infinite. Contact positions are for all cutter points, shape (M,).
    """
    wheel, depth = scene.cell.wheel, -scene.cell.planned_penetration
    # on the flat the part slides along the axle, by half of the wheel's width at the most: where it
    # keeps off a wheel that is wider by so much, it does at every contact position there
    wide = replace(wheel, width=2.0 * wheel.width)
    Ts = wheel.T_contact0_contact(0.0) @ inverse(points.Ts_workpiece_cutter)
    keeps_off = signed_wheel_distance(scene.part, wide, Ts, depth, depth) >= depth
    asked = ~(keeps_off[:, None] & (np.abs(contact_positions) <= wheel.flat_end))
    allowed = np.full((len(points), 1), depth)
    layer = _measured(scene, points, contact_positions, asked, allowed, -np.inf)
    layer[~asked] = np.inf
    return layer


def nearer_nodes(
    scene: PlanningScene,
    points: CutterPoints,
    contact_positions: Array,
    asked: np.ndarray,
    needed: Array | None = None,
) -> np.ndarray:
    """Return at which nodes the part is nearer to the wheel than needed, shape (N, M).

    Args:
        scene: The part and the wheel.
        points: The cutter points.
        contact_positions: Of each, shape (N, M).
        asked: Which nodes are looked at, shape (N, M); of all others it is said that it is not.
        needed: In [m], of each cutter point, shape (N, 1); if not given what the belt permits.
    """
    if needed is None:
        needed = np.full((len(points), 1), -scene.cell.planned_penetration)
    layer = _measured(scene, points, contact_positions, asked, needed, needed)
    return np.asarray(asked & (layer < needed))


def _measured(
    scene: PlanningScene,
    points: CutterPoints,
    contact_positions: Array,
    asked: np.ndarray,
    needed: Array,
    enough: Array | float,
) -> Array:
    """Return distances as `signed_wheel_distance` does of nodes asked about, any of all others."""
    wheel = scene.cell.wheel
    layer = np.empty(asked.shape)
    Ts_cutter_workpiece = inverse(points.Ts_workpiece_cutter)
    t = np.broadcast_to(contact_positions, asked.shape)
    stops = np.broadcast_to(enough, needed.shape)
    for block in blocks_of(*asked.shape):
        now = asked[block]
        columns, _ = np.nonzero(now)
        # cutter and contact coincide, whatever robot brings the part there
        Ts = wheel.T_contact0_contact(t[block][now]) @ Ts_cutter_workpiece[block][columns]
        told = needed[block][columns, 0], stops[block][columns, 0]
        layer[block][now] = signed_wheel_distance(scene.part, wheel, Ts, *told)
    return layer
