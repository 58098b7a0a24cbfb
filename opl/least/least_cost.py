"""What travel and time on the wheel cost at the least, at any contact positions.

Some cutter points of each pass are known as cells of the contact position, with the postures over
each enclosed. A motion passes a cell of each in order, so it costs no less than the cheapest way
through them; the cells that matter are cut finer until that no longer rises.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem
from opl.search.shortest_way import Cells, WayPrices, cheapest_over_ends, cheapest_ways
from opl.search.walls import UNKNOWN, Wall
from opl.walls.columns import ColumnWalls
from opl.walls.enclosed import ROUND_OFF
from opl.walls.images import Images, seams_of

PLACES = 16  # cutter points of a pass that are looked at first
FEWEST = 4  # that are looked at
PARTS = 2  # that a cell is cut into
ROUNDS = 8  # of cutting cells or leaving out cutter points
MOST_EDGES = 400_000  # between cells of a pass and posture; more are not looked at
CLOSE = 0.01  # fraction of it by which a bound may stay below ways over postures
SLACK = 1e-9  # rounding of the sums that make a bound, as a fraction of it


@dataclass(frozen=True)
class _Cells:
    """Cells of the columns of a pass in one posture, one column after the other.

    Attributes:
        family: Which posture.
        column: Column of each, shape (n,).
        t: Ends of each in belt units, shape (n, 2).
        q: Postures at the ends in [rad], shape (n, 2, 6).
        pad_low: How far below the chord the postures can be, shape (n, 6).
        pad_high: How far above.
    """

    family: int
    column: np.ndarray
    t: Array
    q: Array
    pad_low: Array
    pad_high: Array

    def in_columns(self, n_columns: int) -> Cells:
        """Return them as the search takes them."""
        return Cells(
            self.q[:, 0],
            self.q[:, 1] - self.q[:, 0],
            self.pad_low,
            self.pad_high,
            self.t[:, 0],
            self.t[:, 1],
            np.searchsorted(self.column, np.arange(n_columns + 1)),
        )

    def chosen(self, kept: np.ndarray) -> _Cells:
        """Return some of the cells."""
        return _Cells(
            self.family, self.column[kept], self.t[kept], self.q[kept],
            self.pad_low[kept], self.pad_high[kept],
        )  # fmt: skip

    def renumbered(self, columns: np.ndarray) -> _Cells:
        """Return the cells of some columns, these counted anew."""
        return replace(self, column=np.searchsorted(columns, self.column))


def least_cost(problem: GrindingProblem, travel: float, time: float) -> float:
    """Return what no motion along the passes costs less than, whatever its contact positions.

    Each pass lies on one IK branch; moves between passes are not charged for.

    Args:
        problem: What is to be planned.
        travel: Price of a radian of joint travel on the wheel.
        time: Price of a second on the wheel.
    """
    seams = seams_of(problem.solutions(np.arange(len(problem.points))))
    images = Images(problem.cell.robot, seams, 0.0)
    walls = ColumnWalls(problem.cell, problem.scene.part, problem.points, images)
    total = 0.0
    for index in range(problem.points.n_passes):
        columns = np.flatnonzero(problem.points.pass_index == index)
        share = np.linspace(0, len(columns) - 1, min(PLACES, len(columns)))
        places = columns[np.unique(share.astype(int))]
        arc = np.abs(np.diff(problem.points.arc_length[places]))
        prices = WayPrices(
            travel,
            time,
            arc / problem.process.feed,
            problem.cell.robot.max_speed,
            problem.process.contact_speed,
        )
        made = walls.columns(places.astype(float).tolist())
        families = [_cells(made, family) for family in images.families]
        total += _least_of_pass(problem, places, families, prices)
    return total * (1.0 - SLACK)


def _cells(walls: list[Wall], family: int) -> _Cells:
    pieces = [
        (column, piece)
        for column, wall in enumerate(walls)
        for piece in wall.pieces
        if piece.family == family
    ]
    if not pieces:
        none = np.empty((0, 6))
        return _Cells(family, np.empty(0, int), np.empty((0, 2)), np.empty((0, 2, 6)), none, none)
    return _Cells(
        family,
        np.concatenate([np.full(len(piece.pad_low), column) for column, piece in pieces]),
        np.concatenate([np.stack([one.at[:-1], one.at[1:]], axis=1) for _, one in pieces]),
        np.concatenate(
            [np.stack([one.corners[:-1], one.corners[1:]], axis=1) for _, one in pieces]
        ),
        np.concatenate([piece.pad_low for _, piece in pieces]),
        np.concatenate([piece.pad_high for _, piece in pieces]),
    )


def _least_of_pass(
    problem: GrindingProblem, places: np.ndarray, families: list[_Cells], prices: WayPrices
) -> float:
    """Return what a pass costs at the least; the bound rises no further than what is attained."""
    proven, ceiling = 0.0, np.inf
    for _ in range(ROUNDS):
        n = len(places)
        families = [one for one in families if len(np.unique(one.column)) == n]
        ways, attained = [], np.inf
        for one in families:
            cells = one.in_columns(n)
            potential = cheapest_over_ends(cells, replace(prices, time=0.0))
            ways.append(cheapest_ways(cells, prices, potential))
            # what a way over postures costs: no bound, but beyond it little is to be gained
            over = cheapest_over_ends(cells, prices) if prices.time else potential
            attained = min(attained, float(over[cells.ends.first[-2] :].min()))
        ceiling = min(ceiling, attained)
        proven = max(proven, min(ceiling, *(float(way.min()) for way in ways), np.inf))
        if proven >= ceiling * (1.0 - CLOSE):
            break
        families = [one.chosen(way < ceiling) for one, way in zip(families, ways, strict=True)]
        edges = max((one.in_columns(n).edges for one in families), default=0)
        if edges * PARTS**2 <= MOST_EDGES:
            families = [_cut(problem, places, one) for one in families]
            continue
        # fewer columns lose less where the cells are long
        if n <= FEWEST:
            break
        left = np.unique(np.append(np.arange(0, n, 2), n - 1))
        families = [one.chosen(np.isin(one.column, left)).renumbered(left) for one in families]
        seconds = np.add.reduceat(prices.seconds, left[:-1])
        places, prices = places[left], replace(prices, seconds=seconds)
    return proven


def _cut(problem: GrindingProblem, places: np.ndarray, cells: _Cells) -> _Cells:
    """Return the cells cut into parts.

    The second derivative over a part lies within that over the whole, and pads fall with the
    square of the length. Cells whose pads are not known stay as they are.
    """
    known = np.asarray((cells.pad_high < UNKNOWN).all(axis=1))
    parts = np.where(known, PARTS, 1)
    source = np.repeat(np.arange(len(parts)), parts)
    number = np.arange(len(source)) - np.repeat(np.cumsum(parts) - parts, parts)
    ends = (number[:, None] + np.array([0, 1])) / parts[source][:, None]
    t = cells.t[source]
    t = t[:, :1] * (1.0 - ends) + t[:, 1:] * ends
    chord = cells.q[source]
    chord = chord[:, :1] * (1.0 - ends[..., None]) + chord[:, 1:] * ends[..., None]
    frames = problem.points.Ts_workpiece_cutter[places[cells.column[source]]]
    Ts_base_flange = problem.cell.Ts_base_flange(t, frames[:, None])
    q = inverse_kinematics(problem.cell.robot.arm, Ts_base_flange)[:, :, cells.family]
    q = q + 2.0 * np.pi * np.round((chord - q) / (2.0 * np.pi))
    whole = known[source]
    finer = np.where(whole, PARTS**2, 1)[:, None]
    pad_low = (cells.pad_low[source] + ROUND_OFF) / finer - ROUND_OFF
    pad_high = (cells.pad_high[source] - ROUND_OFF) / finer + ROUND_OFF
    q = np.where(whole[:, None, None], q, chord)
    # no posture at an end of a cell whose pads are known would be a contradiction; stay safe
    lost = np.any(np.isnan(q), axis=(1, 2))
    pad_low[lost], pad_high[lost] = -UNKNOWN, UNKNOWN
    q[lost] = chord[lost]
    return _Cells(cells.family, cells.column[source], t, q, pad_low, pad_high)
