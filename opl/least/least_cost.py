"""What travel and time on the wheel cost at the least, at any contact positions.

Some cutter points of each pass are known as cells of the contact position, with the postures over
each enclosed, but for those in which the robot surely collides. A motion passes a cell of each in
order, so it costs no less than the cheapest way through them; the cells that matter are cut finer,
and more cutter points taken in, until that no longer rises.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from opl.cell.inverse_kinematics import inverse_kinematics
from opl.geometry.frames import Array
from opl.planning.problem import GrindingProblem
from opl.search.shortest_way import cheapest_over_ends, cheapest_ways
from opl.search.walls import UNKNOWN, Wall
from opl.search.way_cells import Cells, WayPrices
from opl.walls.columns import ColumnWalls
from opl.walls.enclosed import ROUND_OFF
from opl.walls.images import Images, seams_of

FEWEST = 5  # cutter points of a pass that are looked at first
PARTS = 2  # that a cell is cut into
MOST_WORK = 4e7  # ways from cell to cell that are looked at, of all passes and rounds
CLOSE = 0.01  # fraction of it by which a bound may stay below what is known to be attained
ROUNDS = 8  # of cutting cells, before more cutter points are taken in
SETTLED = 0.005  # by which it may stay below ways over postures: then no more is cut either
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


def least_cost(
    problem: GrindingProblem,
    travel: float,
    time: float,
    worth: Array | None = None,
    goes_on: Callable[[float], bool] = lambda _: True,
) -> float:
    """Return what no motion along the passes costs less than, whatever its contact positions.

    Of those that keep the clearances of the plan. Each pass lies on one IK branch; moves between
    passes are not charged for.

    Args:
        problem: What is to be planned.
        travel: Price of a radian of joint travel on the wheel.
        time: Price of a second on the wheel.
        worth: What is about attained of each pass, shape (n_passes,); no bound is sought beyond.
        goes_on: Given the bound so far, often; says whether to raise it further.
    """
    seams = seams_of(problem.solutions(np.arange(len(problem.points))))
    images = Images(problem.cell.robot, seams, 0.0)
    walls = ColumnWalls(problem.cell, problem.scene.part, problem.points, images)
    wanted = np.full(problem.points.n_passes, np.inf) if worth is None else worth
    total = 0.0
    for index, most in enumerate(wanted.tolist()):
        ended, bound = False, 0.0
        for bound in _PassBound(problem, walls, travel, time, index).rising(most):
            ended = not goes_on((total + bound) * (1.0 - SLACK))
            if ended:
                break
        total += bound
        if ended:
            break
    return total * (1.0 - SLACK)


class _PassBound:
    """What a pass costs at the least.

    Args:
        problem: What is to be planned.
        walls: Encloses its cutter points.
        travel: Price of a radian of joint travel.
        time: Price of a second.
        index: The pass.
    """

    def __init__(
        self, problem: GrindingProblem, walls: ColumnWalls, travel: float, time: float, index: int
    ) -> None:
        self._problem, self._walls = problem, walls
        self._travel, self._time = travel, time
        self._columns = np.flatnonzero(problem.points.pass_index == index)
        self._left = MOST_WORK / problem.points.n_passes  # ways that may be looked at

    def rising(self, worth: float) -> Iterator[float]:
        """Yield the bound as it rises, up to what is worth knowing."""
        places, proven, ceiling = self._columns[:0], 0.0, worth
        families = [_cells([], family) for family in self._walls.images.families]
        for count in self._counts():
            places, families = self._with_more(places, families, count)
            for _ in range(ROUNDS):
                families = [one for one in families if len(np.unique(one.column)) == len(places)]
                cells = [one.in_columns(len(places)) for one in families]
                self._left -= sum(one.edges for one in cells)
                if self._left < 0.0:
                    return
                bounds, attained = self._ways(places, cells)
                proven = max(proven, min(ceiling, *(float(way.min()) for way in bounds), np.inf))
                yield proven
                if proven >= ceiling * (1.0 - CLOSE):
                    return
                families, bounds = _below(families, bounds, ceiling)
                if proven >= attained * (1.0 - SETTLED):
                    break
                # no bound over these cutter points is larger than what is attained there
                families = [
                    self._without_collisions(_cut(self._problem, places, one, way < attained))
                    for one, way in zip(families, bounds, strict=True)
                ]

    def _without_collisions(self, cells: _Cells) -> _Cells:
        """Return cells but for those in which the robot surely collides all over."""
        middle, pads = cells.q.mean(axis=1), np.maximum(cells.pad_high, -cells.pad_low)
        turned = np.abs(np.diff(cells.q, axis=1)[:, 0]) / 2.0 + pads
        struck = np.asarray((pads < UNKNOWN).all(axis=1))
        scene = self._problem.scene.collision
        for sign, shift in self._walls.images.flips:
            at = np.flatnonzero(struck)
            q = middle[at] * sign + shift
            struck[at] = scene.collides(q)
            at, q = at[struck[at]], q[struck[at]]
            struck[at] = scene.collides_throughout(q, turned[at])
        return cells.chosen(~struck)

    def _counts(self) -> Iterator[int]:
        """Yield how many cutter points are looked at, more and more, all at last."""
        count = FEWEST
        while count < len(self._columns):
            yield count
            count = 2 * count - 1
        yield len(self._columns)

    def _with_more(
        self, places: np.ndarray, families: list[_Cells], count: int
    ) -> tuple[np.ndarray, list[_Cells]]:
        """Return more cutter points, and the cells of these."""
        share = np.linspace(0, len(self._columns) - 1, count)
        new = np.setdiff1d(self._columns[share.astype(int)], places)
        made = self._walls.columns(new.astype(float).tolist())
        every = np.union1d(places, new)
        at = np.searchsorted(every, places), np.searchsorted(every, new)
        merged = [_merged(one, _cells(made, one.family), *at) for one in families]
        return every, merged

    def _ways(self, places: np.ndarray, families: list[Cells]) -> tuple[list[Array], float]:
        """Return what ways through cells cost at the least, and what the cheapest over postures."""
        problem = self._problem
        arc = np.abs(np.diff(problem.points.arc_length[places]))
        prices = WayPrices(
            self._travel,
            self._time,
            arc / problem.process.feed,
            problem.cell.robot.max_speed,
            problem.process.contact_speed,
        )
        ways, attained = [], np.inf
        for cells in families:
            potential = cheapest_over_ends(cells, replace(prices, time=0.0))
            ways.append(cheapest_ways(cells, prices, potential))
            # what a way over postures costs: no bound, but beyond it little is to be gained
            over = cheapest_over_ends(cells, prices) if prices.time else potential
            attained = min(attained, float(over[cells.ends.first[-2] :].min()))
        return ways, attained


def _below(
    families: list[_Cells], bounds: list[Array], ceiling: float
) -> tuple[list[_Cells], list[Array]]:
    """Return the cells through which a way may cost less than so much, and what it costs then."""
    kept = [way < ceiling for way in bounds]
    return (
        [one.chosen(chosen) for one, chosen in zip(families, kept, strict=True)],
        [way[chosen] for way, chosen in zip(bounds, kept, strict=True)],
    )


def _merged(old: _Cells, new: _Cells, at_old: np.ndarray, at_new: np.ndarray) -> _Cells:
    """Return the cells of two sets of columns, which have these numbers then."""
    column = np.concatenate([at_old[old.column], at_new[new.column]])
    both = _Cells(
        old.family,
        column,
        np.concatenate([old.t, new.t]),
        np.concatenate([old.q, new.q]),
        np.concatenate([old.pad_low, new.pad_low]),
        np.concatenate([old.pad_high, new.pad_high]),
    )
    return both.chosen(np.argsort(column, kind="stable"))


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


def _cut(problem: GrindingProblem, places: np.ndarray, cells: _Cells, chosen: np.ndarray) -> _Cells:
    """Return the cells, some of them cut into parts.

    The second derivative over a part lies within that over the whole, and pads fall with the
    square of the length. Cells whose pads are not known stay as they are.
    """
    known = np.asarray((cells.pad_high < UNKNOWN).all(axis=1) & chosen)
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
