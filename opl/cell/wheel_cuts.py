"""Where along a pass the part surely cuts into the wheel, all the way from place to place.

That is certain only where it is deeper in the wheel, at some place, than what is there of it can
move up to the ends of the stretch: all of the part, or one of its triangles. Stretches of which it
is not are halved.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from opl.cell.part_tree import PartTree
from opl.cell.wheel_distance import nearest_triangle
from opl.cell.wheel_triangle import TOLERANCE
from opl.cell.workcell import WorkCell
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints

MOST_HALVINGS = 12  # of a cell where something begins
LARGEST_TURN = 0.3  # [rad] of a cutter frame from one point to the next; about
# Turn of a cutter frame for each of what its z and x move by from one cutter point to the next, at
# the most: both are blended, normalized, and x made perpendicular to z, which none of it doubles
TURN = 4.0


def halved(
    run: np.ndarray,
    low: Array,
    high: Array,
    surely: Callable[[np.ndarray, Array, Array], tuple[np.ndarray, np.ndarray]],
    most_within: int = MOST_HALVINGS,
    few: int = 0,
) -> tuple[np.ndarray, Array, Array, np.ndarray]:
    """Return cells, halved where something begins in them, and which of them it surely fills.

    Args:
        run: To which run each cell belongs, not decreasing, shape (n,).
        low: Least of each, one beginning where the one before in its run ends.
        high: Greatest of each.
        surely: Which cells of these it surely fills, and where it is at their middle.
        most_within: How often a cell is halved that lies within it, but not surely.
        few: How many of those are left where they are halved on nevertheless.
    """
    cuts, deep = surely(run, low, high)
    for halving in range(MOST_HALVINGS):
        unsure = deep & ~cuts
        unsure &= halving < most_within or np.count_nonzero(unsure) <= few
        begins = (deep[:-1] != deep[1:]) & (run[:-1] == run[1:])
        unsure[:-1] |= begins & ~deep[:-1]
        unsure[1:] |= begins & ~deep[1:]
        if not unsure.any():
            break
        parts = np.where(unsure, 2, 1)
        middle = (low + high) / 2.0
        fresh, second = np.repeat(unsure, parts), np.zeros(parts.sum(), dtype=bool)
        second[(np.cumsum(parts) - 1)[unsure]] = True
        first = fresh & ~second
        run, low, high, middle, cuts, deep = (
            np.repeat(values, parts) for values in (run, low, high, middle, cuts, deep)
        )
        low[second], high[first] = middle[second], middle[first]
        cuts[fresh], deep[fresh] = surely(run[fresh], low[fresh], high[fresh])
    return run, low, high, cuts


def corners_in_cutter(part: PartTree, Ts_cutter_workpiece: Array, triangle: np.ndarray) -> Array:
    """Return the corners of a triangle of the part in each cutter frame, shape (n, 3, 3)."""
    return frames.transform(Ts_cutter_workpiece[:, None], part.triangles[triangle])


def surely_cuts_along(
    cell: WorkCell,
    part: PartTree,
    points: CutterPoints,
    contact_positions: Array,
    low: Array,
    high: Array,
) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cells of places the part cuts into the wheel all over, and at the middle.

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: The cutter points.
        contact_positions: Where each is ground, in belt units, shape (n,).
        low: First place of each, a fractional cutter point, shape (n,).
        high: Last place, between the same two cutter points of a pass.
    """
    wheel, allowed = cell.wheel, -cell.planned_penetration
    middle, half = (low + high) / 2.0, (high - low) / 2.0
    before = middle.astype(int)
    Ts = points.Ts_workpiece_cutter
    x, z, p = (np.linalg.norm(Ts[before + 1, :3, k] - Ts[before, :3, k], axis=1) for k in (0, 2, 3))
    Ts_cutter_workpiece = frames.inverse(points.frames_at(middle))
    centre = frames.transform(Ts_cutter_workpiece, part.spheres[0, :3])
    # a point in the wheel is not farther from the contact than the wheel is large
    lever = np.minimum(
        np.linalg.norm(centre, axis=1) + part.spheres[0, 3],
        np.hypot(wheel.width, 2.0 * wheel.radius),
    )
    Ts_contact0_workpiece = wheel.T_contact0_contact(contact_positions) @ Ts_cutter_workpiece
    enough = allowed - half * (TURN * (x + z) * lever + p) - TOLERANCE
    distance, nearest = nearest_triangle(part, wheel, Ts_contact0_workpiece, allowed, enough)
    surely, cuts = distance < enough, distance < allowed - TOLERANCE
    near = cuts & ~surely
    corners = corners_in_cutter(part, Ts_cutter_workpiece[near], nearest[near])
    lever = np.linalg.norm(corners, axis=2).max(axis=1)
    moved = half[near] * (TURN * (x + z)[near] * lever + p[near])
    surely[near] = distance[near] < allowed - moved - TOLERANCE
    return surely & (np.maximum(x, z) <= LARGEST_TURN), cuts


def shut_along(
    cell: WorkCell,
    part: PartTree,
    points: CutterPoints,
    first: Array,
    last: Array,
    contact_positions: Array,
    most_within: int,
) -> np.ndarray:
    """Return between which places the part surely cuts into the wheel all the way, shape (n,).

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: The cutter points.
        first: From which place, a fractional cutter point, shape (n,).
        last: To which, not past the next cutter point of the pass.
        contact_positions: On which contact position, in belt units, shape (n,).
        most_within: How often a stretch is halved that is cut, but not surely.
    """

    def surely(run: np.ndarray, low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
        return surely_cuts_along(cell, part, points, contact_positions[run], low, high)

    run, _, _, shut = halved(np.arange(len(first)), first, last, surely, most_within)
    found = np.ones(len(first), dtype=bool)
    found[run[~shut]] = False
    return found
