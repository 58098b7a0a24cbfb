"""What travel and time on the wheel cost at the least, at any contact positions.

Some cutter points of each pass are known as cells of the contact position, with the postures over
each enclosed, but for those in which the robot surely collides or the pass cannot begin or end. A
motion passes a cell of each in order, all on one side of each barrier, so it costs no less than the
cheapest way through them; the cells that matter are cut finer, and more cutter points taken in,
until that no longer rises.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.least.posture_cells import FREE, STRUCK, UNSEEN, PostureCells, cut, merged, posture_cells
from opl.planning.problem import GrindingProblem
from opl.search.shortest_way import cheapest_over_ends, cheapest_ways
from opl.search.way_cells import WayPrices
from opl.walls.barriers import all_sides
from opl.walls.columns import ColumnWalls
from opl.walls.images import Images, seams_of
from opl.walls.shut_leads import ShutLeads
from opl.walls.sides import Side

FEWEST = 5  # cutter points of a pass that are looked at first
MOST_WORK = 3000.0  # units, of all passes and rounds
WAYS_OF_WORK = 7000.0  # from cell to cell that cost a unit to look at
CLOSE = 0.002  # fraction of it by which a bound may stay below what is known to be attained
ROUNDS = 8  # of cutting cells, before more cutter points are taken in
SETTLED = 0.002  # by which it may stay below ways over postures: then no more is cut either
LITTLE = 0.25  # of what more cutter points may add at the most: so as well
WIDE = 0.3  # of the widest cell that matters: those that are cut
HALFWAY = 0.5  # to what is attained: cells are cut through which ways cost no more than that
SLACK = 1e-9  # rounding of the sums that make a bound, as a fraction of it


def least_cost(
    problem: GrindingProblem,
    travel: float,
    time: float,
    worth: Array | None = None,
    goes_on: Callable[[float], bool] = lambda _: True,
) -> float:
    """Return what no motion along the passes costs less than, whatever its contact positions.

    Of those that keep the clearances of the plan, with leads as the process sets them. Each pass
    lies on one IK branch; moves between passes are not charged for.

    Args:
        problem: What is to be planned.
        travel: Price of a radian of joint travel on the wheel.
        time: Price of a second on the wheel.
        worth: What is about attained of each pass, shape (n_passes,); no bound is sought beyond.
        goes_on: Given the bound so far, often; says whether to raise it further.
    """
    seams = seams_of(problem.solutions(np.arange(len(problem.points))))
    images = Images(problem.cell.robot, seams, 0.0)
    sides = all_sides(problem)
    walls = ColumnWalls(problem.cell, problem.scene.part, problem.points, images, sides)
    wanted = np.full(problem.points.n_passes, np.inf) if worth is None else worth
    leads, total, left = ShutLeads(problem), 0.0, MOST_WORK
    for index, most in enumerate(wanted.tolist()):
        ended, bound, share = False, 0.0, left / (len(wanted) - index)
        of_pass = _PassBound(problem, walls, leads, sides[index], travel, time, index, share)
        for bound in of_pass.rising(most):
            ended = not goes_on((total + bound) * (1.0 - SLACK))
            if ended:
                break
        total += bound
        left -= share - of_pass.left
        if ended:
            break
    return total * (1.0 - SLACK)


class _PassBound:
    """What a pass costs at the least.

    Args:
        problem: What is to be planned.
        walls: Encloses its cutter points.
        leads: Tells where it cannot begin or end.
        sides: Those that it may take.
        travel: Price of a radian of joint travel.
        time: Price of a second.
        index: The pass.
        left: Units of work that may be done.
    """

    def __init__(
        self,
        problem: GrindingProblem,
        walls: ColumnWalls,
        leads: ShutLeads,
        sides: Sequence[Side],
        travel: float,
        time: float,
        index: int,
        left: float,
    ) -> None:
        self._problem, self._walls, self._leads, self._sides = problem, walls, leads, sides
        self._travel, self._time = travel, time
        self._columns = np.flatnonzero(problem.points.pass_index == index)
        self.left = left

    def rising(self, worth: float) -> Iterator[float]:
        """Yield the bound as it rises, up to what is worth knowing."""
        places, proven, ceiling = self._columns[:0], 0.0, worth
        families = [
            posture_cells([], family, side)
            for family in self._walls.images.families
            for side in self._sides
        ]
        for count in self._counts():
            places, families = self._with_more(places, families, count)
            for _ in range(ROUNDS):
                families = [one for one in families if one.reach(len(places))]
                prices = self._prices(places)
                families = [self._bounded(len(places), prices, one) for one in families]
                least = min((float(one.least.min()) for one in families), default=np.inf)
                proven = max(proven, min(ceiling, least))
                yield proven
                if proven >= ceiling * (1.0 - CLOSE) or self.left < 0.0:
                    return
                # more than the ceiling is not worth knowing
                families = [one.chosen(one.least < ceiling) for one in families]
                likely = proven + HALFWAY * (ceiling - proven)
                families = [self._seen(places, one, likely) for one in families]
                of_each = [self._attained(len(places), prices, one) for one in families]
                attained = min(of_each, default=np.inf)
                adds = count < len(self._columns) and np.isfinite(ceiling)
                more = ceiling - attained if adds else 0.0
                if proven >= attained * (1.0 - SETTLED) or attained - proven <= LITTLE * more:
                    break
                # no bound over these cutter points is larger than what is attained there
                most = proven + HALFWAY * (min(attained, ceiling) - proven)
                families = [
                    self._finer(places, one, own, most)
                    for one, own in zip(families, of_each, strict=True)
                ]

    def _finer(
        self, places: np.ndarray, cells: PostureCells, attained: float, most: float
    ) -> PostureCells:
        """Return cells, those cut finer through which ways may cost less than so much.

        Where all cells at some place seem struck, so that nothing is attained, it is those that
        matter.
        """
        matters = cells.least < most
        if np.isinf(attained):
            matters &= cells.seen == STRUCK
        widest = cells.widths[matters].max(initial=0.0)
        matters &= cells.widths >= WIDE * widest
        return cut(self._problem, places, cells, matters)

    def _seen(self, places: np.ndarray, cells: PostureCells, most: float) -> PostureCells:
        """Return cells with what is seen of collisions and leads, but for those struck all over.

        Cells through which no way costs less than so much are not looked at.
        """
        scene, begun = self._problem.scene, self._problem.scene.work + self._leads.work
        at = np.flatnonzero(cells.known & (cells.seen == UNSEEN) & (cells.least < most))
        struck, surely = np.ones((2, len(at)), dtype=bool)
        for flip in range(len(self._walls.images.flips)):
            there, all_over = self._struck(places, cells, at[struck], flip)
            surely[struck] &= all_over
            struck[struck] = there
        surely &= struck
        seen = cells.seen.copy()
        seen[at] = np.where(struck, STRUCK, FREE)
        kept = np.ones(len(seen), dtype=bool)
        kept[at] = ~surely
        self.left -= scene.work + self._leads.work - begun
        return replace(cells, seen=seen).chosen(kept)

    def _struck(
        self, places: np.ndarray, cells: PostureCells, at: np.ndarray, flip: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return which of some cells are struck in their middle with a flip, and which all over.

        The robot collides there, or the pass cannot begin or end there.
        """
        scene, (sign, shift) = self._problem.scene.collision, self._walls.images.flips[flip]
        q, pads = cells.q[at].mean(axis=1), np.maximum(cells.pad_high, -cells.pad_low)[at]
        q, turned = q * sign + shift, np.abs(np.diff(cells.q[at], axis=1)[:, 0]) / 2.0 + pads
        there = scene.collides(q)
        all_over = there.copy()
        all_over[there] = scene.collides_throughout(q[there], turned[there])
        for end in (0, len(places) - 1):
            own = np.flatnonzero((cells.column[at] == end) & ~all_over)
            T = self._problem.points.frames_at(places[[end]].astype(float))[0]
            sure, shut = self._leads.surely(T, cells.family, flip, *cells.t[at[own]].T)
            there[own] |= shut
            all_over[own] |= sure
        return there, all_over

    def _counts(self) -> Iterator[int]:
        """Yield how many cutter points are looked at, more and more, all at last."""
        count = FEWEST
        while count < len(self._columns):
            yield count
            count = 2 * count - 1
        yield len(self._columns)

    def _with_more(
        self, places: np.ndarray, families: list[PostureCells], count: int
    ) -> tuple[np.ndarray, list[PostureCells]]:
        """Return more cutter points, and the cells of these."""
        share = np.linspace(0, len(self._columns) - 1, count)
        new = np.setdiff1d(self._columns[share.astype(int)], places)
        made = self._walls.columns(new.astype(float).tolist())
        every = np.union1d(places, new)
        at = np.searchsorted(every, places), np.searchsorted(every, new)
        return every, [
            merged(one, posture_cells(made, one.family, one.side), *at) for one in families
        ]

    def _prices(self, places: np.ndarray) -> WayPrices:
        """Return what ways from place to place are charged for."""
        problem = self._problem
        arc = np.abs(np.diff(problem.points.arc_length[places]))
        return WayPrices(
            self._travel,
            self._time,
            arc / problem.process.feed,
            problem.cell.robot.max_speed,
            problem.process.contact_speed,
        )

    def _bounded(self, n_places: int, prices: WayPrices, family: PostureCells) -> PostureCells:
        """Return cells with what ways through them cost at the least."""
        cells = family.in_columns(n_places)
        potential, over_ends = cheapest_over_ends(cells, replace(prices, time=0.0))
        least, looked = cheapest_ways(cells, prices, potential)
        self.left -= (over_ends + looked) / WAYS_OF_WORK
        return replace(family, least=least)

    def _attained(self, n_places: int, prices: WayPrices, family: PostureCells) -> float:
        """Return what the cheapest way over postures costs, of cells that do not seem struck.

        That is no bound, but beyond it little is to be gained.
        """
        free = family.chosen(family.seen != STRUCK)
        if not free.reach(n_places):
            return np.inf
        cells = free.in_columns(n_places)
        over, looked = cheapest_over_ends(cells, prices)
        self.left -= looked / WAYS_OF_WORK
        return float(over[cells.ends.first[-2] :].min())
