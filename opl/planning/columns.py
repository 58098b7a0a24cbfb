"""Cutter points, and places between them, as walls that every motion must cross.

At a place the part can touch the wheel at every contact position t. The postures over a cell of t
lie within h^2 / 8 times their second derivative of the chord between those at its ends, and the
closed form of the inverse kinematics encloses that derivative. Cells are left out only where it is
certain that nothing in them is allowed: out of reach, beyond the limits, or the part deeper in the
wheel than any point of it can move within the cell.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opl.cell.inverse_jets import Axes, FlangeJets, joint_derivatives
from opl.cell.inverse_kinematics import Arm, inverse_kinematics
from opl.cell.spherical_wrist import SphericalWristArm
from opl.cell.wheel_distance import TOLERANCE, PartTree, signed_wheel_distance
from opl.cell.workcell import WorkCell
from opl.geometry import frames
from opl.geometry.frames import Array
from opl.geometry.jets import Interval, Jet, constant, variable, wave
from opl.geometry.toolpath import CutterPoints
from opl.geometry.wheel import MM_PER_M, ContactWheel
from opl.planning.nodes import SEAM_GAP
from opl.search.walls import UNKNOWN, Image, Line, Piece, Wall

CELL = 1.0  # belt units that a cell covers at first
MOST_HALVINGS = 8  # of a cell where the part begins to cut into the wheel
MOST_PARTS = 32  # of a cell whose pads are large
ROW_PARTS = 16  # cells between two places of a wall along a contact position
FINER = 8  # cells that one is cut into where a proof needs it
COARSE = 5e-4  # [rad] sum of the pads that is small enough
TOUCHING = 1e-9  # [turns] a limit that is only touched counts
ROUND_OFF = 1e-9  # [rad] of inverse kinematics and enclosures


@dataclass(frozen=True)
class Seams:
    """Where the angles of each posture are cut open, to count full turns.

    Attributes:
        start: Least angle in [rad] of each family and joint, shape (8, 6).
        kept: Whether no pass changes the count: its angles leave a gap there, and nowhere jump
            towards it, shape (8, 6).
        low: Least angle that occurs, less what may occur between nodes, in [rad], shape (8, 6).
        high: Greatest angle that occurs, likewise.
    """

    start: Array
    kept: np.ndarray
    low: Array
    high: Array


def seams_of(q: Array) -> Seams:
    """Find the widest gaps in the angles of each inverse solution.

    Args:
        q: Principal angles in [rad], NaN where there are none, shape (N, M, 8, 6).
    """
    start, kept = np.full((8, 6), -np.pi), np.zeros((8, 6), dtype=bool)
    with np.errstate(invalid="ignore"):
        jump = np.maximum(*(_largest_jump(np.diff(q, axis=axis)) for axis in (0, 1)))
    margin = SEAM_GAP / 2.0
    margins = np.zeros((8, 6))
    for family in range(8):
        for joint in range(6):
            angles = np.sort(q[:, :, family, joint], axis=None)
            angles = angles[~np.isnan(angles)]
            if not len(angles):
                continue
            gaps = np.diff(angles, append=angles[0] + 2.0 * np.pi)
            widest = int(np.argmax(gaps))
            kept[family, joint] = gaps[widest] > SEAM_GAP and jump[family, joint] < margin
            start[family, joint] = angles[widest] + gaps[widest] / 2.0
            if kept[family, joint]:
                margins[family, joint] = gaps[widest] / 2.0 - margin
    low, high = start + margins, start + 2.0 * np.pi - margins
    return Seams(start, kept, low, high)


def _largest_jump(change: Array) -> Array:
    """Return the largest change of each angle between neighbouring nodes in [rad], shape (8, 6)."""
    around = np.abs(change - 2.0 * np.pi * np.round(change / (2.0 * np.pi)))
    return np.asarray(np.nan_to_num(around).max(axis=(0, 1), initial=0.0))


def wrist_flips(arm: Arm) -> list[tuple[Array, Array]]:
    """Return sign and shift that make each flip of the wrist of the posture without one."""
    same = (np.ones(6), np.zeros(6))
    if not isinstance(arm, SphericalWristArm):
        return [same]
    sign, shift = np.ones(6), np.zeros(6)
    sign[4] = -1.0
    shift[4] = 2.0 * arm.offsets[4] * arm.signs[4]
    shift[3] = shift[5] = np.pi
    return [same, (sign, shift)]


class ColumnWalls:
    """Makes walls of places along the passes.

    Args:
        cell: The cell.
        part: The triangles of the part.
        points: The cutter points.
        seams: Where full turns are counted from.
        largest: Boxes of this size or more in [rad] are of no interest.
    """

    def __init__(
        self,
        cell: WorkCell,
        part: PartTree,
        points: CutterPoints,
        seams: Seams,
        largest: float,
    ) -> None:
        self._largest = largest
        self._cell = cell
        self._part = part
        self._points = points
        self._seams = seams
        self._images: dict[int, list[Image]] = {}

    @cached_property
    def families(self) -> tuple[int, ...]:
        """The postures of which all others are images."""
        wrist = isinstance(self._cell.robot.arm, SphericalWristArm)
        return tuple(range(4)) if wrist else tuple(range(8))

    @cached_property
    def flips(self) -> list[tuple[Array, Array]]:
        """Sign and shift that make a posture with the wrist flipped of one without."""
        return wrist_flips(self._cell.robot.arm)

    def images(self, family: int) -> list[Image]:
        """Return the images of a posture, the posture itself first."""
        if family not in self._images:
            self._images[family] = self._images_of(family)
        return self._images[family]

    def _images_of(self, family: int) -> list[Image]:
        counts = [
            np.stack(np.meshgrid(*per_joint, indexing="ij"), axis=-1).reshape(-1, 6)
            for per_joint in self._relative_turns(family)
        ]
        kept = self._seams.kept[family]
        return [
            Image(sign, shift + 2.0 * np.pi * count, (flip, *np.where(kept, count, 0).tolist()))
            for flip, (sign, shift) in enumerate(self.flips)
            for count in counts[flip][np.argsort(np.abs(counts[flip]).sum(axis=1), kind="stable")]
        ]

    def _relative_turns(self, family: int) -> list[list[np.ndarray]]:
        """Return by how many full turns one posture of a motion can differ from another.

        For each flip that may lie between the two, and each joint; both keep the limits.
        """
        robot, seams = self._cell.robot, self._seams
        where = []  # sign, shift without and with full turns of every place of each joint
        for sign, shift in self.flips:
            ends = sign * seams.low[family] + shift, sign * seams.high[family] + shift
            first = np.ceil((robot.lower - np.maximum(*ends)) / (2.0 * np.pi) - TOUCHING)
            last = np.floor((robot.upper - np.minimum(*ends)) / (2.0 * np.pi) + TOUCHING)
            where.append((sign, shift, first, last))
        relative: list[list[np.ndarray]] = []
        for flip, (_, between) in enumerate(self.flips):
            found: list[set[int]] = [{0} if flip == 0 else set() for _ in range(6)]
            for one, (sign, shift, first, last) in enumerate(where):
                _, other_shift, other_first, other_last = where[one ^ flip]
                for joint in range(6):
                    for k in range(int(first[joint]), int(last[joint]) + 1):
                        for n in range(int(other_first[joint]), int(other_last[joint]) + 1):
                            away = other_shift[joint] - shift[joint] + 2.0 * np.pi * (n - k)
                            turns = (sign[joint] * away - between[joint]) / (2.0 * np.pi)
                            found[joint].add(round(turns))
            sign, shift = self.flips[flip]
            low, high = seams.low[family], seams.high[family]
            for joint, counts in enumerate(found):
                images = sorted(sign[joint] * np.array([low[joint], high[joint]]) + shift[joint])
                for n in list(counts):
                    turned = images[0] + 2.0 * np.pi * n, images[1] + 2.0 * np.pi * n
                    if max(turned[0] - high[joint], low[joint] - turned[1]) >= self._largest:
                        counts.remove(n)
            relative.append([np.array(sorted(counts), dtype=int) for counts in found])
        return relative

    def within_limits(self, q: Array) -> np.ndarray:
        """Return which of some postures of a family have an image within the limits, shape (n,)."""
        robot = self._cell.robot
        allowed = np.zeros(len(q), dtype=bool)
        for sign, shift in self.flips:
            moved = q * sign + shift
            up = 2.0 * np.pi * np.ceil((robot.lower - moved) / (2.0 * np.pi))
            allowed |= (moved + up <= robot.upper).all(axis=1)
        return allowed

    def walls(self, places: Sequence[float]) -> list[Wall]:
        """Return the walls at fractional cutter points."""
        Ts_workpiece_cutter = self._points.frames_at(np.asarray(places, dtype=float))
        grids = [self._borders(T) for T in Ts_workpiece_cutter]
        cells = self._cells(Ts_workpiece_cutter, grids)
        parts = cells.parts()
        if (parts > 1).any():
            grids = [
                _cut_finer(t, parts[first : first + len(t) - 1])
                for t, first in zip(grids, cells.first, strict=True)
            ]
            cells = self._cells(Ts_workpiece_cutter, grids)
        passes = self._points.pass_index[np.asarray(places, dtype=int)]
        return [
            Wall(int(passes[k]), float(place), tuple(self._pieces(cells, k)))
            for k, place in enumerate(places)
        ]

    def finer(self, piece: Piece, cell: int) -> tuple[Piece, ...]:
        """Return one cell of a wall as pieces with smaller cells."""
        grid = np.linspace(piece.at[cell], piece.at[cell + 1], FINER + 1)
        T_workpiece_cutter = piece.line.T_workpiece_cutter
        if T_workpiece_cutter is None:
            pieces = self._row_pieces(grid, piece.line.contact_position)
        else:
            pieces = self._pieces(self._cells(T_workpiece_cutter[None], [grid]), 0)
        return tuple(found for found in pieces if found.family == piece.family)

    def sweep(self, before: float, after: float, t: float, upwards: bool) -> Wall:
        """Return the wall of places at one contact position, joined to columns on either side.

        From the bottom up one of the columns, along the contact position to the other, and up that
        one: every motion from the first column to the second crosses it.

        Args:
            before: The place where it begins.
            after: The place where it ends, on the same pass.
            t: The contact position.
            upwards: Whether it goes up the later column first: what moves from low to high contact
                positions between the two then crosses on the way.
        """
        low_at, high_at = (after, before) if upwards else (before, after)
        low, high = self.walls([low_at, high_at])
        inside = np.arange(np.floor(before) + 1.0, np.ceil(after))
        places = np.unique(np.concatenate([[before], inside, [after]]))
        grid = _cut_finer(places, np.full(len(places) - 1, ROW_PARTS))
        pieces = [piece for piece in low.pieces for piece in _below(piece, t)]
        pieces += self._row_pieces(grid, t)
        pieces += [piece for piece in high.pieces for piece in _above(piece, t)]
        index = int(self._points.pass_index[int(before)])
        return Wall(index, (before + after) / 2.0, tuple(pieces))

    def _row_pieces(self, grid: Array, t: float) -> Iterator[Piece]:
        arm = self._cell.robot.arm
        T_base_contact = self._cell.wheel.T_base_contact(t)
        middle, radius = (grid[:-1] + grid[1:]) / 2.0, np.diff(grid) / 2.0
        flange = path_jets(
            self._points, T_base_contact, self._cell.T_flange_workpiece, middle, radius
        )
        q = inverse_kinematics(arm, self._cell.Ts_base_flange(t, self._points.frames_at(grid)))
        cells = self._enclosed(q, flange, radius, [grid], np.empty((1, 4, 4)))
        yield from self._pieces(cells, 0, t)

    def _pieces(self, cells: _Cells, wall: int, row: float | None = None) -> Iterator[Piece]:
        """Yield the pieces of one of several walls."""
        t = cells.grids[wall]
        first, corner = cells.first[wall], cells.first[wall] + wall
        now, at = slice(first, first + len(t) - 1), slice(corner, corner + len(t))
        cut = np.zeros(len(t) - 1, dtype=bool)
        if row is None:
            cut = self._surely_cuts(cells.Ts_workpiece_cutter[wall], t)[0]
        line = Line(cells.Ts_workpiece_cutter[wall]) if row is None else Line(None, row)
        for family in self.families:
            known = cells.known[family][:, now]
            q = cells.q[at, family]
            # 0 nothing is allowed, 1 all is known, 2 not all is
            kind = np.where(known.all(axis=0), 1, 2)
            kind[cut | cells.none[family][now]] = 0
            for low, high in _runs(kind):
                if kind[low] == 0:
                    continue
                corners = q[low : high + 1]
                pad_low = cells.pad_low[family][:, now][:, low:high].T
                pad_high = cells.pad_high[family][:, now][:, low:high].T
                if kind[low] == 2:
                    sure = known[:, low:high].T & ~np.isnan(corners[:-1] + corners[1:])
                    pad_low = np.where(sure, pad_low, -UNKNOWN)
                    pad_high = np.where(sure, pad_high, UNKNOWN)
                    corners = np.nan_to_num(corners)
                seams = self._seams.start[family]
                start = seams + np.remainder(corners[0] - seams, 2.0 * np.pi)
                steps = np.diff(corners, axis=0)
                steps -= 2.0 * np.pi * np.round(steps / (2.0 * np.pi))
                corners = np.concatenate([start[None], start + np.cumsum(steps, axis=0)])
                piece = Piece(family, line, t[low : high + 1], corners, pad_low, pad_high)
                yield from self._within_limits(piece)

    def _within_limits(self, piece: Piece) -> Iterator[Piece]:
        """Yield the parts of a piece that some image can bring within the limits."""
        robot = self._cell.robot
        allowed = np.zeros(len(piece.pad_low), dtype=bool)
        for sign, shift in self.flips:
            moved = Image(sign, shift, ()).of(piece)
            # the fewest full turns that bring the upper end to the lower limit
            up = 2.0 * np.pi * np.ceil((robot.lower - moved.high) / (2.0 * np.pi))
            allowed |= (moved.low + up <= robot.upper).all(axis=1)
        for low, high in _runs(allowed):
            if allowed[low]:
                yield piece.part(low, high)

    def _borders(self, T_workpiece_cutter: Array) -> Array:
        """Return the ends of cells at one place, closer where the part begins to cut."""
        wheel = self._cell.wheel
        t = np.array([-wheel.last_position])
        for end in (-wheel.flat_end, wheel.flat_end, wheel.last_position):
            if end > t[-1]:
                count = int(np.ceil((end - t[-1]) / CELL))
                t = np.concatenate([t[:-1], np.linspace(t[-1], end, count + 1)])
        for _ in range(MOST_HALVINGS):
            cuts, deep = self._surely_cuts(T_workpiece_cutter, t)
            unsure = deep & ~cuts
            unsure[:-1] |= ~deep[:-1] & deep[1:]
            unsure[1:] |= ~deep[1:] & deep[:-1]
            if not unsure.any():
                break
            t = _cut_finer(t, np.where(unsure, 2, 1))
        return t

    def _surely_cuts(self, T_workpiece_cutter: Array, t: Array) -> tuple[np.ndarray, np.ndarray]:
        """Return in which cells the part cuts into the wheel all over, and at the middle."""
        cell, wheel = self._cell, self._cell.wheel
        middle, radius = (t[:-1] + t[1:]) / 2.0, np.diff(t) / 2.0
        T_cutter_workpiece = frames.inverse(T_workpiece_cutter)
        p = frames.transform(T_cutter_workpiece, self._part.triangles.reshape(-1, 3))
        # about the edge; and a point in the wheel is not farther from it than the wheel is large
        lever = min(
            float(np.hypot(p[:, 0], p[:, 2]).max()),
            float(np.hypot(wheel.width, 2.0 * wheel.radius)),
        )
        rolled = np.abs(middle) > wheel.flat_end
        moved = np.where(rolled, 2.0 * np.sin(np.deg2rad(radius) / 2.0) * lever, radius / MM_PER_M)
        Ts_contact0_workpiece = wheel.T_contact0_contact(middle) @ T_cutter_workpiece
        allowed = -cell.planned_penetration
        clearance = signed_wheel_distance(self._part, wheel, Ts_contact0_workpiece, allowed)
        deep = np.asarray(clearance < allowed)
        return np.asarray(clearance + moved + TOLERANCE < allowed), deep

    def _cells(self, Ts_workpiece_cutter: Array, grids: list[Array]) -> _Cells:
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
        return self._enclosed(corners, flange, radius, grids, Ts_workpiece_cutter)

    def _enclosed(
        self,
        corners: Array,
        flange: FlangeJets,
        radius: Array,
        grids: list[Array],
        Ts_workpiece_cutter: Array,
    ) -> _Cells:
        """Return cells, the motion of the flange over each of them enclosed."""
        found = joint_derivatives(self._cell.robot.arm, flange)
        counts = np.array([len(t) - 1 for t in grids])
        eighth = (2.0 * radius) ** 2 / 8.0
        pad_low = np.minimum(0.0, -eighth * found.second_high) - ROUND_OFF
        pad_high = np.maximum(0.0, -eighth * found.second_low) + ROUND_OFF
        known = np.isfinite(pad_low) & np.isfinite(pad_high)
        known &= 2.0 * radius * found.first < np.pi / 2.0
        first = np.concatenate([[0], np.cumsum(counts)[:-1]])
        return _Cells(
            Ts_workpiece_cutter, grids, first, corners, pad_low, pad_high, known, found.none,
            np.array(self.families),
        )  # fmt: skip


@dataclass(frozen=True)
class _Cells:
    """The cells of several places, one place after the other.

    Attributes:
        Ts_workpiece_cutter: The places, shape (k, 4, 4).
        grids: Ends of the cells of each.
        first: First cell of each, shape (k,).
        q: Postures at the ends, principal angles in [rad], shape (n + k, 8, 6).
        pad_low: As in `Piece`, shape (8, 6, n).
        pad_high: As in `Piece`.
        known: Which pads are, shape (8, 6, n).
        none: Where there is certainly no posture, shape (8, n).
        families: Those that matter.
    """

    Ts_workpiece_cutter: Array
    grids: list[Array]
    first: np.ndarray
    q: Array
    pad_low: Array
    pad_high: Array
    known: np.ndarray
    none: np.ndarray
    families: np.ndarray

    def parts(self) -> np.ndarray:
        """Return into how many parts each cell should be cut, shape (n,)."""
        pads = (self.pad_high - self.pad_low)[self.families].sum(axis=1)
        wanted = np.ceil(np.sqrt(pads / COARSE))  # pads fall with the square
        wanted = np.where(self.known[self.families].all(axis=1), wanted, MOST_PARTS)
        wanted = np.where(self.none[self.families], 1, wanted)
        return np.asarray(np.minimum(wanted.max(axis=0), MOST_PARTS), dtype=int)


def path_jets(
    points: CutterPoints, T_base_contact: Array, T_flange_workpiece: Array, at: Array, radius: Array
) -> FlangeJets:
    """Enclose the motion of the flange while the part moves along its path at one contact position.

    Args:
        points: The cutter points.
        T_base_contact: The contact frame, shape (4, 4).
        T_flange_workpiece: How the part is held, shape (4, 4).
        at: Middle of each cell, a fractional cutter point, shape (n,).
        radius: Half its width, all of it between the same two, shape (n,).
    """
    before = np.floor(at).astype(int)
    one, other = points.Ts_workpiece_cutter[before], points.Ts_workpiece_cutter[before + 1]
    share = variable(at - before, radius)

    def blend(column: int) -> Axes:
        a, b = one[:, :3, column], other[:, :3, column]
        x, y, z = (share.scaled(b[:, k] - a[:, k]).plus(a[:, k]) for k in range(3))
        return x, y, z

    z = _unit(blend(2))
    x_free = blend(0)
    along = _dot(x_free, z)
    x = _unit(_minus(x_free, (z[0] * along, z[1] * along, z[2] * along)))
    y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
    p = blend(3)
    T_workpiece_flange = frames.inverse(T_flange_workpiece)

    def in_base(v: Axes) -> Axes:
        in_cutter = (_dot(x, v), _dot(y, v), _dot(z, v))
        a, b, c = (
            in_cutter[0].times(T_base_contact[k, 0])
            + in_cutter[1].times(T_base_contact[k, 1])
            + in_cutter[2].times(T_base_contact[k, 2])
            for k in range(3)
        )
        return a, b, c

    def fixed(v: Array) -> Axes:
        a, b, c = (constant(v[k], at) for k in range(3))
        return a, b, c

    axes = [in_base(fixed(T_workpiece_flange[:3, k])) for k in range(3)]
    origin = in_base(_minus(fixed(T_workpiece_flange[:3, 3]), p))
    a, b, c = (origin[k].plus(T_base_contact[k, 3]) for k in range(3))
    return FlangeJets(axes[0], axes[1], axes[2], (a, b, c))


def _dot(a: Axes, b: Axes) -> Jet:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _minus(a: Axes, b: Axes) -> Axes:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _unit(v: Axes) -> Axes:
    length = _dot(v, v).root()
    return v[0] / length, v[1] / length, v[2] / length


def _below(piece: Piece, t: float) -> list[Piece]:
    """Return what of a piece of a column lies below a contact position, whole cells."""
    end = int(np.searchsorted(piece.at[:-1], t))
    return [piece.part(0, end)] if end else []


def _above(piece: Piece, t: float) -> list[Piece]:
    """Return what of a piece of a column lies above a contact position, whole cells."""
    first = int(np.searchsorted(piece.at[1:], t, side="right"))
    return [piece.part(first, len(piece.pad_low))] if first < len(piece.pad_low) else []


def contact_jets(
    wheel: ContactWheel, Ts_cutter_flange: Array, t: Array, radius: Array
) -> FlangeJets:
    """Enclose the motion of the flange while a place of the part moves over the wheel.

    Args:
        wheel: The wheel.
        Ts_cutter_flange: The place of each cell, shape (n, 4, 4).
        t: Middle of each cell, all of it on the flat or on one edge, shape (n,).
        radius: Half its width, shape (n,).
    """
    T0 = wheel.T_base_contact0
    slide = np.clip(t, -wheel.flat_end, wheel.flat_end)
    rolled = np.abs(t) > wheel.flat_end
    roll, rolling = t - slide, rolled.astype(float)
    zero = np.zeros_like(t)
    value = Interval(slide, np.where(rolled, 0.0, radius))
    sliding = Jet(value, Interval(1.0 - rolling, zero), Interval(zero, zero))

    def vector(v: Array, origin: bool) -> Axes:
        jets = []
        for axis in range(3):
            x0, y0, z0, p0 = T0[axis]
            cosine, sine = x0 * v[:, 0] + z0 * v[:, 2], x0 * v[:, 2] - z0 * v[:, 0]
            jet = wave(cosine, sine, roll, rolling * radius, np.deg2rad(1.0))
            jet = Jet(jet.value, _shared(rolling, jet.first), _shared(rolling, jet.second))
            jet = jet.plus(y0 * v[:, 1])
            if origin:
                jet = jet.plus(p0) + sliding.times(-x0 / MM_PER_M)
            jets.append(jet)
        return jets[0], jets[1], jets[2]

    x, y, z = (vector(Ts_cutter_flange[:, :3, k], False) for k in range(3))
    return FlangeJets(x, y, z, vector(Ts_cutter_flange[:, :3, 3], True))


def _shared(share: Array, interval: Interval) -> Interval:
    return Interval(share * interval.middle, share * interval.radius)


def _cut_finer(t: Array, parts: np.ndarray) -> Array:
    """Return the ends of cells after each is cut into some parts."""
    cell = np.repeat(np.arange(len(parts)), parts)
    part = np.arange(len(cell)) - np.repeat(np.cumsum(parts) - parts, parts)
    fine = t[cell] + (t[cell + 1] - t[cell]) * (part / parts[cell])
    return np.append(fine, t[-1])


def _runs(kind: np.ndarray) -> list[tuple[int, int]]:
    """Return first and end of every run of equal values."""
    breaks = np.flatnonzero(np.diff(kind)) + 1
    return list(zip([0, *breaks.tolist()], [*breaks.tolist(), len(kind)], strict=True))
