"""Cutter points, and places between them, as walls that every motion must cross.

At a place the part can touch the wheel at every contact position t. The postures over a cell of t
lie within h^2 / 8 times their second derivative of the chord between those at its ends, and the
closed form of the inverse kinematics encloses that derivative. Where it does not, at singularities
and the end of the reach, the postures themselves are enclosed, over cells cut smaller. Cells are
left out only where it is certain that nothing in them is allowed: out of reach, beyond the limits,
or the part deeper in the wheel than any point of it can move within the cell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from opl.cell.flange_jets import contact_jets, path_jets
from opl.cell.inverse_jets import FlangeJets, joint_derivatives
from opl.cell.inverse_kinematics import inverse_kinematics
from opl.cell.part_tree import PartTree
from opl.cell.workcell import WorkCell
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.geometry.toolpath import CutterPoints
from opl.search.walls import Chain, Image, Line, Piece, Wall
from opl.walls.cut_cells import cells_of, cut_finer, rows_of
from opl.walls.enclosed import ROUND_OFF, EnclosedCells, enclosing
from opl.walls.images import Images
from opl.walls.sides import ANY_SIDE, Side

MOST_CUTS = 3  # of such cells, each finer than the one before
ROW_PARTS = 8  # cells between two cutter points along a contact position, before any is cut finer
# of the work for a column: a chain, and each of its edges; a cell cut finer
PART_OF_A_CHAIN, PART_OF_AN_EDGE, PART_OF_A_CELL = 0.5, 0.08, 0.07
FINER = 8  # cells that one is cut into where a proof needs it

Edge = tuple[int, float, float, float, float]  # number of a chain, place, t, place and t


class ColumnWalls:
    """Makes walls of places along the passes.

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: The cutter points.
        images: The images of each posture.
        sides: The sides of each pass; None for one that excludes nothing.
    """

    def __init__(
        self,
        cell: WorkCell,
        part: PartTree,
        points: CutterPoints,
        images: Images,
        sides: Sequence[Sequence[Side]] | None = None,
    ) -> None:
        self._cell = cell
        self._part = part
        self._points = points
        self.images = images
        self._sides = sides or [[ANY_SIDE]] * points.n_passes
        self.made = 0.0  # walls made so far; a cell cut finer or looked at is part of one

    def columns(self, places: Sequence[float]) -> list[Wall]:
        """Return the walls at fractional cutter points, all contact positions each."""
        last = self._cell.wheel.last_position
        return self.walls([((place, -last), (place, last)) for place in places])

    def walls(self, chains: Sequence[Chain]) -> list[Wall]:
        """Return the walls along chains, each within one pass."""
        edges = [
            (number, *one, *other)
            for number, corners in enumerate(chains)
            for one, other in pairwise(corners)
        ]
        # those that lead downwards can be crossed towards the start of the pass only
        up = [edge for edge in edges if edge[4] > edge[2]]
        along = [edge for edge in edges if edge[4] == edge[2]]
        passes = self._points.pass_index[[int(corners[0][0]) for corners in chains]]
        made = dict[Edge, list[Piece]]()
        for make, run in ((self._up, up), (self._along, along)):
            made |= zip(run, make(run) if run else (), strict=True)
        # in their order, in which the wall can be split
        pieces: list[list[Piece]] = [[] for _ in chains]
        for edge in edges:
            number, at = edge[0], edge[1] if edge[4] > edge[2] else None
            for side in self._sides[passes[number]]:
                found = made.get(edge, [])
                pieces[number] += [part for piece in found for part in side.parts(piece, at)]
        columns = sum(len(corners) == 2 for corners in chains)
        self.made += columns + PART_OF_A_CHAIN * (len(chains) - columns)
        self.made += PART_OF_AN_EDGE * (len(edges) - columns)
        return [
            Wall(int(passes[k]), (min(places) + max(places)) / 2.0, tuple(pieces[k]), chains[k])
            for k, places in enumerate([place for place, _ in corners] for corners in chains)
        ]

    def _up(self, edges: Sequence[Edge]) -> list[list[Piece]]:
        """Return the pieces at one place each, from a contact position up to another."""
        places, least, most = np.array([[edge[1], edge[2], edge[4]] for edge in edges]).T
        Ts = self._points.frames_at(places)
        grids, cuts = cells_of(self._cell, self._part, Ts, least, most)
        cells = _cut_as_needed(partial(self._cells, Ts), grids, cuts)
        return [list(self._pieces(cells, k)) for k in range(len(edges))]

    def _along(self, edges: Sequence[Edge]) -> list[list[Piece]]:
        """Return the pieces at one contact position each, from a place to another."""
        grids = []
        for _, one, _, other, _ in edges:
            first, last = min(one, other), max(one, other)
            inside = np.arange(np.floor(first) + 1.0, np.ceil(last))
            ends = np.concatenate([[first], inside, [last]])
            grids.append(cut_finer(ends, np.ceil(np.diff(ends) * ROW_PARTS).astype(int)))
        t = [edge[2] for edge in edges]
        return self._rows(*rows_of(self._cell, self._part, self._points, grids, t), t)

    def finer(self, piece: Piece, cell: int) -> tuple[Piece, ...]:
        """Return one cell of a wall as pieces with smaller cells."""
        self.made += PART_OF_A_CELL
        grid = np.linspace(piece.at[cell], piece.at[cell + 1], FINER + 1)
        none = np.zeros(FINER, dtype=bool)
        T_workpiece_cutter = piece.line.T_workpiece_cutter
        if T_workpiece_cutter is None:
            pieces = self._rows([grid], [none], [piece.line.contact_position])[0]
        else:
            pieces = list(self._pieces(self._cells(T_workpiece_cutter[None], [grid], [none]), 0))
        own = (found for found in pieces if found.family == piece.family)
        return tuple(replace(found, side=piece.side) for found in own)

    def postures(self, piece: Piece, at: Array) -> Array:
        """Return the joint positions along a piece in [rad], NaN where there are none.

        Args:
            piece: The piece.
            at: Places along it, shape (n,).

        Returns:
            Shape (n, 6), the full turns as those of the chords.
        """
        cell, line = self._cell, piece.line
        if line.T_workpiece_cutter is None:
            Ts = cell.Ts_base_flange(line.contact_position, self._points.frames_at(at))
        else:
            Ts = cell.Ts_base_flange(at, line.T_workpiece_cutter)
        q = inverse_kinematics(cell.robot.arm, Ts)[:, piece.family]
        chords = np.stack([np.interp(at, piece.at, joint) for joint in piece.corners.T], axis=1)
        return np.asarray(q + 2.0 * np.pi * np.round((chords - q) / (2.0 * np.pi)))

    def _rows(
        self, grids: list[Array], cuts: list[np.ndarray], contact_positions: list[float]
    ) -> list[list[Piece]]:
        """Return the pieces along places, each at one contact position."""
        cells = _cut_as_needed(partial(self._cells_along, contact_positions), grids, cuts)
        return [list(self._pieces(cells, k, t)) for k, t in enumerate(contact_positions)]

    def _cells_along(
        self, contact_positions: list[float], grids: list[Array], cuts: list[np.ndarray]
    ) -> EnclosedCells:
        """Enclose the postures over all cells of some runs of places."""
        cell, points = self._cell, self._points
        counts = np.array([len(grid) - 1 for grid in grids])
        middle = np.concatenate([(grid[:-1] + grid[1:]) / 2.0 for grid in grids])
        radius = np.concatenate([np.diff(grid) / 2.0 for grid in grids])
        Ts_base_contact = np.repeat(
            cell.wheel.T_base_contact(np.array(contact_positions)), counts, axis=0
        )
        flange = path_jets(points, Ts_base_contact, cell.T_flange_workpiece, middle, radius)
        t = np.repeat(contact_positions, counts + 1)
        Ts = points.frames_at(np.concatenate(grids))
        q = inverse_kinematics(cell.robot.arm, cell.Ts_base_flange(t, Ts))
        return self._enclosed(q, flange, radius, grids, cuts, np.empty((len(grids), 4, 4)))

    def _pieces(self, cells: EnclosedCells, wall: int, row: float | None = None) -> Iterator[Piece]:
        """Yield the pieces of one of several walls."""
        t = cells.grids[wall]
        first, corner = cells.first[wall], cells.first[wall] + wall
        now, at = slice(first, first + len(t) - 1), slice(corner, corner + len(t))
        line = Line(cells.Ts_workpiece_cutter[wall]) if row is None else Line(None, row)
        for family in self.images.families:
            known = cells.known[family][:, now]
            q = cells.q[at, family]
            # 0 nothing is allowed, 1 all is known, 2 not all is
            kind = np.where(known.all(axis=0), 1, 2)
            kind[cells.cuts[wall] | cells.none[family][now]] = 0
            for low, high in _runs(kind):
                if kind[low] == 0:
                    continue
                corners = q[low : high + 1]
                pad_low = cells.pad_low[family][:, now][:, low:high].T
                pad_high = cells.pad_high[family][:, now][:, low:high].T
                middle = cells.middle[family][:, now][:, low:high].T
                sure = known[:, low:high].T & ~np.isnan(corners[:-1] + corners[1:])
                if kind[low] == 2:
                    filled = np.nan_to_num(np.concatenate([middle[:1], middle]))
                    corners = np.where(np.isnan(corners), filled, corners)
                seams = self.images.seams.start[family]
                start = seams + np.remainder(corners[0] - seams, 2.0 * np.pi)
                steps = np.diff(corners, axis=0)
                steps -= 2.0 * np.pi * np.round(steps / (2.0 * np.pi))
                corners = np.concatenate([start[None], start + np.cumsum(steps, axis=0)])
                radius = cells.radius[family][:, now][:, low:high].T
                off_low, off_high = enclosing(corners, middle, radius)
                # pads that the postures themselves make narrower tell nothing of the bend
                bends = (sure & (pad_low >= off_low) & (pad_high <= off_high)).all(axis=1)
                pad_low = np.where(sure, np.maximum(pad_low, off_low), off_low)
                pad_high = np.where(sure, np.minimum(pad_high, off_high), off_high)
                piece = Piece(family, line, t[low : high + 1], corners, pad_low, pad_high, bends)
                yield from self._within_limits(piece)

    def _within_limits(self, piece: Piece) -> Iterator[Piece]:
        """Yield the parts of a piece that some image can bring within the limits."""
        robot = self._cell.robot
        allowed = np.zeros(len(piece.pad_low), dtype=bool)
        for sign, shift in self.images.flips:
            moved = Image(sign, shift, ()).of(piece)
            # the fewest full turns that bring the upper end to the lower limit
            up = 2.0 * np.pi * np.ceil((robot.lower - moved.high) / (2.0 * np.pi))
            allowed |= (moved.low + up <= robot.upper).all(axis=1)
        for low, high in _runs(allowed):
            if allowed[low]:
                yield piece.part(low, high)

    def _cells(
        self, Ts_workpiece_cutter: Array, grids: list[Array], cuts: list[np.ndarray]
    ) -> EnclosedCells:
        """Enclose the postures over all cells of some places."""
        arm = self._cell.robot.arm
        corners = np.concatenate(
            [
                inverse_kinematics(arm, self._cell.Ts_base_flange(t, T))
                for T, t in zip(Ts_workpiece_cutter, grids, strict=True)
            ]
        )
        middle = np.concatenate([(t[:-1] + t[1:]) / 2.0 for t in grids])
        radius = np.concatenate([np.diff(t) / 2.0 for t in grids])
        counts = np.array([len(t) - 1 for t in grids])
        Ts_cutter_flange = frames.inverse(self._cell.T_flange_workpiece @ Ts_workpiece_cutter)
        flange = contact_jets(
            self._cell.wheel, np.repeat(Ts_cutter_flange, counts, axis=0), middle, radius
        )
        return self._enclosed(corners, flange, radius, grids, cuts, Ts_workpiece_cutter)

    def _enclosed(
        self,
        corners: Array,
        flange: FlangeJets,
        radius: Array,
        grids: list[Array],
        cuts: list[np.ndarray],
        Ts_workpiece_cutter: Array,
    ) -> EnclosedCells:
        """Return cells, the motion of the flange over each of them enclosed."""
        found = joint_derivatives(self._cell.robot.arm, flange, self.images.families)
        counts = np.array([len(t) - 1 for t in grids])
        eighth = (2.0 * radius) ** 2 / 8.0
        pad_low = np.minimum(0.0, -eighth * found.second_high) - ROUND_OFF
        pad_high = np.maximum(0.0, -eighth * found.second_low) + ROUND_OFF
        known = np.isfinite(pad_low) & np.isfinite(pad_high)
        known &= 2.0 * radius * found.first < np.pi / 2.0
        first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        return EnclosedCells(
            Ts_workpiece_cutter, grids, cuts, first, corners, pad_low, pad_high, known,
            found.middle, found.radius, found.none,
        )  # fmt: skip


def _cut_as_needed(
    enclose: Callable[[list[Array], list[np.ndarray]], EnclosedCells],
    grids: list[Array],
    cuts: list[np.ndarray],
) -> EnclosedCells:
    """Return enclosed cells, those of wide pads cut finer.

    Args:
        enclose: Encloses the cells of some grids.
        grids: Ends of the cells of each run.
        cuts: Where nothing is allowed.
    """
    cells = enclose(grids, cuts)
    for _ in range(MOST_CUTS):
        parts = [np.where(cut, 1, now) for cut, now in zip(cuts, cells.parts(), strict=True)]
        if not any((now > 1).any() for now in parts):
            break
        grids = [cut_finer(t, now) for t, now in zip(grids, parts, strict=True)]
        cuts = [np.repeat(cut, now) for cut, now in zip(cuts, parts, strict=True)]
        cells = enclose(grids, cuts)
    return cells


def _runs(kind: np.ndarray) -> list[tuple[int, int]]:
    """Return first and end of every run of equal values."""
    breaks = np.flatnonzero(np.diff(kind)) + 1
    return list(zip([0, *breaks.tolist()], [*breaks.tolist(), len(kind)], strict=True))
