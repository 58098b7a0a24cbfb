"""What travel and time cost at the least along one pass.

Some places of the pass are known as cells of the contact position, with the postures over each
enclosed, but for those in which the robot surely collides or the pass cannot begin or end. A motion
passes a cell of each in order, all on one side of each barrier, so it costs no less than the
cheapest way through them; the cells that matter are cut finer, and more places taken in, until that
no longer rises. A way that is cheaper than what is known tells where to look for a track.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from opl.geometry.frames import Array
from opl.least.own_track import OwnTrack
from opl.least.posture_cells import FREE, STRUCK, UNSEEN, PostureCells, cut, merged, posture_cells
from opl.least.telling_places import telling_places, way_prices
from opl.planning.problem import GrindingProblem
from opl.search.chord_ways import cheapest_over_chords, way_over_chords
from opl.search.shortest_way import cheapest_ways
from opl.search.way_cells import WayPrices
from opl.walls.columns import ColumnWalls
from opl.walls.shut_leads import ShutLeads
from opl.walls.sides import Side

FEWEST = 5  # places of a pass that are looked at first
SHORTEST = 0.25  # cutter points: places nearer to each other are not told apart
WAYS_OF_WORK = 7000.0  # from cell to cell that cost a unit to look at
CLOSE = 0.001  # fraction of it by which a bound may stay below what is known to be attained
SETTLED = 0.001  # by which it may stay below ways over postures: then no more is cut either
LITTLE = 0.25  # of what more places may add at the most: so as well
WIDE = 0.3  # of the widest cell that matters: those that are cut
HALFWAY = 0.5  # to what is attained: cells are cut through which ways cost no more than that
MOST_IN_VAIN = 4  # times that a track is sought about a way and none is cheaper than what is known

NO_TRACK = OwnTrack(np.empty(0), np.empty(0, dtype=int), np.empty(0), np.empty((0, 6)))


class PassCost:
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
        attain: Given a way over some places that costs less than what is known, with a posture for
            the IK branch; returns a track about it over all cutter points, if any.

    Attributes:
        left: Units of work that are left.
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
        attain: Callable[[OwnTrack], OwnTrack | None],
    ) -> None:
        self._problem, self._walls, self._leads, self._sides = problem, walls, leads, sides
        self._travel, self._time = travel, time
        self._columns = np.flatnonzero(problem.points.pass_index == index)
        self.left, self._attain = left, attain

    def rising(self, known: OwnTrack) -> Iterator[float]:
        """Yield the bound as it rises, up to what a known track costs."""
        proven, places, in_vain = 0.0, self._columns[:0].astype(float), 0
        families = [
            posture_cells([], family, side)
            for family in self._walls.images.families
            for side in self._sides
        ]
        while len(more := self._more(places, known)):
            places, families = self._with_more(places, families, more)
            asked, cut_finer = in_vain >= MOST_IN_VAIN, True
            while cut_finer:
                begun = self.left
                families = [one for one in families if one.reach(len(places))]
                prices = self._prices(places)
                families = [self._bounded(len(places), prices, one) for one in families]
                least = min((float(one.least.min()) for one in families), default=np.inf)
                proven = max(proven, min(known.cost, least))
                yield proven
                # the next round takes longer than this one
                if proven >= known.cost * (1.0 - CLOSE) or self.left < begun - self.left:
                    return
                # more than is known is not worth knowing
                families = [one.chosen(one.least < known.cost) for one in families]
                likely = proven + HALFWAY * (known.cost - proven)
                families = [self._seen(places, one, likely) for one in families]
                ways = [self._way(places, prices, one) for one in families]
                way = min(ways, key=lambda one: one.cost, default=NO_TRACK)
                if _settled(proven, way.cost, known.cost):
                    if way.cost < known.cost * (1.0 - CLOSE) and not asked:
                        found, asked = self._attain(way) or known, True
                        in_vain += found.cost >= known.cost * (1.0 - CLOSE)
                        known = min(known, found, key=lambda one: one.cost)
                    if _settled(proven, way.cost, known.cost):
                        break
                # no bound over these places is larger than what is attained there
                most, cells = proven + HALFWAY * (min(way.cost, known.cost) - proven), 0
                for index, (one, own) in enumerate(zip(families, ways, strict=True)):
                    families[index] = self._finer(places, one, own.cost, most)
                    cells += len(families[index].t) - len(one.t)
                cut_finer = cells > 0

    def _finer(
        self, places: Array, cells: PostureCells, attained: float, most: float
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

    def _seen(self, places: Array, cells: PostureCells, most: float) -> PostureCells:
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
        self, places: Array, cells: PostureCells, at: np.ndarray, flip: int
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
            T = self._problem.points.frames_at(places[[end]])[0]
            sure, shut = self._leads.surely(T, cells.family, flip, *cells.t[at[own]].T)
            there[own] |= shut
            all_over[own] |= sure
        return there, all_over

    def _more(self, places: Array, known: OwnTrack) -> Array:
        """Return places to take in: those that tell most of what a track costs, or halfway.

        None where no more are told apart.
        """
        if not len(places) and len(known.places):
            ends = self._columns[[0, -1]].astype(float)
            return np.union1d(ends, self._telling(ends, known, FEWEST - 2))
        if not len(places):
            share = np.linspace(0, len(self._columns) - 1, FEWEST)
            return np.unique(self._columns[share.astype(int)]).astype(float)
        if len(known.places) and len(told := self._telling(places, known, len(places) - 1)):
            return told
        gaps = np.diff(places)
        halves = (places[:-1] + places[1:]) / 2.0
        return np.where(gaps > 1.0, np.floor(halves), halves)[gaps > 2.0 * SHORTEST]

    def _telling(self, places: Array, known: OwnTrack, most: int) -> Array:
        track = known.at(np.union1d(known.places, places))
        return telling_places(self._prices(track.places), track, places, most)

    def _with_more(
        self, places: Array, families: list[PostureCells], more: Array
    ) -> tuple[Array, list[PostureCells]]:
        """Return places and some more, and the cells of all."""
        made = self._walls.columns(more.tolist())
        every = np.union1d(places, more)
        at = np.searchsorted(every, places), np.searchsorted(every, more)
        return every, [
            merged(one, posture_cells(made, one.family, one.side), *at) for one in families
        ]

    def _prices(self, places: Array) -> WayPrices:
        """Return what ways from place to place are charged for."""
        return way_prices(self._problem, self._travel, self._time, places)

    def _bounded(self, n_places: int, prices: WayPrices, family: PostureCells) -> PostureCells:
        """Return cells with what ways through them cost at the least."""
        cells = family.in_columns(n_places)
        potential, over_ends = cheapest_over_chords(cells, replace(prices, time=0.0))
        least, looked = cheapest_ways(cells, prices, potential)
        self.left -= (over_ends + looked) / WAYS_OF_WORK
        return replace(family, least=least)

    def _way(self, places: Array, prices: WayPrices, family: PostureCells) -> OwnTrack:
        """Return the cheapest way over chords of cells that do not seem struck.

        What it costs is no bound, but beyond it little is to be gained.
        """
        free = family.chosen(family.seen != STRUCK)
        if not free.reach(len(places)):
            return NO_TRACK
        cells = free.in_columns(len(places))
        total, looked = cheapest_over_chords(cells, prices)
        self.left -= looked / WAYS_OF_WORK
        t, q = way_over_chords(cells, prices, total)
        branch, cost = np.full(len(places), family.family), total[cells.ends.first[-2] :].min()
        return OwnTrack(places, branch, t, q, float(cost))


def _settled(proven: float, attained: float, known: float) -> bool:
    """Return whether little is to be gained over the same places.

    Beside what more of them may add, up to what is known.
    """
    adds = known - attained if np.isfinite(known) else 0.0
    return proven >= attained * (1.0 - SETTLED) or attained - proven <= LITTLE * adds
