"""Cells of contact positions: small where the part begins to cut into the wheel.

A cell counts as forbidden only if the part is deeper in the wheel at its middle than what is there
of it can move within the cell: all of the part, or one of its triangles. Deeper by less than what
distances are told to counts as not deep: no smaller cell would show it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from opl.cell.part_tree import PartTree
from opl.cell.wheel_cuts import corners_in_cutter, halved, surely_cuts_along
from opl.cell.wheel_distance import nearest_triangle, signed_wheel_distance
from opl.cell.wheel_triangle import TOLERANCE
from opl.cell.workcell import WorkCell
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M, ContactWheel
from opl.planning.problem import GrindingProblem
from opl.search.walls import Line

CELL = 1.0  # belt units that a cell covers at first
# of one that is deep in the wheel, but hardly deeper than allowed: along the flat it may be so all
# over, and each halving is twice the work
MOST_WITHIN = 9


def whole_cells(wheel: ContactWheel) -> Array:
    """Return the ends of cells over all contact positions, each on the flat or on one edge."""
    t = np.array([-wheel.last_position])
    for end in (-wheel.flat_end, wheel.flat_end, wheel.last_position):
        if end > t[-1]:
            count = int(np.ceil((end - t[-1]) / CELL))
            t = np.concatenate([t[:-1], np.linspace(t[-1], end, count + 1)])
    return t


def cells_of(
    cell: WorkCell, part: PartTree, Ts_workpiece_cutter: Array, least: Array, most: Array
) -> tuple[list[Array], list[np.ndarray]]:
    """Return the ends of cells at each place, and in which the part surely cuts into the wheel.

    Args:
        cell: The cell.
        part: The triangles of the part.
        Ts_workpiece_cutter: The places, shape (k, 4, 4).
        least: Least contact position of each, shape (k,).
        most: Greatest one.
    """
    t, k = whole_cells(cell.wheel), len(Ts_workpiece_cutter)
    low, high = np.maximum(t[:-1], least[:, None]), np.minimum(t[1:], most[:, None])
    place, some = np.nonzero(low < high)

    def surely(place: np.ndarray, low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
        return _surely_cuts(cell, part, Ts_workpiece_cutter[place], low, high)

    place, low, high, cuts = halved(place, low[place, some], high[place, some], surely, MOST_WITHIN)
    ends = np.searchsorted(place, np.arange(k + 1))
    runs = [slice(a, b) for a, b in pairwise(ends)]
    return [np.append(low[run], high[run][-1:]) for run in runs], [cuts[run] for run in runs]


def rows_of(
    cell: WorkCell,
    part: PartTree,
    points: CutterPoints,
    grids: list[Array],
    contact_positions: list[float],
) -> tuple[list[Array], list[np.ndarray]]:
    """Return runs of places cut where the part begins to cut into the wheel, and where it does.

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: The cutter points.
        grids: Ends of the cells of each run, fractional cutter points.
        contact_positions: Where each run is ground, in belt units.
    """
    t = np.array(contact_positions)
    run = np.repeat(np.arange(len(grids)), [len(grid) - 1 for grid in grids])
    low, high = (np.concatenate([grid[k] for grid in grids]) for k in (slice(-1), slice(1, None)))

    def surely(run: np.ndarray, low: Array, high: Array) -> tuple[np.ndarray, np.ndarray]:
        return surely_cuts_along(cell, part, points, t[run], low, high)

    run, low, high, cuts = halved(run, low, high, surely)
    own = [np.flatnonzero(run == k) for k in range(len(grids))]
    return [np.append(low[k], high[k[-1]]) for k in own], [cuts[k] for k in own]


def _surely_cuts(
    cell: WorkCell, part: PartTree, Ts_workpiece_cutter: Array, low: Array, high: Array
) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cells the part cuts into the wheel all over, and at the middle."""
    allowed = -cell.planned_penetration
    return surely_nearer(cell, part, Ts_workpiece_cutter, low, high, allowed)


def surely_nearer(
    cell: WorkCell,
    part: PartTree,
    Ts_workpiece_cutter: Array,
    low: Array,
    high: Array,
    distance: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cells the part is nearer to the wheel all over, and at the middle.

    Args:
        cell: The cell.
        part: The triangles of the part.
        Ts_workpiece_cutter: The place of each cell, shape (n, 4, 4).
        low: Least contact position of each, all of it on the flat or on one edge, shape (n,).
        high: Greatest.
        distance: Nearer than this in [m], less than 0 for how deep.
    """
    wheel = cell.wheel
    middle, radius = (low + high) / 2.0, (high - low) / 2.0
    Ts_cutter_workpiece = frames.inverse(Ts_workpiece_cutter)
    x, _, z = np.moveaxis(frames.transform(Ts_cutter_workpiece, part.spheres[0, :3]), -1, 0)
    # about the edge; and a point so near is not farther from it than the wheel is large
    lever = np.minimum(
        np.hypot(x, z) + part.spheres[0, 3],
        np.hypot(wheel.width, 2.0 * wheel.radius) + max(distance, 0.0),
    )
    rolled, turn = np.abs(middle) > wheel.flat_end, 2.0 * np.sin(np.deg2rad(radius) / 2.0)
    moved = np.where(rolled, turn * lever, radius / MM_PER_M)
    Ts_contact0_workpiece = wheel.T_contact0_contact(middle) @ Ts_cutter_workpiece
    enough = distance - moved - TOLERANCE
    clearance, nearest = nearest_triangle(part, wheel, Ts_contact0_workpiece, distance, enough)
    surely, deep = clearance < enough, clearance < distance - TOLERANCE
    near = rolled & ~surely & deep
    x, _, z = np.moveaxis(corners_in_cutter(part, Ts_cutter_workpiece[near], nearest[near]), -1, 0)
    moved = turn[near] * np.hypot(x, z).max(axis=1)
    surely[near] = clearance[near] < distance - moved - TOLERANCE
    slid = ~rolled & ~surely & deep
    most = 2.0 * radius[slid].max(initial=0.0) / MM_PER_M
    if slid.any() and most < wheel.width:
        # along the axle: a wheel so much narrower stays inside of the wheel all over these cells
        narrower, nearer = replace(wheel, width=wheel.width - most), distance - TOLERANCE
        Ts = Ts_contact0_workpiece[slid]
        surely[slid] = signed_wheel_distance(part, narrower, Ts, distance, nearer) < nearer
    return surely, deep


def surely_cuts_on(
    problem: GrindingProblem, line: Line, low: Array, high: Array
) -> tuple[np.ndarray, np.ndarray]:
    """Return in which cells on a line the part cuts into the wheel all over, and at the middle.

    Args:
        problem: The cell, the part, and the cutter points.
        line: At a place, or at a contact position.
        low: Least contact position of each, or first place, as below, shape (n,).
        high: Greatest, or last.
    """
    cell, part = problem.cell, problem.scene.part
    if line.T_workpiece_cutter is None:
        t = np.full(len(low), line.contact_position)
        return surely_cuts_along(cell, part, problem.points, t, low, high)
    return _surely_cuts(cell, part, np.tile(line.T_workpiece_cutter, (len(low), 1, 1)), low, high)


def cut_finer(t: Array, parts: np.ndarray) -> Array:
    """Return the ends of cells after each is cut into some parts."""
    cell = np.repeat(np.arange(len(parts)), parts)
    part = np.arange(len(cell)) - np.repeat(np.cumsum(parts) - parts, parts)
    fine = t[cell] + (t[cell + 1] - t[cell]) * (part / parts[cell])
    return np.append(fine, t[-1])
